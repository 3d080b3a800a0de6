/* In three dimensions: turned by dragging or by the arrow keys. */
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
