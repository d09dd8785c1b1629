// Sliders with number fields, and fields for the limits of the window.

import { entered, placed, short } from "./numbers.js";

const LAP = 8000; // milliseconds in which a slider that plays comes from one end to the other
const FAR = 5; // ranges by which a value may lie outside of the range of its slider, which is then extended to it

// Returns the range of a slider around the value that a parameter has at first.
function range(value) {
  if (value === 0) return [-1, 1];
  return value > 0 ? [0, 2 * value] : [2 * value, 0];
}

// Returns the range of a slider at a value: that at first, extended to the value, or around it where it is far away.
function rangeAt(value, [low, high]) {
  if (Math.abs(value - (low + high) / 2) > FAR * (high - low)) return range(Math.max(-8e307, Math.min(8e307, value)));
  return [Math.min(low, value), Math.max(high, value)];
}

export class Controls {
  // `changed(name, value)` is called for parameters, with the name null for the phase.
  constructor(place, changed) {
    this.place = place;
    this.changed = changed;
    this.rows = new Map();
    this.chosen = undefined; // name of the one that was moved last
  }

  // Makes a row for each parameter, and one for the phase of a forced system.
  make(view, units, symbols) {
    this.stop();
    this.rows.clear();
    const rows = Object.entries(view.params).map(([name, value]) => this.row(name, symbols[name], value, range(value), units[name]));
    if (view.phase !== null) {
      const section = this.row(null, "phase of the section", view.phase, [0, 1], "periods");
      section.classList.add("section"); // apart from the parameters, of which one may be a phase too
      section.title = "Time within the period, as a fraction of it, at which initial conditions are given";
      rows.push(section);
    }
    this.place.replaceChildren(...rows);
    this.choose(0);
  }

  // Chooses the parameter that the keys of the page move: the one `by` rows further on, from the present one.
  choose(by) {
    const names = [...this.rows.keys()];
    const now = Math.max(0, names.indexOf(this.chosen));
    this.chosen = names[Math.min(names.length - 1, Math.max(0, now + by))];
    for (const [name, { slider }] of this.rows) slider.parentElement.classList.toggle("chosen", name === this.chosen);
  }

  use(name) {
    this.chosen = name;
    this.choose(0);
  }

  row(name, symbol, value, [low, high], unit = "") {
    const title = name ?? symbol;
    const row = document.createElement("div");
    row.className = "parameter";
    const id = `value-${name ?? "phase of the section"}`;
    const label = Object.assign(document.createElement("label"), { htmlFor: id });
    label.title = title;
    for (const part of symbol.split(/(?<=_)/)) label.append(part, document.createElement("wbr")); // where long names may break
    const heading = document.createElement("span");
    heading.append(label, Object.assign(document.createElement("span"), { className: "weak", textContent: unit && ` (${unit})` }));
    const slider = Object.assign(document.createElement("input"), { type: "range", min: low, max: high, step: "any" });
    slider.setAttribute("aria-label", `${title}, slider`);
    const number = Object.assign(document.createElement("input"), { type: "number", step: "any", id });
    const button = Object.assign(document.createElement("button"), { type: "button", className: "play", textContent: "▶" });
    button.title = "Play: moves to and fro (space)";
    button.setAttribute("aria-label", `Play ${title}`);
    button.ariaPressed = "false";
    button.addEventListener("click", () => this.play(name));
    slider.addEventListener("keydown", (event) => {
      const by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
      if (!by && event.key !== " ") return;
      event.preventDefault();
      if (by) this.step(name, by);
      else this.play(name);
    });
    slider.addEventListener("pointerdown", () => { this.stop(); this.use(name); });
    slider.addEventListener("focus", () => this.use(name));
    slider.addEventListener("input", () => {
      number.value = short(slider.valueAsNumber);
      this.changed(name, Number(number.value));
    });
    number.addEventListener("change", () => {
      if (!Number.isFinite(number.valueAsNumber)) return;
      this.stop();
      this.put(name, number.valueAsNumber);
      this.changed(name, number.valueAsNumber);
    });
    const ends = [low, high].map((end, k) => {
      const field = Object.assign(document.createElement("input"), { type: "text", inputMode: "decimal", className: "end", autocomplete: "off" });
      field.ariaLabel = `${title}, ${k ? "largest" : "least"} value of the slider`;
      field.title = `${k ? "Largest" : "Least"} value of the slider`;
      field.addEventListener("change", () => this.end(name, k, field));
      return field;
    });
    row.append(heading, ends[0], slider, ends[1], button, number);
    this.rows.set(name, { slider, number, button, ends, first: [low, high] });
    this.put(name, value);
    return row;
  }

  // Moves by hundredths of the range: sliders without steps leave the size of theirs to the browser.
  step(name, by) {
    const slider = this.rows.get(name)?.slider;
    if (!slider) return;
    this.stop();
    slider.valueAsNumber += (by * (slider.max - slider.min)) / 100;
    slider.dispatchEvent(new Event("input"));
  }

  // Takes an end of a range that was typed; the value stays within.
  end(name, k, field) {
    const row = this.rows.get(name);
    const ends = [...row.first];
    ends[k] = entered(field.value);
    if (!(ends[0] < ends[1])) return this.put(name, row.slider.valueAsNumber);
    row.first = ends;
    const value = Math.min(ends[1], Math.max(ends[0], row.number.valueAsNumber));
    const moved = value !== row.number.valueAsNumber;
    this.put(name, value);
    if (moved) this.changed(name, value);
    return undefined;
  }

  // Moves a parameter to and fro, and the phase around, until it is asked for again or something else moves it.
  play(name) {
    const row = this.rows.get(name);
    if (!row) return;
    this.use(name);
    const other = this.playing !== row;
    this.stop();
    if (!other) return;
    this.playing = row;
    row.button.textContent = "❚❚";
    row.button.ariaPressed = "true";
    let [before, way] = [performance.now(), 1];
    const step = (now) => {
      if (this.playing !== row) return;
      const { slider } = row;
      const [low, high] = [Number(slider.min), Number(slider.max)];
      const next = slider.valueAsNumber + (way * Math.max(0, now - before) * (high - low)) / LAP;
      before = now;
      if (name === null && next >= high) slider.valueAsNumber = next - (high - low);
      else slider.valueAsNumber = next;
      if (name !== null && (next >= high || next <= low)) way = next >= high ? -1 : 1;
      slider.dispatchEvent(new Event("input"));
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  stop() {
    if (!this.playing) return;
    this.playing.button.textContent = "▶";
    this.playing.button.ariaPressed = "false";
    this.playing = null;
  }

  put(name, value) {
    const { slider, number, ends, first } = this.rows.get(name);
    const range = rangeAt(value, first);
    [slider.min, slider.max] = range;
    slider.valueAsNumber = value;
    number.value = value;
    ends.forEach((field, k) => { field.value = short(range[k]); });
  }
}

// Fields for the axes of the image, their limits, and the values of the other coordinates.
export class Limits {
  constructor(place, changed) {
    this.place = place;
    this.changed = changed;
  }

  make(view, coordinates) {
    this.fields = [];
    const rows = view.axes.flatMap((j, k) => {
      const parts = ["lower", "upper"].map((end) => this.field(`${coordinates[j].symbol} ${end === "lower" ? "from" : "to"}`, end, k));
      return coordinates.length > 2 ? [this.chooser(view, coordinates, k), ...parts] : parts;
    });
    const rest = coordinates.map((_, j) => j).filter((j) => !view.axes.includes(j));
    rows.push(...rest.map((j) => this.field(`${coordinates[j].symbol} =`, "others", j)));
    this.place.replaceChildren(...rows);
    this.put(view);
  }

  chooser(view, coordinates, k) {
    const label = Object.assign(document.createElement("label"), { textContent: k ? "vertical " : "horizontal " });
    const select = document.createElement("select");
    select.append(...coordinates.map((c, j) => new Option(c.symbol, j, false, j === view.axes[k])));
    select.addEventListener("change", () => this.changed("axes", k, Number(select.value)));
    label.append(select);
    return label;
  }

  field(title, key, k) {
    const label = Object.assign(document.createElement("label"), { textContent: `${title} ` });
    const input = Object.assign(document.createElement("input"), { type: "text", className: "number", autocomplete: "off" });
    input.title = "A number, or a sum such as 0.3 + 4e-13";
    input.dataset.field = `${key}-${k}`;
    input.addEventListener("change", () => {
      const value = entered(input.value);
      input.ariaInvalid = String(!Number.isFinite(value));
      if (Number.isFinite(value)) this.changed(key, k, value);
    });
    this.fields.push({ input, key, k });
    label.append(input);
    return label;
  }

  put(view) {
    for (const { input, key, k } of this.fields) {
      if (document.activeElement === input) continue;
      input.value = key === "others" ? short(view.others[k]) : placed(view[key][k], view.lower[k], view.upper[k], 1e4);
      input.ariaInvalid = "false";
    }
  }
}

// Fills a select with values and their names.
export function choices(select, entries, value) {
  select.replaceChildren(...entries.map(([v, name]) => new Option(name, v, false, v === value)));
}

// Fills the list of systems: a name, and where the browser draws the list as the page says, a thumbnail and a sentence.
export function systems(select, entries) {
  const rich = window.CSS?.supports("appearance", "base-select");
  const options = entries.map(({ name, title, about, thumbnail }) => {
    const option = new Option("", name);
    if (!rich) {
      option.textContent = title;
      return option;
    }
    const image = Object.assign(document.createElement("img"), { alt: "", loading: "lazy" });
    if (thumbnail) image.src = thumbnail;
    const text = (className, textContent) => Object.assign(document.createElement("span"), { className, textContent });
    option.append(...(thumbnail ? [image] : []), text("name", title), text("about", about));
    return option;
  });
  const button = document.createElement("button");
  button.append(document.createElement("selectedcontent"));
  select.replaceChildren(...(rich ? [button] : []), ...options);
}
