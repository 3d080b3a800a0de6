/* The page's numbers, from the JSON in #data, and how numbers and colours are written.  Places come in tenths of a
   pixel and residuals in thousandths (units). */
const data = JSON.parse(document.getElementById("data").textContent);
const { units, views, panels } = data,
  frame = data.frame || { width: 1, height: 1 };
document.documentElement.classList.add("drawn");

const css = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const px = v =>
  v == null
    ? "–"
    : v === 0
      ? "0 px"
      : Math.abs(v) >= 1000
        ? `${v.toFixed(0)} px`
        : Math.abs(v) >= 0.01 && Math.abs(v) < 1
          ? `${v.toFixed(3)} px`
          : `${+v.toPrecision(3)} px`;
const short = v => `${+v.toPrecision(3)}`.replace("-", "−");
const clamp = (v, low, high) => Math.min(high, Math.max(low, v));
const below = v => {
  const p = 10 ** Math.floor(Math.log10(v));
  return p * [5, 2, 1].find(m => m * p <= v * (1 + 1e-12));
};
const CIVIDIS = [
  "#00224e",
  "#123570",
  "#3b496c",
  "#575d6d",
  "#707173",
  "#8a8678",
  "#a59c74",
  "#c3b369",
  "#e1cc55",
  "#fee838",
].map(rgb);
const SIGNED = [
  "#7f3b08",
  "#b35806",
  "#e08214",
  "#fdb863",
  "#f7f7f7",
  "#b2abd2",
  "#8073ac",
  "#542788",
  "#2d004b",
].map(rgb);
function rgb(hex) {
  return [1, 3, 5].map(i => parseInt(hex.slice(i, i + 2), 16));
}
function mixed(stops, t) {
  const at = clamp(t, 0, 1) * (stops.length - 1),
    i = Math.min(stops.length - 2, Math.floor(at)),
    f = at - i;
  return stops[i].map((v, c) => Math.round(v + f * (stops[i + 1][c] - v)));
}
const paint = (stops, t) => `rgb(${mixed(stops, t).join(" ")})`;
const heat = t => paint(CIVIDIS, 1 - t); /* small is bright, large is dark */
