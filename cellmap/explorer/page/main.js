// The page: its state, and what each part of it does when the state or an answer changes.

import { fitting, read, remember } from "./address.js";
import { Connection, connect } from "./connection.js";
import { Controls, Limits, choices } from "./controls.js";
import { Equations } from "./equations.js";
import { Gestures } from "./gestures.js";
import { download, keep, svg } from "./keeping.js";
import { Orbits } from "./orbits.js";
import { drawOverlay } from "./overlay.js";
import { Parts } from "./parts.js";
import { Picture } from "./picture.js";
import { Plane } from "./plane.js";
import { accuracy, certified, nameOf, news, showAttractors, showMeasures, showSaddles, verified } from "./report.js";
import { Range, Sweep } from "./sweep.js";

const $ = (id) => document.getElementById(id);
const state = { name: null, text: null, parts: null, system: null, view: null };
const views = new Map(); // by the numbers of their requests
const names = new Map();
let codes = {};
let picture = null;
let marked = { cross: null, box: null };
let open = null; // cells that a certificate has left open
let saddles = null; // with their stable manifolds
let oldest = 0; // requests before this one belong to another system
let asking = null; // timer of the view that is sent next
let sent = -Infinity; // when the last one was sent
let listed = -Infinity; // when the table of attractors was made
let drawing = false;

function fail(error) {
  $("failure").textContent = error?.message ?? String(error ?? "");
}

const connection = new Connection(connect, {
  hello: (message) => greeted(message).catch(fail),
  frame: (frame) => arrived(frame),
  error: (message) => { fail(message); },
}, (open, reason) => {
  $("state").textContent = open ? "" : reason || "The server cannot be reached; trying again.";
});

async function greeted(message) {
  codes = message.codes;
  picture ??= new Picture($("image"), message.lowest);
  sweep.lowest = message.lowest;
  choices($("system"), message.systems.map((s) => [s.name, s.title]), null);
  let asked = state.view ? state : null;
  try {
    asked ??= read(location.hash);
  } catch (error) {
    fail(error);
  }
  names.clear();
  if (asked && (asked.text || asked.parts || asked.name !== message.system.name)) await choose(asked, asked.view);
  else use(message.system, null, asked?.view);
}

// Asks for a system by its name, perhaps with parts, or by its text, and shows it at a view.
async function choose({ name, text, parts }, view) {
  const answer = await connection.ask({ type: "system", ...(text ? { text } : { name, parts }) });
  fail("");
  use(answer.system, answer.text ?? null, view);
}

function use(system, text, view) {
  Object.assign(state, { system, name: system.name, text, parts: system.scene?.parts ?? null });
  state.view = fitting(view ?? {}, system);
  document.querySelector("main").inert = false;
  parts.make(system.scene);
  if (text) $("text").value = text;
  $("system").value = text ? "" : system.name;
  gestures.forget();
  names.clear();
  views.clear();
  oldest = connection.number + 1;
  picture.clear();
  marked = { cross: null, box: null };
  for (const id of ["news", "quality", "here"]) $(id).textContent = "\u00a0";
  $("attractors").tBodies[0].replaceChildren();
  controls.make({ ...system.view, params: system.view.params });
  for (const [key, value] of Object.entries(state.view.params)) controls.put(key, value);
  if (state.view.phase !== null) controls.put(null, state.view.phase);
  limits.make(state.view, system.coordinates);
  sweep.make();
  plane.make();
  const own = (values, value) => [...new Set([...values, value])].sort((a, b) => a - b);
  choices($("cells"), own([125, 250, 500, 1000, 2000], state.view.cells[0]).map((n) => [n, n]), state.view.cells[0]);
  choices($("nodes"), own([0, 64, 128, 256, 512], state.view.nodes).map((n) => [n, n ? `${n} cells` : "exact"]), state.view.nodes);
  choices($("tolerance"), own([1e-3, 1e-4, 1e-6, 1e-9, 1e-12], state.view.tolerance).map((v) => [v, v.toExponential()]), state.view.tolerance);
  $("nodes").disabled = system.coordinates.length > 2;
  $("tolerance").disabled = !system.forced;
  changed();
}

const OFTEN = 15; // milliseconds between two views that are sent: values in between are dropped here already

function changed() {
  orbits.clear();
  open = saddles = null;
  for (const id of ["measures", "found"]) $(id).replaceChildren();
  limits.put(state.view);
  sweep.draw();
  plane.draw();
  $("preview").hidden = false;
  $("quality").textContent = "The image is a preview.";
  redraw();
  asking ??= setTimeout(askForView, Math.max(0, sent + OFTEN - performance.now()));
}

function askForView() {
  [asking, sent] = [null, performance.now()];
  const view = structuredClone(state.view);
  views.set(connection.send({ type: "view", view, near: marked.near ?? null }), view);
  for (const request of views.keys()) if (views.size > 200) views.delete(request);
  clearTimeout(changed.later);
  changed.later = setTimeout(() => remember(state), 250);
}

function arrived(frame) {
  const view = views.get(frame.request);
  if (frame.request >= oldest && view) {
    picture.show(frame, view);
    redraw(() => {
      connection.send({ type: "drawn", frame: frame.frame });
      document.dispatchEvent(new CustomEvent("drawn", { detail: frame }));
    });
    const newest = frame.request === Math.max(...views.keys());
    if (newest) fail("");
    if (frame.complete || performance.now() - listed > 150) {
      showAttractors($("attractors").tBodies[0], frame, codes);
      listed = performance.now();
    }
    if (frame.complete) {
      const told = news(frame, names);
      if (told) $("news").textContent = told;
      if (newest) $("preview").hidden = true;
      connection.ask({ type: "quality" }).then((q) => { $("quality").textContent = accuracy(q, frame); }, () => {});
    }
  } else {
    connection.send({ type: "drawn", frame: frame.frame });
  }
}

function redraw(then) {
  if (then) (redraw.after ??= []).push(then);
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    if (state.view && picture) {
      picture.draw(state.view);
      const attractors = picture.frame?.attractors ?? [];
      drawOverlay($("overlay"), { view: state.view, coordinates: state.system.coordinates, attractors, orbits: orbits.list, saddles, open, ...marked });
    }
    for (const act of (redraw.after ?? []).splice(0)) act();
  });
}

const controls = new Controls($("parameters"), (name, value) => {
  if (name === null) state.view.phase = value;
  else state.view.params[name] = value;
  changed();
});

// Parameters, window and phase stay where the parts that are exchanged leave them.
const parts = new Parts($("parts"), (chosen) => {
  const { params, phase, axes, lower, upper, others } = state.view;
  const same = chosen[0] === state.parts[0];
  choose({ name: state.name, parts: chosen }, same ? { params, phase, axes, lower, upper, others } : { params, phase })
    .catch((error) => { parts.make({ ...state.system.scene }); fail(error); });
});

function setParameters(values) {
  Object.assign(state.view.params, values);
  for (const [name, value] of Object.entries(values)) controls.put(name, value);
  changed();
}

const orbits = new Orbits({ section: $("orbits"), ends: $("ends"), series: $("series") });

const plane = new Plane(state, {
  ask: (message) => connection.ask(message),
  set: setParameters,
  nameOf: (number) => names.get(number) ?? `attractor ${number}`,
  elements: { canvas: $("plane"), shown: $("stable"), row: $("stable-row"), button: $("stability"), note: $("plane-note") },
});

const sweep = new Sweep(state, {
  ask: (message, numbered) => connection.ask(message, numbered),
  set: (name, value) => setParameters({ [name]: value }),
  elements: {
    canvas: $("bifurcations"), coordinate: $("coordinate"), first: new Range($("first-range")), second: new Range($("second-range")),
    stills: $("stills"), format: $("format"),
  },
});

const limits = new Limits($("limits"), (key, k, value) => {
  if (key === "axes") {
    const other = state.view.axes.indexOf(value);
    if (other >= 0) state.view.axes[other] = state.view.axes[k];
    for (const end of ["lower", "upper"]) {
      if (other >= 0) state.view[end].reverse();
      else state.view[end][k] = state.system.window[end][value];
    }
    state.view.axes[k] = value;
    limits.make(state.view, state.system.coordinates);
  } else if (key === "others") {
    state.view.others[k] = value;
  } else {
    gestures.remember();
    state.view[key][k] = value;
  }
  changed();
});

const gestures = new Gestures($("image"), {
  box: $("box"),
  get: () => state.view,
  set: (lower, upper) => {
    state.view.axes.forEach((j, k) => {
      const { period } = state.system.coordinates[j];
      const middle = (lower[k] + upper[k]) / 2;
      if (period && upper[k] - lower[k] > period) [lower[k], upper[k]] = [middle - period / 2, middle + period / 2];
    });
    Object.assign(state.view, { lower, upper });
    changed();
  },
  clicked: (place) => follow(place),
  pointed: (place, box = null, keyboard = false) => {
    const at = place && coordinatesAt(place);
    marked = { cross: keyboard ? place : null, box, near: at };
    const number = place && picture?.numberAt(...place);
    const where = at?.map((v, k) => `${state.system.coordinates[state.view.axes[k]].name} = ${Number(v.toPrecision(5))}`);
    $("here").textContent = number === null || number === undefined || !picture.frame
      ? "\u00a0" : `${where.join(", ")}: ${nameOf(number, picture.frame, codes)}`;
    redraw();
  },
});
gestures.reset = () => {
  const { axes } = state.view;
  gestures.change(...["lower", "upper"].map((end) => axes.map((j) => state.system.window[end][j])));
};

function coordinatesAt(place) {
  const { lower, upper } = state.view;
  return lower.map((a, k) => a + place[k] * (upper[k] - a));
}

async function follow(place) {
  try {
    orbits.add(await connection.ask({ type: "orbit", point: coordinatesAt(place) }), state.system.coordinates);
    redraw();
  } catch (error) {
    fail(error);
  }
}

async function downloadFile(type) {
  const file = await connection.ask({ type });
  download(file.name, new Blob([file.data], { type: file.media }));
}

// Asks about the image, and shows the answer unless the image has changed meanwhile.
async function ofThisImage(message, show) {
  const { view } = state;
  const request = Math.max(...views.keys());
  const answer = await connection.ask(message);
  if (view !== state.view || request !== Math.max(...views.keys())) return;
  show(answer);
  redraw();
}

const clicked = {
  back: () => gestures.back(),
  forward: () => gestures.forward(),
  reset: () => gestures.reset(),
  in: () => { gestures.remember(); gestures.zoom(0.5); },
  out: () => { gestures.remember(); gestures.zoom(2); },
  clear: () => { orbits.clear(); redraw(); },
  type: () => { $("equations").hidden = !$("equations").hidden; $("type").ariaExpanded = String(!$("equations").hidden); },
  verify: async () => {
    $("quality").textContent = "Verifying …";
    $("quality").textContent = verified(await connection.ask({ type: "verify" }));
  },
  certify: async () => {
    $("quality").textContent = "Certifying …";
    await ofThisImage({ type: "certify" }, (found) => { open = found; $("quality").textContent = certified(found); });
  },
  saddles: async () => {
    $("found").textContent = "Searching …";
    await ofThisImage({ type: "saddles", longest_period: Number($("longest").value) }, (found) => {
      saddles = { ...found, points: new Float32Array(found.data.slice().buffer) };
      showSaddles($("found"), saddles);
    }).catch((error) => { $("found").replaceChildren(); throw error; });
  },
  measure: () => ofThisImage({ type: "measures" }, ({ measures }) => showMeasures($("measures"), measures)),
  script: async () => download("basins.py", new Blob([(await connection.ask({ type: "script" })).text], { type: "text/x-python" })),
  hdf5: () => downloadFile("hdf5"),
  netcdf: () => downloadFile("netcdf"),
  svg: () => {
    if (!$("preview").hidden) throw new Error("image is a preview: ask again when it is complete");
    const text = svg($("image"), state.view, state.system.coordinates, picture.frame.attractors);
    download("basins.svg", new Blob([text], { type: "image/svg+xml" }));
  },
  keep: () => {
    const { name, text, parts: chosen, view } = structuredClone({ ...state, system: null });
    const title = [state.system.title, ...Object.entries(view.params).map(([k, v]) => `${k} = ${v}`)].join(", ");
    keep($("kept"), $("image"), title, () => choose({ name, text, parts: chosen }, view).catch(fail));
  },
  diagram: () => sweep.diagram(),
  stability: () => plane.compute(sweep.first.asked(), sweep.second.asked()),
  film: async () => {
    const view = structuredClone(state.view);
    $("preview").hidden = false;
    const file = await sweep.film(view, (request) => views.set(request, view));
    download(file.name, new Blob([file.data], { type: file.media }));
    changed();
  },
  png: () => $("image").toBlob((blob) => download("basins.png", blob)),
  link: async () => { remember(state); await navigator.clipboard.writeText(location.href); },
};
for (const [id, act] of Object.entries(clicked)) {
  $(id).addEventListener("click", async () => { try { await act(); } catch (error) { fail(error); } });
}
for (const key of ["nodes", "tolerance", "cells"]) {
  $(key).addEventListener("change", () => {
    const value = Number($(key).value);
    state.view[key] = key === "cells" ? state.view.cells.map(() => value) : value;
    changed();
  });
}
$("hatched").addEventListener("change", () => { picture.hatched = $("hatched").checked; picture.repaint(); redraw(); });
$("system").addEventListener("change", () => choose({ name: $("system").value }).catch(fail));
new Equations({ form: $("equations"), text: $("text"), mistake: $("mistake"), file: $("file") }, (text) => choose({ text }));

addEventListener("resize", () => { redraw(); sweep.draw(); plane.draw(); });
$("link").hidden = location.protocol === "about:"; // a notebook's address is not this page's
addEventListener("hashchange", () => {
  try {
    const asked = read(location.hash);
    if (asked) choose(asked, asked.view).catch(fail);
  } catch (error) {
    fail(error);
  }
});
