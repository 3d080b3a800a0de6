/* Entries side by side: error held out and on photographs that were used, best on top. */
function comparison() {
  const rows = panels.comparison.entries,
    known = rows.filter(r => r.heldOut != null),
    wide = Math.max(...known.map(r => r.heldOut)) > 4 * Math.min(...known.map(r => r.heldOut));
  const least = 0.7 * Math.min(...known.map(r => Math.min(r.used || r.heldOut, r.heldOut))),
    most = 1.1 * Math.max(...known.map(r => r.heldOut + 2 * (r.error || 0)));
  const at = v => (wide && least > 0 ? Math.log10(Math.max(v, least)) : v);
  new Plot("comparison", {
    zooms: false,
    labels: [],
    margin: { l: 170, r: 16, t: 30, b: 42 },
    range: () => ({
      x: [known.length ? at(wide ? least : 0) : 0, known.length ? at(most) : 1],
      y: [-0.6, rows.length - 0.4],
    }),
    height: () => 30 * rows.length + 10,
    axes() {
      const g = this.ctx,
        { x, y, w, h } = this.box,
        marks =
          wide && least > 0
            ? [-3, -2, -1, 0, 1, 2]
                .flatMap(e => [1, 2, 5].map(m => m * 10 ** e))
                .filter(v => v >= least && v <= most)
            : ticks([0, most], w / 80);
      g.strokeStyle = css("--line");
      g.fillStyle = css("--soft");
      g.textAlign = "center";
      g.textBaseline = "top";
      for (const v of marks) {
        line(g, this.X(at(v)), y, this.X(at(v)), y + h);
        g.fillText(short(v), this.X(at(v)), y + h + 6);
      }
      g.textBaseline = "bottom";
      g.fillText("error (px per point)", x + w / 2, this.tall - 4);
      g.textAlign = "right";
      g.textBaseline = "middle";
      rows.forEach((r, i) => {
        g.fillStyle = css("--ink");
        g.fillText(r.name.length > 24 ? r.name.slice(0, 23) + "…" : r.name, x - 8, this.Y(i));
      });
    },
    paint: p => {
      const g = p.ctx;
      rows.forEach((r, i) => {
        g.textAlign = "left";
        g.textBaseline = "middle";
        if (r.heldOut == null) {
          g.fillStyle = css("--soft");
          g.fillText(r.failure || "not judged", p.box.x + 4, p.Y(i));
          return;
        }
        g.lineWidth = 2;
        g.strokeStyle = g.fillStyle = css("--amber");
        if (r.error)
          line(
            g,
            p.X(at(Math.max(r.heldOut - 2 * r.error, least))),
            p.Y(i),
            p.X(at(r.heldOut + 2 * r.error)),
            p.Y(i),
          );
        g.beginPath();
        g.arc(p.X(at(r.heldOut)), p.Y(i), 5.5, 0, 7);
        g.fill();
        g.fillStyle = css("--blue");
        const u = p.X(at(r.used));
        g.beginPath();
        g.moveTo(u, p.Y(i) - 6);
        g.lineTo(u + 6, p.Y(i));
        g.lineTo(u, p.Y(i) + 6);
        g.lineTo(u - 6, p.Y(i));
        g.fill();
      });
    },
    after: p => {
      const g = p.ctx;
      g.textAlign = "left";
      g.textBaseline = "middle";
      g.fillStyle = css("--amber");
      g.beginPath();
      g.arc(p.box.x + 6, 14, 5, 0, 7);
      g.fill();
      g.fillStyle = css("--soft");
      g.fillText("held out, ± 2 standard errors", p.box.x + 17, 14);
      const x = p.box.x + 40 + g.measureText("held out, ± 2 standard errors").width;
      g.fillStyle = css("--blue");
      g.beginPath();
      g.moveTo(x, 8);
      g.lineTo(x + 6, 14);
      g.lineTo(x, 20);
      g.lineTo(x - 6, 14);
      g.fill();
      g.fillStyle = css("--soft");
      g.fillText("used", x + 11, 14);
    },
    find: (p, x, y) => {
      const r = rows[Math.round(p.atY(y))];
      return r
        ? {
            text: `${r.name}: ${r.heldOut == null ? r.failure : `held out ${r.told}, used ${px(r.used)}${r.loses ? `, loses ${px(r.loses)}` : ""}`}`,
          }
        : null;
    },
  });
}
