/* All of it, and again when the theme or the paper changes. */
const dark = matchMedia("(prefers-color-scheme: dark)");
const themed = printing => {
  const root = document.documentElement;
  root.dataset.dark = dark.matches && !printing ? "yes" : "";
  root.toggleAttribute("data-print", printing);
  redraw();
};
dark.addEventListener("change", () => themed(false));
addEventListener("beforeprint", () => {
  themed(true);
  state.plots.forEach(plot => plot.draw());
});
addEventListener("afterprint", () => themed(false));
const FIGURES = {
  trust,
  comparison,
  "by-view": byView,
  "without-each": withoutEach,
  vectors,
  "by-place": byPlace,
  poses,
  curve,
  choice,
  "lens-misfit": lensMisfit,
  "target-shape": () => target("target-shape"),
  "target-misfit": () => target("target-misfit"),
  displacement: () => field("displacement", "px"),
  difference: () => field("difference", "px"),
};
for (const [name, draw] of Object.entries(FIGURES)) if (panels[name] && document.getElementById(name)) draw();
themed(false);
