// A family of basins in one file: its images are unpacked once, and chosen by sliders.

import { showSystem } from "./mathematics.js";
import { short } from "./numbers.js";
import { Viewer } from "./viewer.js";

const $ = (id) => document.getElementById(id);
const PACE = 120; // milliseconds for which an image that plays is shown

const family = JSON.parse($("family").textContent);

// Returns the images, each of which is kept as its difference from the one before.
async function unpacked({ labels, pixels, shape: [count, height, width] }) {
  const packed = Uint8Array.from(atob(labels), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const codes = new (pixels === "uint8" ? Uint8Array : Uint16Array)(await new Response(stream).arrayBuffer());
  const size = width * height;
  for (let i = size; i < codes.length; i++) codes[i] ^= codes[i - size];
  return Array.from({ length: count }, (_, k) => codes.slice(k * size, (k + 1) * size));
}

function row({ name, values }, show) {
  const symbol = family.system.symbols[name] ?? name;
  const unit = family.system.units[name];
  const label = Object.assign(document.createElement("label"), { htmlFor: `slider-${name}`, textContent: symbol + (unit ? ` (${unit})` : "") });
  const slider = Object.assign(document.createElement("input"), { type: "range", id: `slider-${name}`, min: 0, max: values.length - 1, step: 1, value: Math.floor(values.length / 2) });
  const value = document.createElement("output");
  const play = Object.assign(document.createElement("button"), { type: "button", className: "play", textContent: "▶" });
  play.ariaLabel = `Play ${name}`;
  let [timer, way] = [null, 1];
  const stop = () => { clearInterval(timer); timer = null; play.textContent = "▶"; };
  play.addEventListener("click", () => {
    if (timer) return stop();
    play.textContent = "❚❚";
    timer = setInterval(() => {
      if (slider.valueAsNumber >= values.length - 1) way = -1;
      if (slider.valueAsNumber <= 0) way = 1;
      slider.valueAsNumber += way;
      told();
    }, PACE);
    return undefined;
  });
  const told = () => {
    value.textContent = short(values[slider.valueAsNumber]);
    slider.ariaValueText = `${name} = ${value.textContent}`;
    show();
  };
  slider.addEventListener("input", () => { stop(); told(); });
  const element = Object.assign(document.createElement("div"), { className: "parameter" });
  element.append(label, slider, play, value);
  return { element, slider, told };
}

async function begin() {
  const images = await unpacked(family);
  const viewer = new Viewer(family.codes, family.lowest);
  const [, height, width] = family.shape;
  $("title").textContent = document.title = family.title || family.system.title;
  showSystem($("mathematics"), family.system);
  const rows = family.parameters.map((parameter) => row(parameter, show));
  function show() {
    let place = 0;
    const params = { ...family.view.params };
    family.parameters.forEach(({ name, values }, k) => {
      const n = rows[k].slider.valueAsNumber;
      params[name] = values[n];
      place = place * values.length + n;
    });
    const frame = { width, height, columns: width, rows: height, stride: 1, pixels: family.pixels, data: images[place], attractors: family.attractors[place] };
    viewer.show(frame, { ...family.view, params }, family.system);
  }
  $("parameters").replaceChildren(...rows.map(({ element }) => element));
  for (const { told } of rows) told();
}

begin().catch((error) => { $("failure").textContent = `This browser cannot show the page: ${error.message}`; });
