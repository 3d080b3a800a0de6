/* A canvas that knows its size, the theme and what lies under the pointer. */
class Plot {
  constructor(name, spec) {
    this.root = document.getElementById(name);
    if (!this.root) return;
    Object.assign(this, { name, margin: { l: 52, r: 14, t: 12, b: 42 }, zoomed: null, waiting: false }, spec);
    this.canvas = this.root.querySelector("canvas");
    this.ctx = this.canvas.getContext("2d");
    this.controls = this.root.querySelector(".controls");
    if (this.zooms !== false) this.buttons();
    this.listen();
    new ResizeObserver(() => this.later()).observe(this.canvas.parentElement);
    state.plots.push(this);
    this.later();
  }
  buttons() {
    for (const [sign, words, act] of [
      ["+", "zoom in", () => this.zoom(1.6)],
      ["−", "zoom out", () => this.zoom(1 / 1.6)],
      ["⟲", "show all", () => this.reset()],
    ]) {
      const button = Object.assign(document.createElement("button"), {
        type: "button",
        textContent: sign,
        title: words,
      });
      button.setAttribute("aria-label", `${words}: ${this.root.querySelector("h2").textContent}`);
      button.addEventListener("click", act);
      this.controls.append(button);
    }
  }
  choice(words, options, chosen, act) {
    const label = Object.assign(document.createElement("label"), { className: "pickone" });
    const select = document.createElement("select");
    for (const [value, text] of options)
      select.append(new Option(text, value, value === chosen, value === chosen));
    select.setAttribute("aria-label", words);
    select.addEventListener("change", () => {
      act(select.value);
      this.later();
    });
    label.append(select);
    this.controls.prepend(label);
  }
  listen() {
    const c = this.canvas,
      down = new Map();
    let moved = false,
      gap = 0;
    c.addEventListener("pointerdown", e => {
      down.set(e.pointerId, [e.offsetX, e.offsetY]);
      moved = false;
      gap = 0;
      c.setPointerCapture(e.pointerId);
    });
    c.addEventListener("pointermove", e => {
      const from = down.get(e.pointerId);
      if (!from) return this.hover(e);
      const to = [e.offsetX, e.offsetY];
      if (Math.hypot(to[0] - from[0], to[1] - from[1]) < 3 && !moved) return;
      moved = true;
      if (down.size === 2) {
        const [a, b] = [...down.entries()].map(([id, p]) => (id === e.pointerId ? to : p));
        const apart = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (gap) this.zoom(apart / gap, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
        gap = apart;
      } else this.drag(to[0] - from[0], to[1] - from[1]);
      down.set(e.pointerId, to);
      show("");
    });
    const up = e => {
      down.delete(e.pointerId);
      gap = 0;
    };
    c.addEventListener("pointerup", e => {
      up(e);
      if (!moved) this.click(e);
    });
    c.addEventListener("pointercancel", up);
    c.addEventListener("pointerleave", () => show(""));
    c.addEventListener("dblclick", e => this.zoom(1.6, e.offsetX, e.offsetY));
    c.addEventListener(
      "wheel",
      e => {
        if (!e.ctrlKey && !e.metaKey) return; /* the wheel alone scrolls the page */
        e.preventDefault();
        this.zoom(Math.exp(-e.deltaY / 300), e.offsetX, e.offsetY);
      },
      { passive: false },
    );
    c.addEventListener("keydown", e => {
      const act = this.key(e.key);
      if (act) {
        e.preventDefault();
        act();
      }
    });
  }
  key(key) {
    return {
      "+": () => this.zoom(1.6),
      "=": () => this.zoom(1.6),
      "-": () => this.zoom(1 / 1.6),
      0: () => this.reset(),
      Escape: () => pick(null),
      ArrowRight: () => step(1),
      ArrowLeft: () => step(-1),
      ArrowDown: () => step(1),
      ArrowUp: () => step(-1),
      Enter: () => state.picked != null && openShot(state.picked),
    }[key];
  }
  under(e) {
    return this.find && this.box ? this.find(this, e.offsetX, e.offsetY) : null;
  }
  hover(e) {
    const found = this.under(e);
    show(found ? found.text : "", e.clientX, e.clientY);
    this.canvas.style.cursor = found && found.view != null ? "pointer" : this.zoomed ? "grab" : "default";
  }
  click(e) {
    const found = this.under(e);
    if (found && found.view != null) {
      pick(found.view === state.picked ? null : found.view, { scroll: false });
      say(tellView(found.view));
    }
    this.hover(e);
  }
  later() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }
  /* the ranges that are shown now, and the way from them to the canvas */
  fit() {
    const width = this.canvas.parentElement.clientWidth,
      m = this.margin;
    const inner = width - m.l - m.r;
    const range = this.range();
    const high = this.equal
      ? clamp(inner * Math.abs((range.y[1] - range.y[0]) / (range.x[1] - range.x[0])), 140, this.tallest())
      : this.height(inner);
    const height = Math.round(high + m.t + m.b),
      dpr = Math.min(3, devicePixelRatio || 1);
    if (this.canvas.width !== Math.round(width * dpr) || this.canvas.height !== Math.round(height * dpr)) {
      this.canvas.width = Math.round(width * dpr);
      this.canvas.height = Math.round(height * dpr);
    }
    this.ctx.setTransform(dpr, 0, 0, dpr, 0, 0);
    this.width = width;
    this.tall = height;
    let box = { x: m.l, y: m.t, w: inner, h: high };
    if (this.equal) {
      const scale = Math.min(
        inner / Math.abs(range.x[1] - range.x[0]),
        high / Math.abs(range.y[1] - range.y[0]),
      );
      box.w = scale * Math.abs(range.x[1] - range.x[0]);
      box.h = scale * Math.abs(range.y[1] - range.y[0]);
      box.x = m.l + (inner - box.w) / 2;
    }
    this.box = box;
    const { x, y } = this.zoomed || range;
    this.X = v => box.x + ((v - x[0]) / (x[1] - x[0])) * box.w;
    this.Y = v => box.y + ((v - y[0]) / (y[1] - y[0])) * box.h;
    this.atX = p => x[0] + ((p - box.x) / box.w) * (x[1] - x[0]);
    this.atY = p => y[0] + ((p - box.y) / box.h) * (y[1] - y[0]);
    this.shown = { x, y };
  }
  /* how tall a figure to scale may be */
  tallest() {
    return 560;
  }
  height(inner) {
    return clamp(0.55 * inner, 180, 300);
  }
  zoom(by, px0 = this.box.x + this.box.w / 2, py0 = this.box.y + this.box.h / 2) {
    const whole = this.range(),
      now = this.shown;
    const narrowed = (span, all, at) => {
      const low = at - (at - span[0]) / by,
        high = at + (span[1] - at) / by;
      return Math.abs(high - low) >= Math.abs(all[1] - all[0]) ? all : kept([low, high], all);
    };
    const x = narrowed(now.x, whole.x, this.atX(px0)),
      y = this.zoomsX ? whole.y : narrowed(now.y, whole.y, this.atY(py0));
    if (Math.abs(x[1] - x[0]) < 1e-3 * Math.abs(whole.x[1] - whole.x[0])) return;
    this.zoomed = x === whole.x && y === whole.y ? null : { x, y };
    this.canvas.style.touchAction = this.zoomed ? "none" : "pan-y";
    this.later();
  }
  drag(dx, dy) {
    if (!this.zoomed) return;
    const whole = this.range(),
      moved = (span, by, all) =>
        kept(
          span.map(v => v - by),
          all,
        );
    const { x, y } = this.zoomed;
    this.zoomed = {
      x: moved(x, (dx / this.box.w) * (x[1] - x[0]), whole.x),
      y: this.zoomsX ? y : moved(y, (dy / this.box.h) * (y[1] - y[0]), whole.y),
    };
    this.later();
  }
  reset() {
    this.zoomed = null;
    this.canvas.style.touchAction = "pan-y";
    this.later();
  }
  draw() {
    if (!this.canvas.parentElement.clientWidth) return;
    this.fit();
    const g = this.ctx;
    g.clearRect(0, 0, this.width, this.tall);
    g.font = `12px ${css("--sans")}`;
    g.lineWidth = 1;
    if (this.back) this.back(this);
    this.axes();
    g.save();
    g.beginPath();
    g.rect(this.box.x, this.box.y, this.box.w, this.box.h);
    g.clip();
    this.paint(this);
    g.restore();
    if (this.after) this.after(this);
    this.canvas.dataset.drawn = Math.round(performance.now());
  }
  axes() {
    if (!this.labels) return;
    const g = this.ctx,
      { x, y, w, h } = this.box;
    g.strokeStyle = css("--line");
    g.fillStyle = css("--soft");
    g.textBaseline = "top";
    g.textAlign = "center";
    for (const v of this.ticksX ? this.ticksX(this) : ticks(this.shown.x, w / 80)) {
      const at = this.X(v.at ?? v);
      line(g, at, y + h, at, y + h + 4);
      if (this.gridX) line(g, at, y, at, y + h);
      g.fillText(v.text ?? short(v), at, y + h + 6);
    }
    g.textAlign = "right";
    g.textBaseline = "middle";
    for (const v of ticks(this.shown.y, h / 45)) {
      const at = this.Y(v);
      line(g, x - 4, at, this.gridY ? x + w : x, at);
      g.fillText(short(v), x - 7, at);
    }
    if (!this.gridY) g.strokeRect(x, y, w, h);
    g.textAlign = "center";
    g.textBaseline = "bottom";
    g.fillText(this.labels[0], x + w / 2, this.tall - 4);
    g.save();
    g.translate(12, y + h / 2);
    g.rotate(-Math.PI / 2);
    g.textBaseline = "middle";
    g.fillText(this.labels[1], 0, 0);
    g.restore();
  }
}
