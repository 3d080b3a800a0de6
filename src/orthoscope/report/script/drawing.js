/* What figures share: round numbers along axes, lines, arrows, colours explained. */
function kept(span, all) {
  /* moved back inside the whole */
  const sign = Math.sign(all[1] - all[0]) || 1,
    s = span.map(v => v * sign),
    a = all.map(v => v * sign);
  const by = s[0] < a[0] ? a[0] - s[0] : s[1] > a[1] ? a[1] - s[1] : 0;
  return s.map(v => (v + by) * sign);
}
function ticks([from, to], count) {
  const low = Math.min(from, to),
    high = Math.max(from, to),
    raw = (high - low) / Math.max(2, count);
  if (!(raw > 0)) return [];
  const p = 10 ** Math.floor(Math.log10(raw)),
    by = p * [1, 2, 5, 10].find(m => m * p >= raw * 0.999);
  const told = [];
  for (let i = Math.ceil(low / by - 1e-9); i * by <= high + 1e-9 * by; i++)
    told.push(+(i * by).toPrecision(12));
  return told;
}
function line(g, x0, y0, x1, y1) {
  g.beginPath();
  g.moveTo(x0, y0);
  g.lineTo(x1, y1);
  g.stroke();
}
function arrow(g, x0, y0, x1, y1, head = 4) {
  const length = Math.hypot(x1 - x0, y1 - y0),
    a = Math.atan2(y1 - y0, x1 - x0),
    h = Math.min(head, 0.4 * length);
  g.moveTo(x0, y0);
  g.lineTo(x1, y1);
  if (h > 1) {
    g.lineTo(x1 - h * Math.cos(a - 0.5), y1 - h * Math.sin(a - 0.5));
    g.moveTo(x1, y1);
    g.lineTo(x1 - h * Math.cos(a + 0.5), y1 - h * Math.sin(a + 0.5));
  }
}
/* colours explained, above the axes on the right; and an arrow of a round length on the left */
function scale(plot, colour, low, high, words) {
  const g = plot.ctx,
    { x, y, w } = plot.box,
    wide = Math.min(130, w / 3),
    from = x + w - wide;
  for (let i = 0; i < wide; i++) {
    g.fillStyle = colour(i / (wide - 1));
    g.fillRect(from + i, y - 32, 1.5, 9);
  }
  g.fillStyle = css("--soft");
  g.textAlign = "right";
  g.textBaseline = "middle";
  g.fillText(short(low), from - 5, y - 27);
  g.textBaseline = "bottom";
  g.fillText(`${short(high)} ${words}`, x + w, y - 6);
}
function arrowKey(plot, magnified, unit, words = "") {
  const g = plot.ctx,
    { x, y, w } = plot.box,
    per = plot.box.w / Math.abs(plot.shown.x[1] - plot.shown.x[0]);
  const length = below((0.14 * w) / (magnified * per)),
    long = length * magnified * per;
  g.strokeStyle = g.fillStyle = css("--ink");
  g.beginPath();
  arrow(g, x, y - 26, x + long, y - 26, 5);
  g.stroke();
  g.textAlign = "left";
  g.textBaseline = "bottom";
  g.fillText(`${short(length)} ${unit}, × ${short(magnified)}${words}`, x, y - 6);
}
