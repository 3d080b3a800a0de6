/* What was tried. */
function choice() {
  const rows = panels.choice.candidates,
    top = Math.max(...rows.map(r => r.heldOut + (r.error || 0))) * 1.05,
    ruler = document.createElement("canvas").getContext("2d");
  /* names stand to the left, whole where half of the figure holds them, else on two lines */
  ruler.font = `600 12px ${css("--sans")}`;
  const widest = texts => Math.max(...texts.map(text => ruler.measureText(text).width));
  const parts = r => (narrow ? r.name.split(", ") : [r.name]);
  const room = (document.querySelector("#choice .stage").clientWidth || 400) * 0.5,
    narrow = widest(rows.map(r => r.name)) > room,
    left = Math.ceil(widest(rows.flatMap(parts))) + 18;
  new Plot("choice", {
    zooms: false,
    labels: ["held-out rms (px per point)", ""],
    gridX: true,
    margin: { l: left, r: 16, t: 8, b: 42 },
    range: () => ({ x: [0, top], y: [-0.6, rows.length - 0.4] }),
    height: () => (narrow ? 40 : 26) * rows.length + 10,
    axes() {
      const g = this.ctx,
        { x, y, w, h } = this.box;
      g.strokeStyle = css("--line");
      g.fillStyle = css("--soft");
      g.textAlign = "center";
      g.textBaseline = "top";
      for (const v of ticks(this.shown.x, w / 70)) {
        line(g, this.X(v), y, this.X(v), y + h);
        g.fillText(short(v), this.X(v), y + h + 6);
      }
      g.textBaseline = "bottom";
      const half = g.measureText(this.labels[0]).width / 2;
      g.fillText(this.labels[0], Math.min(x + w / 2, this.width - half - 2), this.tall - 4);
      g.textAlign = "right";
      g.textBaseline = "middle";
      rows.forEach((r, i) => {
        g.fillStyle = css(r.loses === 0 ? "--ink" : "--soft");
        g.font = `${r.loses === 0 ? "600 " : ""}12px ${css("--sans")}`;
        parts(r).forEach((part, k, all) => g.fillText(part, x - 8, this.Y(i) + 15 * (k - (all.length - 1) / 2)));
      });
      g.font = `12px ${css("--sans")}`;
    },
    paint: p => {
      const g = p.ctx;
      rows.forEach((r, i) => {
        g.strokeStyle = g.fillStyle = css(r.loses === 0 ? "--amber" : "--blue");
        g.lineWidth = 2;
        if (r.error) line(g, p.X(r.heldOut - r.error), p.Y(i), p.X(r.heldOut + r.error), p.Y(i));
        g.beginPath();
        g.arc(p.X(r.heldOut), p.Y(i), r.loses === 0 ? 6 : 4.5, 0, 7);
        g.fill();
      });
    },
    find: (p, x, y) => {
      const i = Math.round(p.atY(y)),
        r = rows[i];
      return r
        ? {
            text: `${r.name}: ${r.told}, ${r.loses === 0 ? "taken" : r.loses == null ? "" : r.loses > 0 ? `loses ${px(r.loses)}` : `would gain ${px(-r.loses)}`}`,
          }
        : null;
    },
  });
}
