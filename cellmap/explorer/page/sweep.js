// The second pane: attractors along a parameter, the present value, and films of the basins on the way.

import { colourOf, css } from "./colours.js";
import { choices } from "./controls.js";
import { axisName, ticks } from "./numbers.js";
import { fresh } from "./overlay.js";

const MARGIN = 22;

// Fields for a parameter and its range.
export class Range {
  constructor(place) {
    [this.parameter, this.lower, this.upper] = place.querySelectorAll("select, input");
    this.parameter.addEventListener("change", () => this.around());
  }

  make(params, k) {
    this.params = params;
    const names = Object.keys(params);
    choices(this.parameter, names.map((name) => [name, name]), names[Math.min(k, names.length - 1)]);
    this.around();
  }

  around() {
    const value = this.params[this.parameter.value] ?? 0;
    const half = 0.5 * (Math.abs(value) || 1);
    this.lower.value = Number((value - half).toPrecision(4));
    this.upper.value = Number((value + half).toPrecision(4));
  }

  asked() {
    return { parameter: this.parameter.value, lower: this.lower.valueAsNumber, upper: this.upper.valueAsNumber };
  }
}

export class Sweep {
  // `state` has the system and the view; `set(name, value)` changes a parameter.
  constructor(state, { set, elements }) {
    Object.assign(this, { state, set }, elements);
    this.found = null;
    this.stopped = null; // a film that is not complete
    for (const element of [this.first.parameter, this.first.lower, this.first.upper, this.stills]) {
      element.addEventListener("input", () => this.named());
    }
    this.coordinate.addEventListener("change", () => this.draw());
    this.canvas.addEventListener("click", (event) => {
      const box = this.canvas.getBoundingClientRect();
      this.choose((event.clientX - box.left) / box.width);
    });
    this.canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -0.01, ArrowRight: 0.01 }[event.key];
      if (!by || !this.found) return;
      event.preventDefault();
      this.choose(this.place(this.state.view.params[this.found.parameter]) + by);
    });
  }

  // Offers the parameters and coordinates of another system.
  make() {
    this.found = this.stopped = null;
    this.canvas.hidden = true;
    this.first.make(this.state.view.params, 0);
    this.second.make(this.state.view.params, 1);
    choices(this.coordinate, this.state.system.coordinates.map((c, j) => [j, c.name]), 0);
  }

  async diagram(ask) {
    const found = await ask({ type: "diagram", ...this.first.asked() });
    const bytes = found.data.slice();
    this.found = { ...found, points: new Float32Array(bytes.buffer) };
    this.canvas.hidden = false;
    this.draw();
  }

  // Asks for the film along the range; one that was stopped goes on where it was.
  async film(view, ask) {
    const palette = Array.from({ length: 64 }, (_, k) => colourOf(k + this.lowest));
    const asked = this.filmed(view);
    try {
      const file = await ask({ type: "film", ...JSON.parse(asked), format: this.format.value, palette });
      this.stopped = null;
      return file;
    } catch (error) {
      if (error.done) this.stopped = { asked, done: error.done, of: error.of };
      throw error;
    } finally {
      this.named();
    }
  }

  // Returns what a film consists of, as text: all but the present value of its parameter.
  filmed(view) {
    const range = this.first.asked();
    const params = { ...view.params, [range.parameter]: range.lower };
    return JSON.stringify({ ...range, stills: Number(this.stills.value), view: { ...view, params } });
  }

  // Says on the button whether a film begins or goes on.
  named() {
    const { stopped } = this;
    const goes = stopped && stopped.asked === this.filmed(this.state.view);
    this.button.textContent = goes ? `Resume the film (${stopped.done} of ${stopped.of})` : "Film of the basins";
  }

  place(value) {
    const { values } = this.found;
    return (value - values[0]) / (values.at(-1) - values[0]);
  }

  choose(fraction) {
    if (!this.found) return;
    const { values, parameter } = this.found;
    const inside = Math.min(1, Math.max(0, fraction));
    this.set(parameter, Number((values[0] + inside * (values.at(-1) - values[0])).toPrecision(6)));
  }

  draw() {
    if (!this.found || this.canvas.hidden) return;
    const { context, width, height } = fresh(this.canvas);
    const { shape: [branches, count, periods, dimension], values, points, identities, parameter, params } = this.found;
    const j = Number(this.coordinate.value);
    let [low, high] = [Infinity, -Infinity];
    for (let i = j; i < points.length; i += dimension) {
      if (points[i] < low) low = points[i];
      if (points[i] > high) high = points[i];
    }
    const span = high - low || 1;
    const y = (v) => (height - MARGIN) * (0.97 - 0.94 * ((v - low) / span));
    for (let b = 0; b < branches; b++) {
      context.fillStyle = css(identities[b]);
      for (let n = 0; n < count; n++) {
        const x = this.place(values[n]) * width;
        for (let m = 0; m < periods; m++) {
          const v = points[((b * count + n) * periods + m) * dimension + j];
          if (Number.isFinite(v)) context.fillRect(x, y(v), 1.5, 1.5);
        }
      }
    }
    const { color } = getComputedStyle(this.canvas);
    const now = this.state.view.params[parameter];
    context.fillStyle = color;
    context.fillRect(this.place(now) * width, 0, 1, height - MARGIN);
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "center";
    for (const { at, text } of ticks(values[0], values.at(-1), 5)) context.fillText(text, this.place(at) * width, height - 8);
    context.textAlign = "right";
    context.fillText(axisName({ name: parameter }, values[0], values.at(-1)), width - 4, height - MARGIN - 4);
    context.textAlign = "left";
    const others = Object.entries(params).some(([name, v]) => name !== parameter && v !== this.state.view.params[name]);
    context.fillText(this.state.system.coordinates[j].name + (others ? "  (other parameters have changed)" : ""), 4, 12);
    Object.entries({ now, min: values[0], max: values.at(-1) }).forEach(([key, v]) => this.canvas.setAttribute(`aria-value${key}`, v));
  }
}
