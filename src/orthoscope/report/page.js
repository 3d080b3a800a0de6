"use strict";
/* The page's one script: draws the figures from the JSON in #data, and joins them, so that a photograph picked in
   one is picked in all.  A Plot is a canvas with axes, zoom, hover and keyboard; a figure says only what to paint
   and what lies under the pointer.  Places come in tenths of a pixel and residuals in thousandths (units). */
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { units, views, panels } = data,
    frame = data.frame || { width: 1, height: 1 };
  document.documentElement.classList.add("drawn");

  /* ---- numbers and colours ---- */
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

  /* ---- what is picked and what is left out ---- */
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
  const voice = document.body.appendChild(
    Object.assign(document.createElement("div"), { className: "voice" }),
  );
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

  /* ---- a canvas that knows its size, the theme and what lies under the pointer ---- */
  class Plot {
    constructor(name, spec) {
      this.root = document.getElementById(name);
      if (!this.root) return;
      Object.assign(
        this,
        { name, margin: { l: 52, r: 14, t: 12, b: 42 }, zoomed: null, waiting: false },
        spec,
      );
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
        ? clamp(inner * Math.abs((range.y[1] - range.y[0]) / (range.x[1] - range.x[0])), 140, 560)
        : this.height(inner);
      const height = Math.round(high + m.t + m.b),
        dpr = Math.min(3, devicePixelRatio || 1);
      if (this.canvas.width !== Math.round(width * dpr) || this.canvas.height !== Math.round(height * dpr)) {
        this.canvas.width = Math.round(width * dpr);
        this.canvas.height = Math.round(height * dpr);
        this.canvas.style.height = `${height}px`;
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
      this.canvas.dataset.drawn = "yes";
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

  /* ---- figures over the frame ---- */
  const wholeFrame = () => ({ x: [-0.5, frame.width - 0.5], y: [-0.5, frame.height - 0.5] });
  const overFrame = {
    equal: true,
    range: wholeFrame,
    labels: ["x (px)", "y (px)"],
    margin: { l: 52, r: 14, t: 44, b: 42 },
  };
  const corners = (i, each) => {
    const v = views[i];
    for (let k = 0; k < v.x.length; k++)
      if (v.ex[k] != null)
        each(
          v.x[k] / units.place,
          v.y[k] / units.place,
          v.ex[k] / units.residual,
          v.ey[k] / units.residual,
          k,
        );
  };
  const idOf = (v, k) => (v.ids ? v.ids[k] : k);
  const quantile = (values, q) => {
    const s = Float64Array.from(values).sort();
    return s.length ? s[Math.min(s.length - 1, Math.floor(q * s.length))] : 0;
  };

  function byView() {
    const top = Math.max(...views.map(v => Math.max(v.rms || 0, v.heldOut || 0)), 1e-9) * 1.06;
    const named = i => (views[i].name.length > 14 ? "…" + views[i].name.slice(-13) : views[i].name);
    new Plot("by-view", {
      range: () => ({ x: [-0.6, Math.max(views.length, 4) - 0.4], y: [top, 0] }),
      labels: ["photograph", "rms (px per point)"],
      gridY: true,
      zoomsX: true,
      margin: { l: 56, r: 14, t: 30, b: 42 },
      height: () => 210,
      ticksX: p => {
        const [from, to] = p.shown.x,
          room = p.box.w / (to - from),
          names = room > 92,
          told = [];
        const by = names ? 1 : Math.max(1, Math.ceil(34 / room));
        for (let i = Math.max(0, Math.ceil(from)); i <= to && i < views.length; i++)
          if (i % by === 0) told.push({ at: i, text: names ? named(i) : `${i + 1}` });
        return told;
      },
      paint: p => {
        const g = p.ctx,
          wide = Math.max(1, 0.72 * (p.X(1) - p.X(0)));
        views.forEach((v, i) => {
          g.globalAlpha = state.off.has(i) ? 0.25 : state.picked == null || state.picked === i ? 1 : 0.45;
          g.fillStyle = css(v.suspect ? "--red" : "--blue");
          if (v.rms != null) g.fillRect(p.X(i) - wide / 2, p.Y(v.rms), wide, p.Y(0) - p.Y(v.rms));
          if (v.heldOut != null) {
            g.fillStyle = css("--amber");
            g.strokeStyle = css("--paper");
            g.beginPath();
            g.arc(p.X(i), p.Y(v.heldOut), clamp(wide / 3, 2, 4.5), 0, 7);
            g.fill();
            g.stroke();
          }
        });
        g.globalAlpha = 1;
        const all = rmsOf(used());
        if (all) {
          g.strokeStyle = css("--ink");
          g.setLineDash([4, 4]);
          line(g, p.box.x, p.Y(all), p.box.x + p.box.w, p.Y(all));
          g.setLineDash([]);
        }
      },
      after: p => {
        const g = p.ctx,
          all = rmsOf(used());
        g.textBaseline = "bottom";
        g.textAlign = "left";
        let x = p.box.x;
        const put = (mark, words) => {
          g.fillStyle = css(mark);
          if (mark === "--amber") {
            g.beginPath();
            g.arc(x + 5, p.box.y - 13, 4, 0, 7);
            g.fill();
          } else g.fillRect(x, p.box.y - 18, 10, 10);
          g.fillStyle = css("--soft");
          g.fillText(words, x + 14, p.box.y - 6);
          x += 26 + g.measureText(words).width;
        };
        put("--blue", "in the calibration");
        if (views.some(v => v.heldOut != null)) put("--amber", "held out");
        if (views.some(v => v.suspect)) put("--red", "suspect");
        g.textAlign = "right";
        if (p.box.w > 420)
          g.fillText(
            `all ${px(all)}${state.off.size ? `, without ${state.off.size}` : ""}`,
            p.box.x + p.box.w,
            p.box.y - 6,
          );
      },
      find: (p, x, y) => {
        const i = Math.round(p.atX(x));
        return i >= 0 &&
          i < views.length &&
          Math.abs(p.atX(x) - i) < 0.5 &&
          y > p.box.y &&
          y < p.box.y + p.box.h + 20
          ? { view: i, text: tellView(i) }
          : null;
      },
    });
  }
  function rmsOf(indices) {
    let sum = 0,
      n = 0;
    for (const i of indices)
      corners(i, (x, y, ex, ey) => {
        sum += ex * ex + ey * ey;
        n++;
      });
    return n ? Math.sqrt(sum / n) : null;
  }

  function vectors() {
    const sizes = [];
    for (let i = 0; i < views.length; i++) corners(i, (x, y, ex, ey) => sizes.push(Math.hypot(ex, ey)));
    const top = Math.max(quantile(sizes, 0.98), 1e-9),
      typical = Math.max(quantile(sizes, 0.9), 1e-9);
    const diagonal = Math.hypot(frame.width, frame.height);
    let magnified = below(((sizes.length > 1500 ? 0.02 : 0.03) * diagonal) / typical);
    new Plot("vectors", {
      ...overFrame,
      paint: p => {
        const g = p.ctx,
          shades = 12;
        g.lineWidth = sizes.length > 4000 ? 0.8 : 1.2;
        const drawn = (indices, alpha) => {
          const bins = Array.from({ length: shades }, () => []);
          for (const i of indices)
            corners(i, (x, y, ex, ey) =>
              bins[Math.min(shades - 1, Math.floor((Math.hypot(ex, ey) / top) * shades))].push(x, y, ex, ey),
            );
          g.globalAlpha = alpha;
          bins.forEach((bin, s) => {
            g.strokeStyle = heat(((s + 0.5) / shades) * 0.92 + 0.08);
            if (document.documentElement.dataset.dark)
              g.strokeStyle = paint(CIVIDIS, 0.25 + (0.75 * (s + 0.5)) / shades);
            g.beginPath();
            for (let k = 0; k < bin.length; k += 4)
              arrow(
                g,
                p.X(bin[k]),
                p.Y(bin[k + 1]),
                p.X(bin[k] + magnified * bin[k + 2]),
                p.Y(bin[k + 1] + magnified * bin[k + 3]),
              );
            g.stroke();
          });
          g.globalAlpha = 1;
        };
        const some = used();
        drawn(
          some.filter(i => i !== state.picked),
          state.picked == null ? 1 : 0.15,
        );
        if (state.picked != null) drawn([state.picked], 1);
      },
      after: p => {
        arrowKey(p, magnified, "px");
        scale(
          p,
          t =>
            document.documentElement.dataset.dark ? paint(CIVIDIS, 0.25 + 0.75 * t) : heat(0.08 + 0.92 * t),
          0,
          top,
          "px",
        );
      },
      find: (p, x, y) => {
        let best = 14,
          found = null;
        for (const i of used()) {
          if (state.picked != null && i !== state.picked) continue;
          corners(i, (cx, cy, ex, ey, k) => {
            const d = Math.hypot(p.X(cx) - x, p.Y(cy) - y);
            if (d < best) {
              best = d;
              found = {
                view: i,
                text: `${i + 1} ${views[i].name}, corner ${idOf(views[i], k)}: ${px(Math.hypot(ex, ey))} (${short(ex)}, ${short(ey)})`,
              };
            }
          });
        }
        return found;
      },
    });
  }

  function byPlace() {
    const total = views.reduce((n, v) => n + v.x.length, 0),
      columns = Math.max(1, Math.round(Math.sqrt((clamp(total / 8, 24, 300) * frame.width) / frame.height)));
    const rows = Math.max(1, Math.round((columns * frame.height) / frame.width)),
      held = views.some(v => v.hx);
    let key = null,
      cells = null;
    function counted() {
      const now = [...state.off].sort().join();
      if (now === key) return cells;
      key = now;
      const sums = Array.from({ length: columns * rows }, () => [0, 0, 0, 0]);
      for (const i of used()) {
        const v = views[i],
          ex = v.hx || (held ? null : v.ex),
          ey = v.hy || (held ? null : v.ey);
        if (!ex) continue;
        for (let k = 0; k < v.x.length; k++) {
          if (ex[k] == null) continue;
          const c = clamp(Math.floor(((v.x[k] / units.place + 0.5) / frame.width) * columns), 0, columns - 1),
            r = clamp(Math.floor(((v.y[k] / units.place + 0.5) / frame.height) * rows), 0, rows - 1);
          const s = sums[r * columns + c],
            a = ex[k] / units.residual,
            b = ey[k] / units.residual;
          s[0]++;
          s[1] += a;
          s[2] += b;
          s[3] += a * a + b * b;
        }
      }
      cells = sums.map(([n, a, b, s]) => (n >= 4 ? { n, x: a / n, y: b / n, rms: Math.sqrt(s / n) } : null));
      return cells;
    }
    cellsFigure(
      "by-place",
      columns,
      rows,
      counted,
      held ? "px rms held out" : "px rms",
      c => `${px(c.rms)} rms of ${c.n} corners; mean ${short(c.x)}, ${short(c.y)} px`,
    );
  }

  /* cells with a size as colour and a vector as arrow; null where there is none */
  function cellsFigure(name, columns, rows, get, words, tell, least = 0) {
    const wide = frame.width / columns,
      high = frame.height / rows;
    const top = () => Math.max(...get().map(c => (c ? c.rms : 0)), least, 1e-9);
    new Plot(name, {
      ...overFrame,
      paint: p => {
        const g = p.ctx,
          cells = get(),
          most = top();
        const sizes = cells.filter(Boolean).map(c => Math.hypot(c.x, c.y));
        p.magnified = sizes.length
          ? below((0.9 * Math.min(wide, high)) / Math.max(quantile(sizes, 0.9), 1e-9))
          : 1;
        cells.forEach((c, i) => {
          if (!c) return;
          const x = p.X((i % columns) * wide - 0.5),
            y = p.Y(Math.floor(i / columns) * high - 0.5);
          g.fillStyle = heat(c.rms / most);
          g.fillRect(
            x,
            y,
            p.X(((i % columns) + 1) * wide - 0.5) - x + 0.5,
            p.Y((Math.floor(i / columns) + 1) * high - 0.5) - y + 0.5,
          );
        });
        for (const [colour, width] of [
          ["#000", 3],
          ["#fff", 1.3],
        ]) {
          g.strokeStyle = colour;
          g.lineWidth = width;
          g.beginPath();
          cells.forEach((c, i) => {
            if (c) {
              const x = ((i % columns) + 0.5) * wide - 0.5,
                y = (Math.floor(i / columns) + 0.5) * high - 0.5;
              arrow(g, p.X(x), p.Y(y), p.X(x + p.magnified * c.x), p.Y(y + p.magnified * c.y));
            }
          });
          g.stroke();
        }
      },
      after: p => {
        arrowKey(p, p.magnified, "px");
        scale(p, heat, 0, top(), words);
      },
      find: (p, x, y) => {
        const c = Math.floor((p.atX(x) + 0.5) / wide),
          r = Math.floor((p.atY(y) + 0.5) / high),
          cell = c >= 0 && r >= 0 && c < columns && r < rows ? get()[r * columns + c] : null;
        return cell ? { text: tell(cell) } : null;
      },
    });
  }
  function lensMisfit() {
    const d = panels["lens-misfit"];
    const cells = d.x.map((x, i) =>
      x == null
        ? null
        : { x: x / units.residual, y: d.y[i] / units.residual, rms: Math.hypot(x, d.y[i]) / units.residual },
    );
    cellsFigure(
      "lens-misfit",
      d.columns,
      d.rows,
      () => cells,
      "px systematic",
      c => `${px(c.rms)} the same in every photograph (${short(c.x)}, ${short(c.y)})`,
      d.noise,
    );
  }

  /* smooth fields: a small picture of colours stretched over the frame, contours and arrows on top */
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

  /* ---- where it may be trusted ---- */
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
        g.fillText(`within the line: ${px(d.limit)} or less`, p.box.x, p.box.y - 6);
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

  /* ---- the lens from its axis outwards ---- */
  function curve() {
    const d = panels.curve,
      last = d.angles[d.angles.length - 1],
      colours = { seen: "--amber", edge: "--ink", end: "--red" };
    let shown = "radius";
    const span = band => [Math.min(0, ...band.low), Math.max(0, ...band.high)];
    const plot = new Plot("curve", {
      gridY: true,
      labels: ["angle from the axis (°)", ""],
      margin: { l: 60, r: 14, t: 78, b: 42 },
      height: inner => clamp(0.6 * inner, 200, 320),
      range: () => {
        const [low, high] = span(d[shown]),
          pad = 0.06 * (high - low || 1);
        return { x: [0, last], y: [high + pad, shown === "radius" ? 0 : low - pad] };
      },
      paint: p => {
        const g = p.ctx,
          band = d[shown];
        p.labels[1] = shown === "radius" ? "distance (px)" : "displacement (px)";
        const seen = d.marks.find(m => m.kind === "seen");
        if (seen) {
          g.fillStyle = css("--amber");
          g.globalAlpha = 0.12;
          g.fillRect(p.X(seen.angle), p.box.y, p.box.x + p.box.w - p.X(seen.angle), p.box.h);
        }
        g.fillStyle = css("--blue");
        g.globalAlpha = 0.25;
        g.beginPath();
        d.angles.forEach((a, i) => g[i ? "lineTo" : "moveTo"](p.X(a), p.Y(band.low[i])));
        [...d.angles].reverse().forEach((a, i) => g.lineTo(p.X(a), p.Y(band.high[d.angles.length - 1 - i])));
        g.fill();
        g.globalAlpha = 1;
        const drawn = (f, colour, dash, width) => {
          g.strokeStyle = css(colour);
          g.setLineDash(dash);
          g.lineWidth = width;
          g.beginPath();
          let begun = false;
          d.angles.forEach((a, i) => {
            const v = f(a, i);
            if (v == null || !isFinite(v) || (v < 0 && shown === "radius")) return;
            g[begun ? "lineTo" : "moveTo"](p.X(a), p.Y(v));
            begun = true;
          });
          g.stroke();
          g.setLineDash([]);
        };
        if (shown === "radius") {
          drawn(a => (a < 89 ? d.focal * Math.tan((a * Math.PI) / 180) : null), "--soft", [5, 4], 1.2);
          drawn(a => (d.focal * a * Math.PI) / 180, "--soft", [1, 3], 1.4);
        } else drawn(() => 0, "--soft", [5, 4], 1);
        drawn((a, i) => band.mean[i], "--blue", [], 2);
        for (const m of d.marks) {
          g.strokeStyle = css(colours[m.kind]);
          g.lineWidth = 1.5;
          line(g, p.X(m.angle), p.box.y, p.X(m.angle), p.box.y + p.box.h);
        }
      },
      after: p => {
        const g = p.ctx;
        let x = 8,
          y = 14;
        g.textBaseline = "middle";
        g.textAlign = "left";
        const put = (colour, dash, words) => {
          const wide = 34 + g.measureText(words).width;
          if (x + wide > p.width && x > 8) {
            x = 8;
            y += 18;
          }
          g.strokeStyle = css(colour);
          g.setLineDash(dash);
          g.lineWidth = 2;
          line(g, x, y, x + 20, y);
          g.setLineDash([]);
          g.fillStyle = css("--soft");
          g.fillText(words, x + 25, y);
          x += wide + 12;
        };
        put("--blue", [], "this lens");
        if (shown === "radius") {
          put("--soft", [5, 4], "f tan θ");
          put("--soft", [1, 3], "f θ");
        }
        for (const m of d.marks) put(colours[m.kind], [], `${m.words}, ${m.angle.toFixed(1)}°`);
      },
      find: (p, x) => {
        const a = p.atX(x);
        if (a < 0 || a > last) return null;
        const i = Math.round((a / last) * (d.angles.length - 1));
        return {
          text: `${d.angles[i].toFixed(1)}°: ${px(d.radius.mean[i])} from the principal point, moved ${px(d.moved.mean[i])}`,
        };
      },
    });
    plot.choice(
      "what is shown",
      [
        ["radius", "distance"],
        ["moved", "displacement"],
      ],
      "radius",
      value => {
        shown = value;
        plot.zoomed = null;
      },
    );
  }

  /* ---- in three dimensions: turned by dragging or by the arrow keys ---- */
  class Solid extends Plot {
    constructor(name, spec) {
      super(name, {
        yaw: -0.62,
        pitch: 0.38,
        nearer: 1,
        labels: null,
        margin: { l: 4, r: 4, t: 44, b: 8 },
        range: () => ({ x: [-1, 1], y: [-1, 1] }),
        height: inner => clamp(0.72 * inner, 240, 420),
        ...spec,
      });
      if (this.canvas) this.canvas.style.touchAction = "pan-y";
    }
    key(key) {
      const turn = (yaw, pitch) => () => this.drag(yaw, pitch);
      return (
        {
          ArrowLeft: turn(-24, 0),
          ArrowRight: turn(24, 0),
          ArrowUp: turn(0, -24),
          ArrowDown: turn(0, 24),
          PageDown: () => step(1),
          PageUp: () => step(-1),
        }[key] || super.key(key)
      );
    }
    drag(dx, dy) {
      this.yaw += dx / 120;
      this.pitch = clamp(this.pitch + dy / 120, -1.5, 1.5);
      this.later();
    }
    zoom(by) {
      this.nearer = clamp(this.nearer * by, 0.5, 12);
      this.later();
    }
    reset() {
      Object.assign(this, { yaw: -0.62, pitch: 0.38, nearer: 1 });
      this.later();
    }
    /* from space (x right, y down, z away) to the canvas, all of `points` within it at first */
    aim(points) {
      const low = [0, 1, 2].map(c => Math.min(...points.map(q => q[c]))),
        high = [0, 1, 2].map(c => Math.max(...points.map(q => q[c])));
      const middle = low.map((v, c) => (v + high[c]) / 2),
        reach = Math.max(1e-9, Math.hypot(...low.map((v, c) => high[c] - v)) / 2);
      const [cy, sy, cp, sp] = [
        Math.cos(this.yaw),
        Math.sin(this.yaw),
        Math.cos(this.pitch),
        Math.sin(this.pitch),
      ];
      const size = (this.nearer * 1.05 * Math.min(this.box.w, this.box.h)) / 2 / reach;
      return q => {
        const [x, y, z] = q.map((v, c) => v - middle[c]);
        const right = cy * x - sy * z,
          away = sy * x + cy * z;
        return [
          this.box.x + this.box.w / 2 + size * right,
          this.box.y + this.box.h / 2 + size * (cp * y - sp * away),
          cp * away + sp * y,
        ];
      };
    }
  }
  function poses() {
    const d = panels.poses,
      o = d.outline;
    const placed = views.map(v =>
      o.map(q =>
        [0, 1, 2].map(
          r => v.pose[3 * r] * q[0] + v.pose[3 * r + 1] * q[1] + v.pose[3 * r + 2] * q[2] + v.pose[9 + r],
        ),
      ),
    );
    const all = [[0, 0, 0], ...d.frustum, ...placed.flat()];
    new Solid("poses", {
      paint: p => {
        const g = p.ctx,
          to = p.aim(all),
          eye = to([0, 0, 0]),
          front = d.frustum.map(to);
        const boards = placed
          .map((corners4, i) => ({ i, at: corners4.map(to) }))
          .filter(b => !state.off.has(b.i));
        const depth = b => b.at.reduce((s, q) => s + q[2], 0) + (b.i === state.picked ? -1e9 : 0);
        boards.sort((a, b) => depth(b) - depth(a));
        p.boards = boards;
        g.lineWidth = 1.2;
        for (const b of boards) {
          const mine = b.i === state.picked,
            dimmed = state.picked != null && !mine;
          g.fillStyle = g.strokeStyle = css(views[b.i].suspect ? "--red" : mine ? "--amber" : "--blue");
          g.beginPath();
          b.at.forEach(([x, y], k) => g[k ? "lineTo" : "moveTo"](x, y));
          g.closePath();
          g.globalAlpha = mine ? 0.6 : dimmed ? 0.04 : clamp(4 / boards.length, 0.05, 0.28);
          g.fill();
          g.globalAlpha = dimmed ? 0.25 : 0.9;
          g.lineWidth = mine ? 2.5 : 1;
          g.stroke();
          if (mine || (boards.length <= 30 && !dimmed)) {
            g.globalAlpha = 1;
            g.fillStyle = css("--ink");
            g.textAlign = "center";
            g.textBaseline = "middle";
            const m = [0, 1].map(c => b.at.reduce((s, q) => s + q[c], 0) / 4);
            g.fillText(`${b.i + 1}`, ...m);
          }
        }
        g.globalAlpha = 1;
        g.lineWidth = 1.5;
        g.strokeStyle = css("--ink");
        front.forEach((q, k) => {
          const next = front[(k + 1) % 4];
          line(g, eye[0], eye[1], q[0], q[1]);
          line(g, q[0], q[1], next[0], next[1]);
        });
      },
      after: p => {
        const g = p.ctx,
          reach = Math.max(...placed.flat().map(q => q[2]), 0);
        g.fillStyle = css("--soft");
        g.textAlign = "left";
        g.textBaseline = "bottom";
        g.fillText(`boards up to ${short(reach)} m away`, p.box.x + 4, p.box.y - 6);
      },
      find: (p, x, y) => {
        const found = [...(p.boards || [])].reverse().find(b => inside(b.at, x, y));
        return found
          ? {
              view: found.i,
              text: `${tellView(found.i)}; ${short(Math.hypot(...views[found.i].pose.slice(9)))} m away`,
            }
          : null;
      },
    });
  }
  function inside(polygon, x, y) {
    let odd = false;
    for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
      const [xi, yi] = polygon[i],
        [xj, yj] = polygon[j];
      if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) odd = !odd;
    }
    return odd;
  }
  function target(name) {
    const d = panels[name],
      known = d.moved.map(m => m[0] != null);
    const sizes = d.moved.filter((_, i) => known[i]).map(m => Math.hypot(...m)),
      low = [0, 1].map(c => Math.min(...d.points.map(q => q[c]))),
      high = [0, 1].map(c => Math.max(...d.points.map(q => q[c])));
    const diagonal = Math.hypot(high[0] - low[0], high[1] - low[1]),
      magnified = below((0.12 * diagonal) / Math.max(quantile(sizes, 0.95), 1e-9));
    const top = Math.max(...d.moved.map((m, i) => (known[i] ? Math.abs(m[2]) : 0)), 1e-6),
      columns = data.columns;
    const placed = d.points.map((q, i) => (known[i] ? q.map((v, c) => v + magnified * d.moved[i][c]) : q));
    new Solid(name, {
      yaw: -0.5,
      pitch: 0.75,
      paint: p => {
        const g = p.ctx,
          to = p.aim([...d.points, ...placed]),
          flat = d.points.map(to),
          at = placed.map(to);
        const mesh = (where, colour, width) => {
          g.strokeStyle = colour;
          g.lineWidth = width;
          g.beginPath();
          if (columns)
            where.forEach((q, i) => {
              if ((i + 1) % columns && i + 1 < where.length && known[i] && known[i + 1]) {
                g.moveTo(q[0], q[1]);
                g.lineTo(where[i + 1][0], where[i + 1][1]);
              }
              if (i + columns < where.length && known[i] && known[i + columns]) {
                g.moveTo(q[0], q[1]);
                g.lineTo(where[i + columns][0], where[i + columns][1]);
              }
            });
          g.stroke();
        };
        mesh(flat, css("--line"), 1);
        g.strokeStyle = css("--soft");
        g.beginPath();
        flat.forEach((q, i) => {
          if (known[i]) {
            g.moveTo(q[0], q[1]);
            g.lineTo(at[i][0], at[i][1]);
          }
        });
        g.stroke();
        mesh(at, css("--ink"), 1);
        const dot = clamp(90 / Math.sqrt(d.points.length), 1.5, 5.5);
        at.forEach((q, i) => {
          if (!known[i]) return;
          g.fillStyle = paint(SIGNED, 0.5 - (0.5 * d.moved[i][2]) / top);
          g.beginPath();
          g.arc(q[0], q[1], dot, 0, 7);
          g.fill();
          g.strokeStyle = css("--soft");
          g.stroke();
        });
        p.at = at;
      },
      after: p => {
        const g = p.ctx;
        g.fillStyle = css("--soft");
        g.textAlign = "left";
        g.textBaseline = "bottom";
        g.fillText(`displacements × ${short(magnified)}`, p.box.x + 4, p.box.y - 6);
        scale(p, t => paint(SIGNED, 1 - t), -top, top, "mm away");
      },
      find: (p, x, y) => {
        let best = 14,
          found = null;
        (p.at || []).forEach((q, i) => {
          const far = Math.hypot(q[0] - x, q[1] - y);
          if (known[i] && far < best) {
            best = far;
            const m = d.moved[i];
            found = {
              text: `corner ${i}: ${short(m[0])}, ${short(m[1])} mm in the plane, ${short(m[2])} mm out of it`,
            };
          }
        });
        return found;
      },
    });
  }

  /* ---- what was tried ---- */
  function choice() {
    const rows = panels.choice.candidates,
      top = Math.max(...rows.map(r => r.heldOut + (r.error || 0))) * 1.05;
    new Plot("choice", {
      zooms: false,
      labels: ["held-out rms (px per point)", ""],
      gridX: true,
      margin: { l: 170, r: 16, t: 8, b: 42 },
      range: () => ({ x: [0, top], y: [-0.6, rows.length - 0.4] }),
      height: () => 26 * rows.length + 10,
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
        g.fillText(this.labels[0], x + w / 2, this.tall - 4);
        g.textAlign = "right";
        g.textBaseline = "middle";
        rows.forEach((r, i) => {
          g.fillStyle = css(r.loses === 0 ? "--ink" : "--soft");
          g.font = `${r.loses === 0 ? "600 " : ""}12px ${css("--sans")}`;
          g.fillText(r.name, x - 8, this.Y(i));
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
              text: `${r.name}: ${px(r.heldOut)}${r.error ? ` ± ${px(r.error)}` : ""}, ${r.loses === 0 ? "taken" : r.loses == null ? "" : r.loses > 0 ? `loses ${px(r.loses)}` : `would gain ${px(-r.loses)}`}`,
            }
          : null;
      },
    });
  }

  /* ---- entries side by side: error held out and on photographs that were used, best on top ---- */
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
              text: `${r.name}: ${r.heldOut == null ? r.failure : `held out ${px(r.heldOut)}${r.error ? ` ± ${px(r.error)}` : ""}, used ${px(r.used)}${r.loses ? `, loses ${px(r.loses)}` : ""}`}`,
            }
          : null;
      },
    });
  }

  /* ---- photographs: opened large, left out by a switch ---- */
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

  /* ---- tabs and copy buttons ---- */
  document.querySelectorAll("[role=tablist]").forEach(list => {
    const tabs = [...list.querySelectorAll("[role=tab]")];
    const choose = tab =>
      tabs.forEach(each => {
        const mine = each === tab;
        each.setAttribute("aria-selected", `${mine}`);
        each.tabIndex = mine ? 0 : -1;
        document.getElementById(each.getAttribute("aria-controls")).hidden = !mine;
      });
    tabs.forEach((tab, i) => {
      tab.addEventListener("click", () => choose(tab));
      tab.addEventListener("keydown", e => {
        const by = { ArrowRight: 1, ArrowLeft: -1 }[e.key];
        if (by) {
          const next = tabs[(i + by + tabs.length) % tabs.length];
          choose(next);
          next.focus();
        }
      });
    });
  });
  async function copied(text) {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch {
      /* no clipboard for files in this browser */
    }
    const area = Object.assign(document.createElement("textarea"), { value: text, className: "voice" });
    document.body.append(area);
    area.select();
    const done = document.execCommand("copy");
    area.remove();
    return done;
  }
  document.querySelectorAll("button.copy").forEach(button =>
    button.addEventListener("click", async () => {
      const from = button.closest(".camera, #left-out"),
        text = (from.querySelector("[role=tabpanel]:not([hidden]) code") || from.querySelector("code"))
          .textContent;
      const words = (await copied(text)) ? "Copied" : "Select and copy";
      button.textContent = words;
      say(words);
      setTimeout(() => {
        button.textContent = "Copy";
      }, 1600);
    }),
  );

  /* ---- all of it, and again when the theme or the paper changes ---- */
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
  for (const [name, draw] of Object.entries(FIGURES))
    if (panels[name] && document.getElementById(name)) draw();
  themed(false);
})();
