/* Photographs: opened large, left out by a switch. */
const shots = [...document.querySelectorAll(".shot")];
const dialog = document.body.appendChild(document.createElement("dialog"));
dialog.id = "shot";
dialog.innerHTML =
  '<div class="bar"><h2></h2><div class="controls"></div></div><div class="stage"><canvas role="img" tabindex="0" aria-label="Photograph"></canvas></div><p class="note"></p>';
let opened = null,
  opener = null,
  magnify = 1;
const pictureOf = i =>
  (data.large === views[i].name && document.getElementById("before")) ||
  (shots[i] && shots[i].querySelector("img"));
function openShot(i) {
  if (opened == null) opener = document.activeElement;
  opened = i;
  pick(i);
  if (!dialog.open) dialog.showModal();
  dialog.querySelector("h2").textContent = `${i + 1} ${views[i].name}`;
  dialog
    .querySelector("canvas")
    .setAttribute("aria-label", `Photograph with detected and predicted corners: ${tellView(i)}`);
  dialog.querySelector("p").textContent = `${tellView(i)}. Circles: detected; crosses: predicted.`;
  lightbox.reset();
  lightbox.canvas.focus();
}
const lightbox = new Plot("shot", {
  ...overFrame,
  margin: { l: 8, r: 8, t: 30, b: 8 },
  labels: null,
  paint: p => {
    if (opened == null) return;
    const g = p.ctx,
      image = pictureOf(opened),
      x = p.X(-0.5),
      y = p.Y(-0.5),
      w = p.X(frame.width - 0.5) - x,
      h = p.Y(frame.height - 0.5) - y;
    g.fillStyle = css("--desk");
    g.fillRect(x, y, w, h);
    if (image && image.complete && image.naturalWidth) g.drawImage(image, x, y, w, h);
    else if (image) image.addEventListener("load", () => p.later(), { once: true });
    const size = clamp((frame.width / (p.shown.x[1] - p.shown.x[0])) * 3, 3, 10);
    for (const [dark, detected, predicted, wide] of [
      [true, "#000", "#000", 3.5],
      [false, "#56b4e9", "#e69f00", 1.6],
    ]) {
      g.lineWidth = wide;
      g.strokeStyle = detected;
      g.beginPath();
      corners(opened, (u, v) => {
        g.moveTo(p.X(u) + size, p.Y(v));
        g.arc(p.X(u), p.Y(v), size, 0, 7);
      });
      g.stroke();
      g.strokeStyle = predicted;
      g.beginPath();
      corners(opened, (u, v, ex, ey) => {
        const a = p.X(u + magnify * ex),
          b = p.Y(v + magnify * ey),
          s = 0.75 * size;
        g.moveTo(p.X(u), p.Y(v));
        g.lineTo(a, b);
        g.moveTo(a - s, b - s);
        g.lineTo(a + s, b + s);
        g.moveTo(a - s, b + s);
        g.lineTo(a + s, b - s);
      });
      g.stroke();
    }
    g.lineWidth = 1;
  },
  after: p => {
    p.ctx.fillStyle = css("--soft");
    p.ctx.textAlign = "left";
    p.ctx.textBaseline = "bottom";
    p.ctx.fillText(`residuals × ${magnify}`, p.box.x, p.box.y - 6);
  },
  find: (p, x, y) => {
    let best = 16,
      found = null;
    if (opened != null)
      corners(opened, (u, v, ex, ey, k) => {
        const far = Math.hypot(p.X(u) - x, p.Y(v) - y);
        if (far < best) {
          best = far;
          found = {
            text: `corner ${idOf(views[opened], k)} at ${u.toFixed(1)}, ${v.toFixed(1)}: ${px(Math.hypot(ex, ey))} (${short(ex)}, ${short(ey)})`,
          };
        }
      });
    return found;
  },
});
lightbox.key = key =>
  ({
    ArrowRight: () => openShot((opened + 1) % views.length),
    ArrowLeft: () => openShot((opened + views.length - 1) % views.length),
  })[key] || (key === "Escape" ? null : Plot.prototype.key.call(lightbox, key));
lightbox.choice(
  "residuals magnified",
  [1, 10, 50, 100, 500].map(m => [`${m}`, `residuals × ${m}`]),
  "1",
  value => {
    magnify = Number(value);
  },
);
for (const [words, act] of [
  ["previous", () => openShot((opened + views.length - 1) % views.length)],
  ["next", () => openShot((opened + 1) % views.length)],
  ["close", () => dialog.close()],
]) {
  const button = Object.assign(document.createElement("button"), { type: "button", textContent: words });
  button.addEventListener("click", act);
  dialog.querySelector(".controls").append(button);
}
dialog.addEventListener("close", () => {
  opened = null;
  show("");
  if (opener) opener.focus();
});
document.body.append(tip);
dialog.addEventListener("pointermove", () => {
  if (tip.parentElement !== dialog) dialog.append(tip);
});
dialog.addEventListener("close", () => document.body.append(tip));

const left = document.body.appendChild(
  Object.assign(document.createElement("div"), { id: "left-out", hidden: true }),
);
left.setAttribute("role", "region");
left.setAttribute("aria-label", "Photographs left out");
left.innerHTML = '<p></p><code></code><button type="button" class="copy">Copy</button>';
const quoted = name => (/^[\w./+-]+$/.test(name) ? name : `'${name.replace(/'/g, "'\\''")}'`);
function leaveOut() {
  const out = [...state.off].sort((a, b) => a - b);
  left.hidden = !out.length;
  left.querySelector("p").textContent =
    `The figures are without ${out.length} photograph${out.length > 1 ? "s" : ""}: ${px(rmsOf(used()))} rms. To calibrate without ${out.length > 1 ? "them" : "it"}:`;
  left.querySelector("code").textContent =
    `orthoscope calibrate detections.json ${[...data.leftOut, ...out.map(i => views[i].name)].map(name => `--without ${quoted(name)}`).join(" ")}`;
  redraw();
}
shots.forEach(shot => {
  const i = Number(shot.dataset.view);
  shot.querySelector(".open").addEventListener("click", () => openShot(i));
  shot.querySelector(".leave-out").addEventListener("change", e => {
    state.off[e.target.checked ? "add" : "delete"](i);
    shot.classList.toggle("off", e.target.checked);
    leaveOut();
  });
  shot.addEventListener("pointerenter", () => {
    if (opened == null) pick(i);
  });
  shot.addEventListener("pointerleave", () => {
    if (opened == null) pick(null);
  });
});
const sort = document.getElementById("sort");
if (sort)
  sort.addEventListener("change", () => {
    const worst = i => -(views[i].heldOut ?? views[i].rms ?? 0);
    const order = shots.map((_, i) => i);
    if (sort.value === "error") order.sort((a, b) => worst(a) - worst(b));
    order.forEach(i => shots[i].parentElement.append(shots[i]));
  });
