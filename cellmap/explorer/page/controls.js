// Sliders with number fields, and fields for the limits of the window.

// Returns the range of a slider around the value that a parameter has at first.
function range(value) {
  if (value === 0) return [-1, 1];
  return value > 0 ? [0, 2 * value] : [2 * value, 0];
}

const short = (value) => Number(value.toPrecision(6));

export class Controls {
  // `changed(name, value)` is called for parameters, with the name null for the phase.
  constructor(place, changed) {
    this.place = place;
    this.changed = changed;
    this.rows = new Map();
  }

  // Makes a row for each parameter, and one for the phase of a forced system.
  make(view) {
    this.rows.clear();
    const rows = Object.entries(view.params).map(([name, value]) => this.row(name, name, value, range(value)));
    if (view.phase !== null) rows.push(this.row(null, "phase of the section", view.phase, [0, 1]));
    this.place.replaceChildren(...rows);
  }

  row(name, title, value, [low, high]) {
    const row = document.createElement("div");
    row.className = "parameter";
    const id = `value-${name ?? "phase of the section"}`;
    const label = Object.assign(document.createElement("label"), { htmlFor: id });
    for (const part of title.split(/(?<=_)/)) label.append(part, document.createElement("wbr")); // where long names may break
    const slider = Object.assign(document.createElement("input"), { type: "range", min: low, max: high, step: "any" });
    slider.setAttribute("aria-label", `${title}, slider`);
    const number = Object.assign(document.createElement("input"), { type: "number", step: "any", id });
    slider.addEventListener("keydown", (event) => this.step(event, slider));
    slider.addEventListener("input", () => {
      number.value = short(slider.valueAsNumber);
      this.changed(name, Number(number.value));
    });
    number.addEventListener("change", () => {
      if (!Number.isFinite(number.valueAsNumber)) return;
      this.put(name, number.valueAsNumber);
      this.changed(name, number.valueAsNumber);
    });
    row.append(label, slider, number);
    this.rows.set(name, { slider, number });
    this.put(name, value);
    return row;
  }

  // Moves by a hundredth of the range with the arrows: sliders without steps leave the size of theirs to the browser.
  step(event, slider) {
    const sign = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (!sign) return;
    event.preventDefault();
    slider.valueAsNumber += (sign * (slider.max - slider.min)) / 100;
    slider.dispatchEvent(new Event("input"));
  }

  put(name, value) {
    const { slider, number } = this.rows.get(name);
    slider.min = Math.min(slider.min, value);
    slider.max = Math.max(slider.max, value);
    slider.valueAsNumber = value;
    number.value = value;
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
      const parts = ["lower", "upper"].map((end) => this.field(`${coordinates[j].name} ${end === "lower" ? "from" : "to"}`, end, k));
      return coordinates.length > 2 ? [this.chooser(view, coordinates, k), ...parts] : parts;
    });
    const rest = coordinates.map((_, j) => j).filter((j) => !view.axes.includes(j));
    rows.push(...rest.map((j) => this.field(`${coordinates[j].name} =`, "others", j)));
    this.place.replaceChildren(...rows);
    this.put(view);
  }

  chooser(view, coordinates, k) {
    const label = Object.assign(document.createElement("label"), { textContent: k ? "vertical " : "horizontal " });
    const select = document.createElement("select");
    select.append(...coordinates.map((c, j) => new Option(c.name, j, false, j === view.axes[k])));
    select.addEventListener("change", () => this.changed("axes", k, Number(select.value)));
    label.append(select);
    return label;
  }

  field(title, key, k) {
    const label = Object.assign(document.createElement("label"), { textContent: `${title} ` });
    const input = Object.assign(document.createElement("input"), { type: "number", step: "any" });
    input.dataset.field = `${key}-${k}`;
    input.addEventListener("change", () => {
      if (Number.isFinite(input.valueAsNumber)) this.changed(key, k, input.valueAsNumber);
    });
    this.fields.push({ input, key, k });
    label.append(input);
    return label;
  }

  put(view) {
    for (const { input, key, k } of this.fields) if (document.activeElement !== input) input.value = short(view[key][k]);
  }
}

// Fills a select with values and their names.
export function choices(select, entries, value) {
  select.replaceChildren(...entries.map(([v, name]) => new Option(name, v, false, v === value)));
}
