// Orbits of initial conditions: at most two, which are compared, and move.

import { pictureOf } from "./body.js";
import { drawSeries, fresh, placeIn } from "./overlay.js";
import { ending } from "./report.js";

const PACE = 1; // periods a second
const HELD = 14; // pixels from its first point within which an orbit is taken hold of
const TRAIL = 1; // periods

const COLOURS = ["#ffffff", "#ffe14d"];

export class Orbits {
  // `state` has the system and the view; `ask(point)` promises an orbit; `opened()` is told of a first one.
  constructor($, state, { following, ask, opened, redraw }) {
    Object.assign(this, { section: $("motion"), none: $("no-orbit"), ends: $("ends"), series: $("series"), plane: $("moving") });
    Object.assign(this, { body: $("body"), run: $("run"), moment: $("moment"), output: $("time") });
    Object.assign(this, { state, following, ask, opened, redraw, list: [], time: 0, running: !matchMedia("(prefers-reduced-motion: reduce)").matches });
    this.run.addEventListener("click", () => { this.running = !this.running; this.begin(); });
    this.moment.addEventListener("input", () => { this.running = false; this.time = this.moment.valueAsNumber; this.draw(); });
  }

  // Adds an orbit, or puts one in the place of another.
  add(orbit, system, place = null) {
    const first = !this.list.length;
    if (place === null) this.list = [...this.list, orbit].slice(-2);
    else this.list[place] = orbit;
    this.system = system;
    this.section.hidden = false;
    this.none.hidden = true;
    this.ends.replaceChildren(...this.list.map((o) => Object.assign(document.createElement("li"), { textContent: ending(o) })));
    this.picture = pictureOf(system, this.list.flatMap((o) => o.motion?.states ?? []));
    this.body.hidden = !this.picture;
    this.last = Math.max(...this.list.map((o) => motionOf(o).times.at(-1)));
    this.moment.max = this.last;
    if (place === null) this.time = 0;
    if (first) this.opened();
    this.show();
    if (first) this.section.scrollIntoView({ block: "nearest" });
    this.begin();
  }

  // Draws the orbit of a place.
  async follow(point) {
    const begun = {};
    this.begun = begun;
    this.following.begin("following the orbit");
    let told = null;
    try {
      this.add(await this.ask(point, this.following), this.state.system);
      this.redraw();
    } catch (error) {
      told = error;
    }
    if (this.begun === begun) this.following.end(told);
  }

  // Moves the first point of an orbit: one orbit is asked for at a time, then that of the newest place.
  async pull(number, point) {
    const busy = Boolean(this.pulled);
    this.pulled = { number, point };
    while (!busy && this.pulled) {
      const now = this.pulled;
      try {
        const found = await this.ask(now.point);
        if (now.number < this.list.length) this.add(found, this.state.system, now.number);
        this.redraw();
      } catch (error) {
        this.following.end(error);
      }
      if (this.pulled === now) this.pulled = null;
    }
  }

  show() {
    if (this.list.length) drawSeries(this.series, this.list, this.system.coordinates);
  }

  clear() {
    this.list = [];
    this.section.hidden = true;
    this.none.hidden = false;
    this.draw();
  }

  // Returns the number of the orbit whose first point is near a place of the image, in fractions.
  held(place, { width, height }) {
    const { view, system } = this.state;
    const near = this.list.map((o) => placeIn(o.strobe[0], view, system.coordinates))
      .map(([x, y]) => Math.hypot((x - place[0]) * width, (y - place[1]) * height));
    const nearest = near.indexOf(Math.min(...near));
    return near[nearest] < HELD ? nearest : null;
  }

  begin() {
    this.run.textContent = this.running ? "Pause" : "Run";
    this.run.ariaPressed = String(this.running);
    if (this.moving) return;
    this.moving = true;
    let before = performance.now();
    const step = (now) => {
      if (!this.list.length || !this.running) {
        this.moving = false;
        this.draw();
        return;
      }
      this.time += (PACE * Math.max(0, now - before)) / 1000;
      before = now;
      if (this.time > this.last) this.time = 0;
      this.draw();
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  // Draws where the orbits are now, in the plane and beside it.
  draw() {
    const { context, width, height } = fresh(this.plane);
    if (!this.list.length) return;
    this.moment.valueAsNumber = this.time;
    this.output.textContent = `${this.time.toFixed(1)} periods`;
    this.list.forEach((orbit, k) => {
      const state = stateAt(motionOf(orbit), this.time, this.system.coordinates);
      if (!state) return;
      const [x, y] = placeIn(state, this.state.view, this.system.coordinates);
      context.beginPath();
      context.arc(x * width, (1 - y) * height, 6, 0, 2 * Math.PI);
      Object.assign(context, { fillStyle: COLOURS[k % 2], strokeStyle: "#000", lineWidth: 2 });
      context.fill();
      context.stroke();
    });
    const orbit = this.list.at(-1);
    if (!this.picture || !this.body.offsetParent || !orbit.motion) return;
    const { times, states, pivot } = orbit.motion;
    const n = Math.min(indexOf(times, this.time), times.length - 1);
    const trail = states.slice(indexOf(times, this.time - TRAIL), n + 1);
    this.picture(this.body, stateAt(orbit.motion, this.time, this.system.coordinates) ?? states.at(-1), trail, pivot?.[n]);
  }
}

const motionOf = (orbit) => orbit.motion ?? { times: orbit.strobe.map((_, n) => n), states: orbit.strobe, jumps: true };

const indexOf = (times, time) => Math.max(0, Math.floor((time * (times.length - 1)) / (times.at(-1) || 1)));

// Returns the state at a time between samples; that of a map stays where it is until the next image.
function stateAt({ times, states, jumps }, time, coordinates) {
  const n = indexOf(times, time);
  const [before, after] = [states[n], states[n + 1]];
  if (!before || before[0] === null) return null;
  if (jumps || !after || after[0] === null) return before;
  const part = (time - times[n]) / (times[n + 1] - times[n]);
  return before.map((v, j) => {
    const { period } = coordinates[j];
    const difference = after[j] - v;
    return v + part * (period ? difference - period * Math.round(difference / period) : difference);
  });
}
