// The second pane over two parameters: where attractors are stable, the boundaries, and the present values.

import { colourOf, css } from "./colours.js";
import { choices } from "./controls.js";
import { axisName, ticks } from "./numbers.js";
import { fresh } from "./overlay.js";

const [LEFT, BOTTOM] = [52, 34];
const DASHES = { PLUS_ONE: [], MINUS_ONE: [6, 4], NEIMARK_SACKER: [2, 3] };

export class Plane {
  // `state` has the system and the view; `set(values)` changes parameters; `nameOf(identity)`.
  constructor(state, { set, nameOf, elements }) {
    Object.assign(this, { state, set, nameOf }, elements);
    this.found = null;
    this.shown.addEventListener("change", () => this.draw());
    this.canvas.addEventListener("click", (event) => {
      const box = this.canvas.getBoundingClientRect();
      this.choose([
        (event.clientX - box.left - LEFT) / (box.width - LEFT),
        1 - (event.clientY - box.top) / (box.height - BOTTOM),
      ]);
    });
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
    const back = getComputedStyle(document.body).backgroundColor.match(/\d+/g).map(Number);
    const mixed = (rgb, part) => rgb.map((c, k) => Math.round(part * c + (1 - part) * back[k]));
    if (this.shown.value === "") {
      const stable = identities.filter((_, k) => unstable[k * size + place] === 0).length;
      return mixed(colourOf(0), stable / identities.length);
    }
    const number = Number(this.shown.value);
    const count = unstable[identities.indexOf(number) * size + place];
    return mixed(colourOf(number), count < 0 ? 0 : count ? 0.25 : 1);
  }

  draw() {
    if (!this.found || this.canvas.hidden) return;
    const { context, width, height } = fresh(this.canvas);
    const { x, y, parameters, curves, params } = this.found;
    const [wide, high] = [width - LEFT, height - BOTTOM];
    const buffer = Object.assign(document.createElement("canvas"), { width: x.length, height: y.length });
    const image = buffer.getContext("2d").createImageData(x.length, y.length);
    for (let place = 0; place < x.length * y.length; place++) {
      const row = y.length - 1 - Math.floor(place / x.length);
      image.data.set([...this.colour(place), 255], 4 * (row * x.length + (place % x.length)));
    }
    buffer.getContext("2d").putImageData(image, 0, 0);
    context.imageSmoothingEnabled = false;
    context.drawImage(buffer, LEFT, 0, wide, high);
    const { color } = getComputedStyle(this.canvas);
    const across = (v) => LEFT + (wide * (v - x[0])) / (x.at(-1) - x[0]);
    const up = (v) => high * (1 - (v - y[0]) / (y.at(-1) - y[0]));
    for (const curve of curves) {
      if (this.shown.value !== "" && Number(this.shown.value) !== curve.identity) continue;
      context.beginPath();
      curve.x.forEach((v, k) => context.lineTo(across(v), up(curve.y[k])));
      context.setLineDash(DASHES[curve.crossing]);
      Object.assign(context, { strokeStyle: color, lineWidth: 1.5 });
      context.stroke();
      context.setLineDash([]);
    }
    Object.assign(context, { fillStyle: color, font: "11px system-ui, sans-serif", textAlign: "center" });
    for (const { at, text } of ticks(x[0], x.at(-1), 5)) context.fillText(text, across(at), high + 14);
    context.fillText(axisName({ name: parameters[0] }, x[0], x.at(-1)), LEFT + wide / 2, height - 5);
    context.textAlign = "right";
    for (const { at, text } of ticks(y[0], y.at(-1), 5)) if (up(at) > 18) context.fillText(text, LEFT - 4, up(at) + 4);
    context.textAlign = "left";
    context.fillText(axisName({ name: parameters[1] }, y[0], y.at(-1)), 2, 11);
    const now = parameters.map((name) => this.state.view.params[name]);
    context.beginPath();
    context.arc(across(now[0]), up(now[1]), 6, 0, 2 * Math.PI);
    for (const [size, style] of [[4, "#fff"], [2, "#000"]]) {
      Object.assign(context, { lineWidth: size, strokeStyle: style });
      context.stroke();
    }
    const others = Object.entries(params).some(([name, v]) => !parameters.includes(name) && v !== this.state.view.params[name]);
    this.note.textContent = others ? "Other parameters have changed since: compute the map again." : "";
    this.canvas.setAttribute("aria-label", `Stability map, now ${parameters.map((name, k) => `${name} = ${now[k]}`).join(", ")}: `
      + "a click, or the arrow keys, set both parameters");
  }
}
