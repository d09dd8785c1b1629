// An image that is looked at alone: with axes, a legend, and the attractor under the pointer.

import { css } from "./colours.js";
import { placed } from "./numbers.js";
import { drawOverlay } from "./overlay.js";
import { Picture } from "./picture.js";

const $ = (id) => document.getElementById(id);

// Shows which colour is which attractor, and other labels, with their fractions.
export function showLegend(list, rows) {
  list.replaceChildren(...rows.map(({ number, name, fraction }) => {
    const item = document.createElement("li");
    const mark = Object.assign(document.createElement("span"), { className: "swatch" });
    mark.style.background = css(number);
    item.append(mark, ` ${name} `, Object.assign(document.createElement("span"), { className: "weak", textContent: `${(100 * fraction).toPrecision(2)} %` }));
    return item;
  }));
}

// Puts a text beside the pointer, within its frame; hides it without one.
export function showAt(element, text, [x, y] = []) {
  element.hidden = !text;
  if (!text) return;
  element.textContent = text;
  Object.assign(element.style, {
    left: x > 0.6 ? "" : `calc(${100 * x}% + 14px)`, right: x > 0.6 ? `calc(${100 * (1 - x)}% + 14px)` : "",
    top: y > 0.9 ? `calc(${100 * (1 - y)}% + 18px)` : "", bottom: y > 0.9 ? "" : `calc(${100 * y}% + 10px)`,
  });
}

export class Viewer {
  constructor(codes, lowest) {
    this.codes = codes;
    this.picture = new Picture($("image"), lowest);
    $("image").addEventListener("pointermove", (event) => this.point(event));
    $("image").addEventListener("pointerleave", () => this.point(null));
    addEventListener("resize", () => this.draw());
  }

  // Shows a frame of a view of a system.
  show(frame, view, system) {
    Object.assign(this, { frame, view, system });
    this.picture.show(frame, view);
    this.draw();
    const counts = new Map();
    for (const code of this.picture.codes) counts.set(code, (counts.get(code) ?? 0) + 1);
    const names = new Map(Object.entries(this.codes).map(([name, code]) => [code, name]));
    for (const a of frame.attractors) names.set(a.identity, a.name);
    this.names = names;
    const rows = [...counts].map(([code, n]) => ({ number: code + this.picture.lowest, fraction: n / this.picture.codes.length }));
    rows.sort((a, b) => b.fraction - a.fraction);
    showLegend($("legend"), rows.slice(0, 12).map((row) => ({ ...row, name: names.get(row.number) ?? "" })));
    if (this.at) this.tell();
  }

  draw() {
    if (!this.frame) return;
    this.picture.draw(this.view);
    drawOverlay($("overlay"), { view: this.view, coordinates: this.system.coordinates, attractors: this.frame.attractors, orbits: [] });
  }

  point(event) {
    const box = $("image").getBoundingClientRect();
    this.at = event && [(event.clientX - box.left) / box.width, 1 - (event.clientY - box.top) / box.height];
    this.tell();
  }

  tell() {
    const number = this.at ? this.picture.numberAt(...this.at) : null;
    const name = number === null ? "" : (this.names?.get(number) ?? "");
    showAt($("pointer"), name, this.at ?? []);
    if (!name) return;
    const { axes, lower, upper } = this.view;
    const where = axes.map((j, k) => `${this.system.coordinates[j].symbol} = ${placed(lower[k] + this.at[k] * (upper[k] - lower[k]), lower[k], upper[k])}`);
    $("here").textContent = `${where.join(", ")}: ${name}`;
  }
}
