// The window: drag, wheel, pinch, box and keys change its limits; each change that lasts is remembered.

const CLICK = 4; // pixels that a pointer may move in a click

export class Gestures {
  // `get` returns the view; `set(lower, upper)` changes it; `clicked(place)` and `pointed(place)` get fractions.
  // `held(place)` returns what is under the pointer and moves with it, null for nothing; `pulled(what, place)` moves it.
  constructor(canvas, { get, set, clicked, pointed, held, pulled, box }) {
    Object.assign(this, { canvas, get, set, clicked, pointed, held, pulled, box });
    this.pointers = new Map();
    this.past = [];
    this.future = [];
    this.cross = [0.5, 0.5];
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => this.up(e));
    canvas.addEventListener("pointerleave", () => { if (!this.pointers.size) this.pointed(null); });
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
  }

  fraction(event) {
    const r = this.canvas.getBoundingClientRect();
    return [(event.clientX - r.left) / r.width, 1 - (event.clientY - r.top) / r.height];
  }

  limits() {
    const { lower, upper } = this.get();
    return { lower: [...lower], upper: [...upper] };
  }

  remember(limits = this.limits()) {
    this.past.push(limits);
    if (this.past.length > 100) this.past.shift();
    this.future = [];
  }

  // Begins anew with another system: what is under way belongs to the one before.
  forget() {
    this.past = [];
    this.future = [];
    this.pointers.clear();
  }

  back() { this.exchange(this.past, this.future); }
  forward() { this.exchange(this.future, this.past); }

  exchange(from, to) {
    if (!from.length) return;
    to.push(this.limits());
    const { lower, upper } = from.pop();
    this.set(lower, upper);
  }

  change(lower, upper) {
    this.remember();
    this.set(lower, upper);
  }

  // Zooms by a factor about a place that keeps its coordinates.
  zoom(factor, at = [0.5, 0.5], begin = this.limits()) {
    const lower = begin.lower.map((a, k) => a + at[k] * (begin.upper[k] - a) * (1 - factor));
    this.set(lower, lower.map((a, k) => a + factor * (begin.upper[k] - begin.lower[k])));
  }

  shift(by, begin = this.limits()) {
    const move = begin.lower.map((a, k) => -by[k] * (begin.upper[k] - a));
    this.set(begin.lower.map((a, k) => a + move[k]), begin.upper.map((b, k) => b + move[k]));
  }

  down(event) {
    if (event.button) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.fraction(event));
    this.begin = { limits: this.limits(), points: [...this.pointers.values()], at: [event.clientX, event.clientY] };
    this.moved = this.pointers.size > 1;
    this.boxing = event.shiftKey || this.box.checked;
    this.holding = this.moved ? null : this.held(this.fraction(event));
  }

  move(event) {
    const now = this.fraction(event);
    if (!this.pointers.has(event.pointerId)) {
      this.canvas.style.cursor = this.held(now) === null ? "" : "grab";
      return this.pointed(now);
    }
    this.pointers.set(event.pointerId, now);
    const [x, y] = this.begin.at;
    this.moved ||= Math.hypot(event.clientX - x, event.clientY - y) > CLICK;
    if (!this.moved) return undefined;
    const before = this.begin.points;
    const present = [...this.pointers.values()];
    if (present.length > 1 && before.length > 1) {
      const ratio = distance(before) / Math.max(distance(present), 1e-3);
      this.zoom(ratio, middle(before), this.begin.limits);
    } else if (this.holding !== null) {
      this.pulled(this.holding, now);
      this.pointed(now);
    } else if (this.boxing) {
      this.pointed(now, [before[0], now]);
    } else {
      this.shift(now.map((v, k) => v - before[0][k]), this.begin.limits);
    }
    return undefined;
  }

  up(event) {
    if (!this.pointers.has(event.pointerId)) return;
    const end = this.fraction(event);
    this.pointers.delete(event.pointerId);
    if (this.pointers.size) return;
    if (!this.moved) {
      if (event.type === "pointerup") this.clicked(end);
      return;
    }
    if (this.holding !== null) this.pulled(this.holding, end);
    else if (this.boxing) this.zoomInto(this.begin.points[0], end);
    else this.remember(this.begin.limits);
    this.pointed(end);
  }

  zoomInto(one, other) {
    const { lower, upper } = this.limits();
    const sides = lower.map((a, k) => [one[k], other[k]].sort((p, q) => p - q).map((f) => a + f * (upper[k] - a)));
    if (sides.every(([a, b], k) => b - a > 1e-4 * (upper[k] - lower[k]))) {
      this.change(sides.map((s) => s[0]), sides.map((s) => s[1]));
    }
  }

  wheel(event) {
    event.preventDefault();
    const now = performance.now();
    if (now - (this.wheeled ?? -1e9) > 400) this.remember();
    this.wheeled = now;
    this.zoom(1.0015 ** Math.max(-300, Math.min(300, event.deltaY * (event.deltaMode ? 30 : 1))), this.fraction(event));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    const act = {
      b: () => this.back(), f: () => this.forward(), r: () => this.reset(), Enter: () => this.clicked(this.cross),
      "+": () => { this.remember(); this.zoom(0.5, this.cross); }, "-": () => { this.remember(); this.zoom(2, this.cross); },
    }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!by && !act) return;
    event.preventDefault();
    if (act) act();
    else if (event.shiftKey) { this.remember(); this.shift(by.map((v) => -0.1 * v)); }
    else {
      this.cross = this.cross.map((v, k) => Math.min(0.999, Math.max(0.001, v + 0.02 * by[k])));
      this.pointed(this.cross, null, true);
    }
  }
}

const distance = ([a, b]) => Math.hypot(a[0] - b[0], a[1] - b[1]);
const middle = ([a, b]) => [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
