// The second pane over two parameters: where attractors are stable, the boundaries, and the present values.

import { chart } from "./chart.js";
import { colourOf } from "./colours.js";
import { choices } from "./controls.js";

const DASHES = { PLUS_ONE: [], MINUS_ONE: [6, 4], NEIMARK_SACKER: [2, 3] };

const PALE = 0.25; // of its colour is left where an orbit is unstable

const mixed = (number, part) => {
  const back = getComputedStyle(document.body).backgroundColor.match(/\d+/g).map(Number);
  return colourOf(number).map((c, k) => Math.round(part * c + (1 - part) * back[k]));
};

export class Plane {
  // `state` has the system and the view; `set(values)` changes parameters; `nameOf(identity)`.
  constructor(state, { set, nameOf, elements }) {
    Object.assign(this, { state, set, nameOf }, elements);
    this.found = null;
    this.shown.addEventListener("change", () => this.draw());
    this.canvas.addEventListener("click", (event) => this.choose(this.chart.fraction(event)));
    this.canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!by || !this.found) return;
      event.preventDefault();
      this.choose(this.present().map((v, k) => v + 0.01 * by[k]));
    });
  }

  make() {
    this.found = null;
    this.canvas.hidden = this.row.hidden = true;
  }

  async compute(x, y, ask) {
    if (x.parameter === y.parameter) throw new Error(`both parameters are ${x.parameter}: choose two`);
    const found = await ask({ type: "stability", x, y });
    this.found = { ...found, unstable: new Int8Array(found.data.slice().buffer) };
    choices(this.shown, [["", "all: how many are stable"], ...found.identities.map((k) => [k, this.nameOf(k)])], "");
    this.canvas.hidden = this.row.hidden = false;
    this.draw();
    this.canvas.scrollIntoView({ block: "nearest" });
  }

  // Returns the present values as fractions of the ranges.
  present() {
    const { parameters, x, y } = this.found;
    return [x, y].map((axis, k) => (this.state.view.params[parameters[k]] - axis[0]) / (axis.at(-1) - axis[0]));
  }

  choose(fractions) {
    if (!this.found) return;
    const { parameters, x, y } = this.found;
    const value = (axis, f) => Number((axis[0] + Math.min(1, Math.max(0, f)) * (axis.at(-1) - axis[0])).toPrecision(6));
    this.set({ [parameters[0]]: value(x, fractions[0]), [parameters[1]]: value(y, fractions[1]) });
  }

  // Returns the colour of a point of the grid: stable in full, unstable pale, none where no orbit is known.
  colour(place) {
    const { identities, unstable, x, y } = this.found;
    const size = x.length * y.length;
    if (this.shown.value === "") {
      const stable = identities.filter((_, k) => unstable[k * size + place] === 0).length;
      return mixed(0, stable / identities.length);
    }
    const number = Number(this.shown.value);
    const count = unstable[identities.indexOf(number) * size + place];
    return mixed(number, count < 0 ? 0 : count ? PALE : 1);
  }

  // Says what the colours and lines mean.
  explain() {
    const { identities } = this.found;
    const number = Number(this.shown.value);
    const steps = this.shown.value === ""
      ? Array.from({ length: identities.length + 1 }, (_, k) => [`${k} stable`, mixed(0, k / identities.length)])
      : [["stable", mixed(number, 1)], ["unstable", mixed(number, PALE)], ["no orbit", mixed(number, 0)]];
    this.scale.replaceChildren(...steps.flatMap(([text, colour]) => {
      const mark = Object.assign(document.createElement("span"), { className: "swatch" });
      mark.style.background = `rgb(${colour.join(" ")})`;
      return [mark, ` ${text}`];
    }));
  }

  draw() {
    if (!this.found || !this.canvas.offsetParent) return;
    const { x, y, parameters, curves, params } = this.found;
    const { symbols, units } = this.state.system;
    const [axis, other] = [x, y].map((values, k) => ({ lower: values[0], upper: values.at(-1), symbol: symbols[parameters[k]], unit: units[parameters[k]] }));
    this.chart = chart(this.canvas, axis, other);
    const { context, across, up, inside, color } = this.chart;
    const buffer = Object.assign(document.createElement("canvas"), { width: x.length, height: y.length });
    const image = buffer.getContext("2d").createImageData(x.length, y.length);
    for (let place = 0; place < x.length * y.length; place++) {
      const row = y.length - 1 - Math.floor(place / x.length);
      image.data.set([...this.colour(place), 255], 4 * (row * x.length + (place % x.length)));
    }
    buffer.getContext("2d").putImageData(image, 0, 0);
    context.imageSmoothingEnabled = false;
    context.drawImage(buffer, inside.left, inside.top, inside.right - inside.left, inside.bottom - inside.top);
    for (const curve of curves) {
      if (this.shown.value !== "" && Number(this.shown.value) !== curve.identity) continue;
      context.beginPath();
      curve.x.forEach((v, k) => context.lineTo(across(v), up(curve.y[k])));
      context.setLineDash(DASHES[curve.crossing]);
      Object.assign(context, { strokeStyle: color, lineWidth: 1.5 });
      context.stroke();
      context.setLineDash([]);
    }
    const now = parameters.map((name) => this.state.view.params[name]);
    context.beginPath();
    context.arc(across(now[0]), up(now[1]), 6, 0, 2 * Math.PI);
    for (const [size, style] of [[4, "#fff"], [2, "#000"]]) {
      Object.assign(context, { lineWidth: size, strokeStyle: style });
      context.stroke();
    }
    const others = Object.entries(params).some(([name, v]) => !parameters.includes(name) && v !== this.state.view.params[name]);
    this.explain();
    this.note.textContent = `Multipliers on the lines: +1 full, −1 dashed, a complex pair (Neimark–Sacker) dotted.${others ? " Other parameters have changed since: compute the map again." : ""}`;
    this.canvas.setAttribute("aria-label", `Stability map, now ${parameters.map((name, k) => `${name} = ${now[k]}`).join(", ")}: `
      + "a click, or the arrow keys, set both parameters");
  }
}
