/* Boards in space, where each was. */
function poses() {
  const d = panels.poses,
    board = d.boards || views.map(() => 0); // which of several boards a view shows
  const placed = views.map((v, i) =>
    d.outlines[board[i]].map(q =>
      [0, 1, 2].map(
        r => v.pose[3 * r] * q[0] + v.pose[3 * r + 1] * q[1] + v.pose[3 * r + 2] * q[2] + v.pose[9 + r],
      ),
    ),
  );
  const all = [[0, 0, 0], ...d.frustum, ...placed.flat()];
  new Solid("poses", {
    paint: p => {
      const g = p.ctx,
        to = p.aim(all),
        eye = to([0, 0, 0]),
        front = d.frustum.map(to);
      const boards = placed
        .map((corners4, i) => ({ i, at: corners4.map(to) }))
        .filter(b => !state.off.has(b.i));
      const depth = b => b.at.reduce((s, q) => s + q[2], 0) + (b.i === state.picked ? -1e9 : 0);
      boards.sort((a, b) => depth(b) - depth(a));
      p.boards = boards;
      g.lineWidth = 1.2;
      for (const b of boards) {
        const mine = b.i === state.picked,
          dimmed = state.picked != null && !mine;
        g.fillStyle = g.strokeStyle = css(views[b.i].suspect ? "--red" : mine ? "--amber" : "--blue");
        g.beginPath();
        b.at.forEach(([x, y], k) => g[k ? "lineTo" : "moveTo"](x, y));
        g.closePath();
        g.globalAlpha = mine ? 0.6 : dimmed ? 0.04 : clamp(4 / boards.length, 0.05, 0.28);
        g.fill();
        g.globalAlpha = dimmed ? 0.25 : 0.9;
        g.lineWidth = mine ? 2.5 : 1;
        g.stroke();
        if (mine || (boards.length <= 30 && !dimmed)) {
          g.globalAlpha = 1;
          g.fillStyle = css("--ink");
          g.textAlign = "center";
          g.textBaseline = "middle";
          const m = [0, 1].map(c => b.at.reduce((s, q) => s + q[c], 0) / 4);
          g.fillText(`${b.i + 1}`, ...m);
        }
      }
      g.globalAlpha = 1;
      g.lineWidth = 1.5;
      g.strokeStyle = css("--ink");
      front.forEach((q, k) => {
        const next = front[(k + 1) % 4];
        line(g, eye[0], eye[1], q[0], q[1]);
        line(g, q[0], q[1], next[0], next[1]);
      });
    },
    after: p => {
      const g = p.ctx,
        reach = Math.max(...placed.flat().map(q => q[2]), 0);
      g.fillStyle = css("--soft");
      g.textAlign = "left";
      g.textBaseline = "bottom";
      g.fillText(`boards up to ${short(reach)} m away`, p.box.x + 4, p.box.y - 6);
    },
    find: (p, x, y) => {
      const found = [...(p.boards || [])].reverse().find(b => inside(b.at, x, y));
      return found
        ? {
            view: found.i,
            text: `${tellView(found.i)}; ${short(Math.hypot(...views[found.i].pose.slice(9)))} m away`,
          }
        : null;
    },
  });
}
function inside(polygon, x, y) {
  let odd = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [xi, yi] = polygon[i],
      [xj, yj] = polygon[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) odd = !odd;
  }
  return odd;
}
