/* Figures over the frame. */
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
      each(v.x[k] / units.place, v.y[k] / units.place, v.ex[k] / units.residual, v.ey[k] / units.residual, k);
};
const idOf = (v, k) => (v.ids ? v.ids[k] : k);
const quantile = (values, q) => {
  const s = Float64Array.from(values).sort();
  return s.length ? s[Math.min(s.length - 1, Math.floor(q * s.length))] : 0;
};

/* one place along the axis for each photograph */
const alongViews = (top, label) => ({
  range: () => ({ x: [-0.6, Math.max(views.length, 4) - 0.4], y: [top, 0] }),
  labels: ["photograph", label],
  gridY: true,
  zoomsX: true,
  margin: { l: 66, r: 14, t: 30, b: 42 },
  height: () => 210,
  ticksX: p => {
    const [from, to] = p.shown.x,
      room = p.box.w / (to - from),
      names = room > 92,
      by = names ? 1 : Math.max(1, Math.ceil(34 / room)),
      named = name => (name.length > 14 ? "…" + name.slice(-13) : name),
      told = [];
    for (let i = Math.max(0, Math.ceil(from)); i <= to && i < views.length; i++)
      if (i % by === 0) told.push({ at: i, text: names ? named(views[i].name) : `${i + 1}` });
    return told;
  },
});
const viewAt = (p, x, y) => {
  const i = Math.round(p.atX(x)),
    within = y > p.box.y && y < p.box.y + p.box.h + 20;
  return within && i >= 0 && i < views.length && Math.abs(p.atX(x) - i) < 0.5 ? i : null;
};
const faded = i => (state.off.has(i) ? 0.25 : state.picked == null || state.picked === i ? 1 : 0.45);

function byView() {
  const top = Math.max(...views.map(v => Math.max(v.rms || 0, v.heldOut || 0)), 1e-9) * 1.06;
  new Plot("by-view", {
    ...alongViews(top, "rms (px per point)"),
    paint: p => {
      const g = p.ctx,
        wide = Math.max(1, 0.72 * (p.X(1) - p.X(0)));
      views.forEach((v, i) => {
        g.globalAlpha = faded(i);
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
      const i = viewAt(p, x, y);
      return i == null ? null : { view: i, text: tellView(i) };
    },
  });
}
function withoutEach() {
  const moves = panels["without-each"].px;
  new Plot("without-each", {
    ...alongViews(Math.max(...moves.map(v => v || 0), 1e-9) * 1.06, "image moves (px)"),
    paint: p => {
      const g = p.ctx,
        wide = Math.max(1, 0.72 * (p.X(1) - p.X(0)));
      moves.forEach((v, i) => {
        g.globalAlpha = faded(i);
        g.fillStyle = css("--green");
        if (v != null) g.fillRect(p.X(i) - wide / 2, p.Y(v), wide, p.Y(0) - p.Y(v));
      });
      g.globalAlpha = 1;
    },
    find: (p, x, y) => {
      const i = viewAt(p, x, y);
      if (i == null) return null;
      const told =
        moves[i] == null ? "the others cannot tell the camera" : `the image moves by ${px(moves[i])}`;
      return { view: i, text: `without ${i + 1} ${views[i].name}: ${told}` };
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
