/* The target's corners, displacements magnified. */
function target(name) {
  const d = panels[name],
    known = d.moved.map(m => m[0] != null);
  const sizes = d.moved.filter((_, i) => known[i]).map(m => Math.hypot(...m)),
    low = [0, 1].map(c => Math.min(...d.points.map(q => q[c]))),
    high = [0, 1].map(c => Math.max(...d.points.map(q => q[c])));
  const diagonal = Math.hypot(high[0] - low[0], high[1] - low[1]),
    magnified = below((0.12 * diagonal) / Math.max(quantile(sizes, 0.95), 1e-9));
  const top = Math.max(...d.moved.map((m, i) => (known[i] ? Math.abs(m[2]) : 0)), 1e-6),
    columns = data.columns;
  const placed = d.points.map((q, i) => (known[i] ? q.map((v, c) => v + magnified * d.moved[i][c]) : q));
  new Solid(name, {
    yaw: -0.5,
    pitch: 0.75,
    paint: p => {
      const g = p.ctx,
        to = p.aim([...d.points, ...placed]),
        flat = d.points.map(to),
        at = placed.map(to);
      const mesh = (where, colour, width) => {
        g.strokeStyle = colour;
        g.lineWidth = width;
        g.beginPath();
        if (columns)
          where.forEach((q, i) => {
            if ((i + 1) % columns && i + 1 < where.length && known[i] && known[i + 1]) {
              g.moveTo(q[0], q[1]);
              g.lineTo(where[i + 1][0], where[i + 1][1]);
            }
            if (i + columns < where.length && known[i] && known[i + columns]) {
              g.moveTo(q[0], q[1]);
              g.lineTo(where[i + columns][0], where[i + columns][1]);
            }
          });
        g.stroke();
      };
      mesh(flat, css("--line"), 1);
      g.strokeStyle = css("--soft");
      g.beginPath();
      flat.forEach((q, i) => {
        if (known[i]) {
          g.moveTo(q[0], q[1]);
          g.lineTo(at[i][0], at[i][1]);
        }
      });
      g.stroke();
      mesh(at, css("--ink"), 1);
      const dot = clamp(90 / Math.sqrt(d.points.length), 1.5, 5.5);
      at.forEach((q, i) => {
        if (!known[i]) return;
        g.fillStyle = paint(SIGNED, 0.5 - (0.5 * d.moved[i][2]) / top);
        g.beginPath();
        g.arc(q[0], q[1], dot, 0, 7);
        g.fill();
        g.strokeStyle = css("--soft");
        g.stroke();
      });
      p.at = at;
    },
    after: p => {
      const g = p.ctx;
      g.fillStyle = css("--soft");
      g.textAlign = "left";
      g.textBaseline = "bottom";
      g.fillText(`displacements × ${short(magnified)}`, p.box.x + 4, p.box.y - 6);
      scale(p, t => paint(SIGNED, 1 - t), -top, top, "mm away");
    },
    find: (p, x, y) => {
      let best = 14,
        found = null;
      (p.at || []).forEach((q, i) => {
        const far = Math.hypot(q[0] - x, q[1] - y);
        if (known[i] && far < best) {
          best = far;
          const m = d.moved[i];
          found = {
            text: `corner ${i}: ${short(m[0])}, ${short(m[1])} mm in the plane, ${short(m[2])} mm out of it`,
          };
        }
      });
      return found;
    },
  });
}
