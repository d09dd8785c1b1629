// The second pane: attractors along a parameter, the present value, and films of the basins on the way.

import { around, chart } from "./chart.js";
import { colourOf, css } from "./colours.js";
import { choices } from "./controls.js";

// Fields for a parameter and its range.
export class Range {
  constructor(place) {
    [this.parameter, this.lower, this.upper] = place.querySelectorAll("select, input");
    this.parameter.addEventListener("change", () => this.around());
  }

  make(params, k, symbols = {}) {
    this.params = params;
    const names = Object.keys(params);
    choices(this.parameter, names.map((name) => [name, symbols[name] ?? name]), names[Math.min(k, names.length - 1)]);
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
    for (const element of [this.first.parameter, this.first.lower, this.first.upper, this.stills, this.format]) {
      element.addEventListener("input", () => this.named());
    }
    this.coordinate.addEventListener("change", () => this.draw());
    this.canvas.addEventListener("click", (event) => this.choose(this.chart.fraction(event)[0]));
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
    const { coordinates, symbols } = this.state.system;
    this.first.make(this.state.view.params, 0, symbols);
    this.second.make(this.state.view.params, 1, symbols);
    choices(this.coordinate, coordinates.map((c, j) => [j, c.symbol]), 0);
  }

  async diagram(ask) {
    const found = await ask({ type: "diagram", ...this.first.asked() });
    const bytes = found.data.slice();
    this.found = { ...found, points: new Float32Array(bytes.buffer) };
    this.canvas.hidden = false;
    this.draw();
    this.canvas.scrollIntoView({ block: "nearest" });
  }

  // Asks for the film along the range; one that was stopped goes on where it was.
  async film(view, ask) {
    const palette = Array.from({ length: 64 }, (_, k) => colourOf(k + this.lowest));
    const asked = this.filmed(view);
    try {
      const file = await ask({ type: "film", ...JSON.parse(asked), palette });
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
    const [range, second] = [this.first.asked(), this.second.asked()];
    const params = { ...view.params, [range.parameter]: range.lower };
    const plane = this.format.value === "plane";
    if (plane) params[second.parameter] = second.lower;
    const over = plane ? { across: second, format: "html" } : { format: this.format.value };
    return JSON.stringify({ ...range, ...over, stills: Number(this.stills.value), view: { ...view, params } });
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
    if (!this.found || !this.canvas.offsetParent) return;
    const { shape: [branches, count, periods, dimension], values, points, identities, parameter, params } = this.found;
    const { system, view } = this.state;
    const j = Number(this.coordinate.value);
    const shown = points.filter((_, i) => i % dimension === j);
    const along = { lower: values[0], upper: values.at(-1), symbol: system.symbols[parameter], unit: system.units[parameter] };
    this.chart = chart(this.canvas, along, { ...around(shown), ...system.coordinates[j] });
    const { context, across, up, inside, color } = this.chart;
    for (let b = 0; b < branches; b++) {
      context.fillStyle = css(identities[b]);
      for (let n = 0; n < count; n++) {
        const x = across(values[n]);
        for (let m = 0; m < periods; m++) {
          const v = shown[(b * count + n) * periods + m];
          if (Number.isFinite(v)) context.fillRect(x, up(v), 1.5, 1.5);
        }
      }
    }
    context.fillStyle = color;
    context.fillRect(across(view.params[parameter]), inside.top, 1, inside.bottom - inside.top);
    const others = Object.entries(params).some(([name, v]) => name !== parameter && v !== view.params[name]);
    context.textAlign = "right";
    if (others) context.fillText("other parameters have changed", inside.right, inside.top - 5);
    Object.entries({ now: view.params[parameter], min: values[0], max: values.at(-1) }).forEach(([key, v]) => this.canvas.setAttribute(`aria-value${key}`, v));
  }
}
