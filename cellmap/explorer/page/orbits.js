// Orbits of initial conditions: at most two, which are compared.

import { drawSeries } from "./overlay.js";
import { ending } from "./report.js";

export class Orbits {
  constructor({ section, ends, series }) {
    Object.assign(this, { section, ends, series });
    this.list = [];
  }

  add(orbit, coordinates) {
    this.list = [...this.list, orbit].slice(-2);
    this.section.hidden = false;
    this.ends.replaceChildren(...this.list.map((o) => Object.assign(document.createElement("li"), { textContent: ending(o) })));
    drawSeries(this.series, this.list, coordinates);
  }

  clear() {
    this.list = [];
    this.section.hidden = true;
  }
}
