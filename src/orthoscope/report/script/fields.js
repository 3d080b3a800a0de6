/* Smooth fields: a small picture of colours stretched over the frame, contours and arrows on top. */
function stretched(d, colours) {
  const small = Object.assign(document.createElement("canvas"), { width: d.columns, height: d.rows }),
    g = small.getContext("2d");
  const image = g.createImageData(d.columns, d.rows);
  colours.forEach((c, i) => image.data.set(c || [0, 0, 0, 0], 4 * i));
  g.putImageData(image, 0, 0);
  return small;
}
function overlay(p, small, alpha = 1) {
  const g = p.ctx,
    x = p.X(-0.5),
    y = p.Y(-0.5);
  g.globalAlpha = alpha;
  g.imageSmoothingEnabled = true;
  g.imageSmoothingQuality = "high";
  g.drawImage(small, x, y, p.X(frame.width - 0.5) - x, p.Y(frame.height - 0.5) - y);
  g.globalAlpha = 1;
}
function sampled(d, values, x, y) {
  /* bilinear between the cells' centres; null beside a place without a value */
  const u = clamp(((x + 0.5) / frame.width) * d.columns - 0.5, 0, d.columns - 1),
    v = clamp(((y + 0.5) / frame.height) * d.rows - 0.5, 0, d.rows - 1);
  const i = Math.min(d.columns - 2, Math.floor(u)),
    j = Math.min(d.rows - 2, Math.floor(v)),
    f = u - i,
    h = v - j;
  const at = (a, b) => values[b * d.columns + a];
  const four = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
  if (four.some(value => value == null)) return null;
  return (four[0] * (1 - f) + four[1] * f) * (1 - h) + (four[2] * (1 - f) + four[3] * f) * h;
}
function contours(p, d, values, levels) {
  const g = p.ctx,
    X = i => p.X(((i + 0.5) / d.columns) * frame.width - 0.5),
    Y = j => p.Y(((j + 0.5) / d.rows) * frame.height - 0.5);
  for (const level of levels) {
    g.beginPath();
    for (let j = 0; j + 1 < d.rows; j++)
      for (let i = 0; i + 1 < d.columns; i++) {
        const q = [
          [i, j],
          [i + 1, j],
          [i + 1, j + 1],
          [i, j + 1],
        ].map(([a, b]) => ({ a, b, v: values[b * d.columns + a] }));
        if (q.some(c => c.v == null)) continue;
        const cut = [];
        for (let e = 0; e < 4; e++) {
          const s = q[e],
            t = q[(e + 1) % 4];
          if (s.v < level !== t.v < level) {
            const f = (level - s.v) / (t.v - s.v);
            cut.push([X(s.a + f * (t.a - s.a)), Y(s.b + f * (t.b - s.b))]);
          }
        }
        for (let e = 0; e + 1 < cut.length; e += 2) {
          g.moveTo(...cut[e]);
          g.lineTo(...cut[e + 1]);
        }
      }
    g.stroke();
  }
}
function field(name, words) {
  const d = panels[name],
    size = d.x.map((x, i) => (x == null ? null : Math.hypot(x, d.y[i]) / units.residual));
  const top = Math.max(...size.map(v => v ?? 0), 1e-9),
    levels = ticks([0, top], 6).filter(v => v > 0);
  const small = stretched(
    d,
    size.map(v => (v == null ? null : [...mixed(CIVIDIS, 1 - v / top), 255])),
  );
  new Plot(name, {
    ...overFrame,
    paint: p => {
      const g = p.ctx;
      overlay(p, small);
      g.strokeStyle = "rgb(255 255 255 / .8)";
      contours(p, d, size, levels);
      const by = Math.max(frame.width, frame.height) / 12;
      for (const [colour, width] of [
        ["rgb(0 0 0 / .6)", 3],
        ["#fff", 1.2],
      ]) {
        g.strokeStyle = colour;
        g.lineWidth = width;
        g.beginPath();
        for (let y = by / 2; y < frame.height; y += by)
          for (let x = by / 2; x < frame.width; x += by) {
            const a = sampled(d, d.x, x, y),
              b = sampled(d, d.y, x, y);
            if (a != null && b != null) {
              const f = (0.9 * by) / (top * units.residual);
              arrow(
                g,
                p.X(x - (f * a) / 2),
                p.Y(y - (f * b) / 2),
                p.X(x + (f * a) / 2),
                p.Y(y + (f * b) / 2),
              );
            }
          }
        g.stroke();
      }
      cross(p, data.centre[0], data.centre[1]);
    },
    after: p => scale(p, heat, 0, top, words),
    find: (p, x, y) => {
      const u = p.atX(x),
        v = p.atY(y),
        a = sampled(d, d.x, u, v),
        b = sampled(d, d.y, u, v);
      return inFrame(u, v) && a != null
        ? {
            text: `at ${u.toFixed(0)}, ${v.toFixed(0)}: ${px(Math.hypot(a, b) / units.residual)} (${short(a / units.residual)}, ${short(b / units.residual)})`,
          }
        : null;
    },
  });
}
const inFrame = (x, y) => x >= -0.5 && y >= -0.5 && x <= frame.width - 0.5 && y <= frame.height - 0.5;
function cross(p, x, y) {
  const g = p.ctx;
  for (const [colour, width] of [
    ["#000", 4],
    [css("--amber"), 2],
  ]) {
    g.strokeStyle = colour;
    g.lineWidth = width;
    line(g, p.X(x) - 7, p.Y(y), p.X(x) + 7, p.Y(y));
    line(g, p.X(x), p.Y(y) - 7, p.X(x), p.Y(y) + 7);
  }
  g.lineWidth = 1;
}
