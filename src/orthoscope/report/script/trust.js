/* Where it may be trusted. */
function trust() {
  const d = panels.trust,
    photograph = document.getElementById("before");
  let at = "far";
  const known = { far: d.far, near: d.near };
  const most = 3 * Math.max(d.limit, 1e-6);
  const smalls = Object.fromEntries(
    Object.entries(known).map(([name, values]) => [
      name,
      stretched(
        d,
        values.map(v => (v == null ? null : [...mixed(CIVIDIS, 1 - v / units.residual / most), 255])),
      ),
    ]),
  );
  const plot = new Plot("trust", {
    ...overFrame,
    margin: { l: 8, r: 8, t: 40, b: 8 },
    labels: null,
    /* what stands above it and below: the map is seen whole without scrolling */
    tallest: () => clamp(innerHeight - 290, 240, 560),
    paint: p => {
      const g = p.ctx,
        x = p.X(-0.5),
        y = p.Y(-0.5),
        w = p.X(frame.width - 0.5) - x,
        h = p.Y(frame.height - 0.5) - y;
      g.fillStyle = css("--desk");
      g.fillRect(x, y, w, h);
      const seen = photograph && photograph.complete && photograph.naturalWidth;
      if (seen) {
        g.filter = at === "none" ? "none" : "grayscale(1)";
        g.drawImage(photograph, x, y, w, h);
        g.filter = "none";
      }
      if (at === "none") return;
      overlay(p, smalls[at], seen ? 0.5 : 0.9);
      outline(p, true);
      for (const [colour, width] of [
        ["#000", 5],
        ["#fff", 2.5],
      ]) {
        g.strokeStyle = colour;
        g.lineWidth = width;
        outline(p);
        g.stroke();
      }
      g.lineWidth = 1;
    },
    after: p => {
      const g = p.ctx;
      scale(p, t => heat(t), 0, most, "px or more");
      g.textAlign = "left";
      g.textBaseline = "bottom";
      g.fillStyle = css("--soft");
      g.fillText(`within the line: ${short(d.limit)} px or less`, p.box.x, p.box.y - 6);
    },
    find: (p, x, y) => {
      const u = p.atX(x),
        v = p.atY(y),
        values = known[at] || d.far,
        value = sampled(d, values, u, v);
      return inFrame(u, v)
        ? {
            text:
              value == null
                ? "the lens has no image here"
                : `at ${u.toFixed(0)}, ${v.toFixed(0)}: predicted error ${px(value / units.residual)}`,
          }
        : null;
    },
  });
  function outline(p, dim = false) {
    const g = p.ctx,
      r = d.region;
    g.beginPath();
    if (dim)
      g.rect(p.X(-0.5), p.Y(-0.5), p.X(frame.width - 0.5) - p.X(-0.5), p.Y(frame.height - 0.5) - p.Y(-0.5));
    for (let i = 0; i < r.length; i += 2)
      g[i ? "lineTo" : "moveTo"](p.X(r[i] / units.place), p.Y(r[i + 1] / units.place));
    g.closePath();
    if (dim) {
      g.fillStyle = "rgb(0 0 0 / .28)";
      g.fill("evenodd");
    }
  }
  plot.choice(
    "of what",
    [
      ["far", "of what is far away"],
      ["near", `at ${short(d.distance)} m`],
      ["none", "photograph alone"],
    ],
    "far",
    value => {
      at = value;
    },
  );
  if (photograph && !photograph.complete) photograph.addEventListener("load", () => plot.later());
}
