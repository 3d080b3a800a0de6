/* The lens from its axis outwards. */
function curve() {
  const d = panels.curve,
    last = d.angles[d.angles.length - 1],
    colours = { seen: "--amber", edge: "--ink", end: "--red" };
  let shown = "radius";
  const span = band => [Math.min(0, ...band.low), Math.max(0, ...band.high)];
  const plot = new Plot("curve", {
    gridY: true,
    labels: ["angle from the axis (°)", ""],
    margin: { l: 60, r: 14, t: 78, b: 42 },
    height: inner => clamp(0.6 * inner, 200, 320),
    range: () => {
      const [low, high] = span(d[shown]),
        pad = 0.06 * (high - low || 1);
      return { x: [0, last], y: [high + pad, shown === "radius" ? 0 : low - pad] };
    },
    paint: p => {
      const g = p.ctx,
        band = d[shown];
      p.labels[1] = shown === "radius" ? "distance (px)" : "displacement (px)";
      const seen = d.marks.find(m => m.kind === "seen");
      if (seen) {
        g.fillStyle = css("--amber");
        g.globalAlpha = 0.12;
        g.fillRect(p.X(seen.angle), p.box.y, p.box.x + p.box.w - p.X(seen.angle), p.box.h);
      }
      g.fillStyle = css("--blue");
      g.globalAlpha = 0.25;
      g.beginPath();
      d.angles.forEach((a, i) => g[i ? "lineTo" : "moveTo"](p.X(a), p.Y(band.low[i])));
      [...d.angles].reverse().forEach((a, i) => g.lineTo(p.X(a), p.Y(band.high[d.angles.length - 1 - i])));
      g.fill();
      g.globalAlpha = 1;
      const drawn = (f, colour, dash, width) => {
        g.strokeStyle = css(colour);
        g.setLineDash(dash);
        g.lineWidth = width;
        g.beginPath();
        let begun = false;
        d.angles.forEach((a, i) => {
          const v = f(a, i);
          if (v == null || !isFinite(v) || (v < 0 && shown === "radius")) return;
          g[begun ? "lineTo" : "moveTo"](p.X(a), p.Y(v));
          begun = true;
        });
        g.stroke();
        g.setLineDash([]);
      };
      if (shown === "radius") {
        drawn(a => (a < 89 ? d.focal * Math.tan((a * Math.PI) / 180) : null), "--soft", [5, 4], 1.2);
        drawn(a => (d.focal * a * Math.PI) / 180, "--soft", [1, 3], 1.4);
      } else drawn(() => 0, "--soft", [5, 4], 1);
      drawn((a, i) => band.mean[i], "--blue", [], 2);
      for (const m of d.marks) {
        g.strokeStyle = css(colours[m.kind]);
        g.lineWidth = 1.5;
        line(g, p.X(m.angle), p.box.y, p.X(m.angle), p.box.y + p.box.h);
      }
    },
    after: p => {
      const g = p.ctx;
      let x = 8,
        y = 14;
      g.textBaseline = "middle";
      g.textAlign = "left";
      const put = (colour, dash, words) => {
        const wide = 34 + g.measureText(words).width;
        if (x + wide > p.width && x > 8) {
          x = 8;
          y += 18;
        }
        g.strokeStyle = css(colour);
        g.setLineDash(dash);
        g.lineWidth = 2;
        line(g, x, y, x + 20, y);
        g.setLineDash([]);
        g.fillStyle = css("--soft");
        g.fillText(words, x + 25, y);
        x += wide + 12;
      };
      put("--blue", [], "this lens");
      if (shown === "radius") {
        put("--soft", [5, 4], "f tan θ");
        put("--soft", [1, 3], "f θ");
      }
      for (const m of d.marks) put(colours[m.kind], [], `${m.words}, ${m.angle.toFixed(1)}°`);
    },
    find: (p, x) => {
      const a = p.atX(x);
      if (a < 0 || a > last) return null;
      const i = Math.round((a / last) * (d.angles.length - 1));
      return {
        text: `${d.angles[i].toFixed(1)}°: ${px(d.radius.mean[i])} from the principal point, moved ${px(d.moved.mean[i])}`,
      };
    },
  });
  plot.choice(
    "what is shown",
    [
      ["radius", "distance"],
      ["moved", "displacement"],
    ],
    "radius",
    value => {
      shown = value;
      plot.zoomed = null;
    },
  );
}
