/* What is picked and what is left out. */
const state = { picked: null, off: new Set(), plots: [] };
const redraw = () => state.plots.forEach(plot => plot.later());
function pick(i, { scroll = false } = {}) {
  state.picked = i;
  document.querySelectorAll(".shot").forEach(shot => {
    const mine = Number(shot.dataset.view) === i;
    shot.classList.toggle("picked", mine);
    if (mine) shot.setAttribute("aria-current", "true");
    else shot.removeAttribute("aria-current");
    if (mine && scroll) shot.scrollIntoView({ block: "nearest" });
  });
  redraw();
}
function step(by) {
  const n = views.length;
  if (n) pick(state.picked == null ? (by > 0 ? 0 : n - 1) : (state.picked + by + n) % n, { scroll: false });
  say(state.picked == null ? "" : tellView(state.picked));
}
const used = () => views.map((_, i) => i).filter(i => !state.off.has(i));
const tellView = i =>
  `${i + 1} ${views[i].name}: ${px(views[i].rms)} rms${views[i].heldOut == null ? "" : `, held out ${px(views[i].heldOut)}`}${views[i].suspect ? "; " + views[i].suspect : ""}`;

/* ---- the tip beside the pointer, also read aloud ---- */
const tip = document.body.appendChild(
  Object.assign(document.createElement("div"), { id: "tip", hidden: true }),
);
const voice = document.body.appendChild(Object.assign(document.createElement("div"), { className: "voice" }));
voice.setAttribute("role", "status");
const say = text => {
  voice.textContent = text;
};
function show(text, x, y) {
  tip.hidden = !text;
  if (!text) return;
  tip.textContent = text;
  const box = tip.getBoundingClientRect();
  tip.style.left = `${clamp(x + 14, 4, Math.max(4, innerWidth - box.width - 4))}px`;
  tip.style.top = `${y + 18 + box.height > innerHeight ? y - box.height - 10 : y + 18}px`;
}
