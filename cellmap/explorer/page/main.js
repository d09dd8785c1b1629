// The page: its state, and what each part of it does when the state or an answer changes.

import { actions } from "./actions.js";
import { fitting, fittingAnchors, read } from "./address.js";
import { Away } from "./away.js";
import { Connection, connect } from "./connection.js";
import { Controls, Limits, choices, systems } from "./controls.js";
import { Equations } from "./equations.js";
import { Gestures } from "./gestures.js";
import { History } from "./history.js";
import { Lecture } from "./lecture.js";
import { Live } from "./live.js";
import { showSystem } from "./mathematics.js";
import { impossible, placed } from "./numbers.js";
import { Orbits } from "./orbits.js";
import { drawOverlay } from "./overlay.js";
import { Parts } from "./parts.js";
import { Picture } from "./picture.js";
import { Plane } from "./plane.js";
import { Prepared } from "./prepared.js";
import { nameOf } from "./report.js";
import { Range, Sweep } from "./sweep.js";
import { Tabs } from "./tabs.js";
import { showAt } from "./viewer.js";
import { Work } from "./work.js";

const $ = (id) => document.getElementById(id);
const state = { name: null, text: null, parts: null, system: null, view: null, anchors: [] };
const names = new Map();
const shown = { saddles: null, open: null }; // over the image: saddles with their manifolds, cells that a certificate left open
let tolerances = [];
let marked = { cross: null, box: null };
let drawing = false;

const [opening, windowing, following] = ["opening", "window-note", "following"].map((id) => new Work($(id)));

function fail(error) {
  $("failure").textContent = error?.message ?? String(error ?? "");
}

const away = new Away({ place: $("away"), address: $("next"), go: $("go"), state: $("state") }, () => state);
const connection = new Connection(connect, {
  hello: (message) => greeted(message).catch(fail),
  frame: (frame) => live.arrived(frame),
  error: (message) => {
    if (message.request !== null && message.request === live.newest) live.without(message);
    else if (!live.views.has(message.request)) fail(message);
  },
}, (open, reason) => {
  away.changed(open, reason);
  if (!open && state.view) live.without({ message: "there is no connection to the explorer" });
});

const live = new Live(state, connection, {
  $, names, redraw,
  put: (name, value) => (name ? controls.put(name, value) : putControls()),
  near: () => marked.near ?? null,
  changed: () => changed(),
  whole: () => history.colours(state.anchors),
  caption: () => prepared.sentence,
});

async function greeted(message) {
  tolerances = message.tolerances;
  live.picture ??= new Picture($("image"), message.lowest);
  sweep.lowest = message.lowest;
  systems($("system"), message.systems);
  prepared.make(message.views);
  let asked = state.view ? { ...state } : null;
  try {
    asked ??= read(location.hash);
  } catch (error) {
    fail(error);
  }
  names.clear();
  if (!asked && message.views.length) await prepared.show(0);
  else if (asked && (asked.text || asked.parts || asked.name !== message.system.name)) await choose(asked, asked);
  else use(message.system, null, asked ?? {});
}

// Asks for a system by its name, perhaps with parts, or by its text, and shows it at a view with points of attractors.
async function choose({ name, text, parts }, shownAt = {}) {
  opening.begin("opening the system");
  try {
    const answer = await live.ask(opening, { type: "system", ...(text ? { text } : { name, parts }) });
    fail("");
    use(answer.system, answer.text ?? null, shownAt);
  } finally {
    opening.end();
  }
}

// Does the same, and tells a failure beside the choice.
function open(asked, shownAt) {
  return choose(asked, shownAt).catch((error) => {
    if (state.system) $("system").value = state.text ? "" : state.name;
    opening.end(error);
  });
}

function use(system, text, { view = null, anchors = [] }) {
  live.begin();
  live.codes = system.codes;
  Object.assign(state, { system, name: system.name, text, parts: system.scene?.parts ?? null });
  Object.assign(state, { view: fitting(view ?? {}, system), anchors: fittingAnchors(anchors, system) });
  state.fit = system.fits && (!view?.cells || view.cells[0] === screenCells());
  if (state.fit) state.view.cells = state.view.cells.map(screenCells);
  document.querySelector("main").inert = false;
  parts.make(system.scene);
  if (text) $("text").value = text;
  $("system").value = text ? "" : system.name;
  gestures.forget();
  names.clear();
  marked = { cross: null, box: null };
  for (const id of ["news", "quality", "here"]) $(id).textContent = "\u00a0";
  $("attractors").tBodies[0].replaceChildren();
  showSystem($("mathematics"), system);
  controls.make(system.view, system.units, system.symbols);
  sweep.make();
  plane.make();
  showView();
  changed();
}

function putControls() {
  for (const [key, value] of Object.entries(state.view.params)) controls.put(key, value);
  if (state.view.phase !== null) controls.put(null, state.view.phase);
}

function changed() {
  orbits.clear();
  shown.open = shown.saddles = null;
  for (const id of ["measures", "found"]) $(id).replaceChildren();
  limits.put(state.view);
  sweep.named();
  sweep.draw();
  plane.draw();
  offer();
  redraw();
  live.changed();
  history.note();
}

const history = new History({
  undo: $("undo"), redo: $("redo"),
  take: () => {
    const { name, text, parts, view, fit } = state;
    return structuredClone({ name, text, parts, view: { ...view, cells: fit ? null : view.cells } });
  },
  restore: ({ name, text, parts, view, anchors }) => {
    if (JSON.stringify([name, text, parts]) !== JSON.stringify([state.name, state.text, state.parts])) {
      return open({ name, text, parts }, { view, anchors });
    }
    state.fit = view.cells === null;
    state.view = { ...view, cells: view.cells ?? state.view.cells.map(screenCells) };
    showView();
    return changed();
  },
});

// Returns the number of the screen's pixels along the image.
function screenCells() {
  return Math.max(125, Math.min(2000, Math.round($("frame").clientWidth * (window.devicePixelRatio || 1))));
}

// Shows the values of the view in all controls.
function showView() {
  const { system, view } = state;
  putControls();
  limits.make(view, system.coordinates);
  const own = (values, ...more) => [...new Set([...values, ...more])].sort((a, b) => a - b);
  const screen = screenCells();
  const cells = own([125, 250, 500, 1000, 2000], view.cells[0], screen).map((n) => [n, n === screen ? `${n} (screen)` : n]);
  choices($("cells"), cells, view.cells[0]);
  choices($("nodes"), own([0, 64, 128, 256, 512], view.nodes).map((n) => [n, n ? `${n} cells` : "exact"]), view.nodes);
  choices($("tolerance"), own(tolerances, view.tolerance).map((v) => [v, v.toExponential()]), view.tolerance);
}

function laidOut() {
  redraw();
  sweep.draw();
  plane.draw();
  orbits.show();
  clearTimeout(laidOut.later);
  laidOut.later = setTimeout(() => {
    if (!state.fit || state.view.cells[0] === screenCells()) return;
    state.view.cells = state.view.cells.map(screenCells);
    showView();
    changed();
  }, 200);
}

function redraw(then) {
  if (then) (redraw.after ??= []).push(then);
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    if (state.view) {
      live.picture.draw(state.view);
      const attractors = live.picture.frame?.attractors ?? [];
      drawOverlay($("overlay"), { view: state.view, coordinates: state.system.coordinates, attractors, orbits: orbits.list, ...shown, ...marked });
    }
    for (const act of (redraw.after ?? []).splice(0)) act();
  });
}

// --- parameters, parts, panes

const tabs = new Tabs($("tabs"), () => { sweep.draw(); plane.draw(); orbits.show(); });
const prepared = new Prepared({ list: $("views"), caption: $("caption") }, (asked, shownAt) => open(asked, shownAt));
const controls = new Controls($("parameters"), (name, value) => {
  if (name === null) state.view.phase = value;
  else state.view.params[name] = value;
  changed();
});

const lecture = new Lecture($("lecture"), { prepared, controls, changed: laidOut });

// Parameters, window and phase stay where the parts that are exchanged leave them.
const parts = new Parts($("parts"), (chosen) => {
  const { params, phase, axes, lower, upper, others } = state.view;
  const same = chosen[0] === state.parts[0];
  const view = same ? { params, phase, axes, lower, upper, others } : { params, phase };
  choose({ name: state.name, parts: chosen }, { view }).catch((error) => {
    parts.make({ ...state.system.scene });
    opening.end(error);
  });
});

function setParameters(values) {
  Object.assign(state.view.params, values);
  for (const [name, value] of Object.entries(values)) controls.put(name, value);
  changed();
}

const orbits = new Orbits($, state, {
  following, redraw, opened: () => tabs.showWith($("motion")),
  ask: (point, work = null) => (work ? live.ask(work, { type: "orbit", point }) : connection.ask({ type: "orbit", point })),
});

const plane = new Plane(state, {
  set: setParameters, nameOf: (number) => names.get(number) ?? `attractor ${number}`,
  elements: { canvas: $("plane"), shown: $("stable"), row: $("stable-row"), note: $("plane-note"), scale: $("scale") },
});

const sweep = new Sweep(state, {
  set: (name, value) => setParameters({ [name]: value }),
  elements: {
    canvas: $("bifurcations"), coordinate: $("coordinate"), first: new Range($("first-range")), second: new Range($("second-range")),
    stills: $("stills"), format: $("format"), button: $("film"),
  },
});

// --- the window

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
  windowing.end();
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
    const why = impossible(lower, upper, state.view.cells);
    windowing.end(why ? { message: why } : null);
    if (why) return;
    Object.assign(state.view, { lower, upper });
    changed();
  },
  clicked: (place) => orbits.follow(coordinatesAt(place)),
  held: (place) => (state.view ? orbits.held(place, $("frame").getBoundingClientRect()) : null),
  pulled: (orbit, place) => orbits.pull(orbit, coordinatesAt(place)),
  pointed: (place, box = null, keyboard = false) => {
    const at = place && coordinatesAt(place);
    marked = { cross: keyboard ? place : null, box, near: at };
    const number = place && live.picture?.numberAt(...place);
    for (const row of $("attractors").tBodies[0].rows) row.classList.toggle("lit", Number(row.dataset.identity) === number);
    const { axes, lower, upper } = state.view;
    const where = at?.map((v, k) => `${state.system.coordinates[axes[k]].symbol} = ${placed(v, lower[k], upper[k])}`);
    const name = number === null || number === undefined || !live.picture.frame ? null : nameOf(number, live.picture.frame, live.codes);
    $("here").textContent = name === null ? "\u00a0" : `${where.join(", ")}: ${name}`;
    showAt($("pointer"), lecture.on && !box ? name : null, place ?? []);
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

// --- buttons

const { offer } = actions({
  $, state, live, gestures, sweep, plane, orbits, shown, redraw, open, tabs,
  reset: () => {
    const { params, phase } = state.system.view;
    Object.assign(state.view, { params: { ...params }, phase });
    putControls();
    changed();
  },
});

for (const key of ["nodes", "tolerance", "cells"]) {
  $(key).addEventListener("change", () => {
    const value = Number($(key).value);
    state.view[key] = key === "cells" ? state.view.cells.map(() => value) : value;
    if (key === "cells") state.fit = value === screenCells();
    changed();
  });
}
$("hatched").addEventListener("change", () => { live.picture.hatched = $("hatched").checked; live.picture.repaint(); redraw(); });
$("system").addEventListener("change", () => { prepared.leave(); open({ name: $("system").value }); });
new Equations({ form: $("equations"), text: $("text"), mistake: $("mistake"), file: $("file") }, (text) => choose({ text }));

addEventListener("resize", laidOut);
addEventListener("hashchange", () => {
  try {
    const asked = read(location.hash);
    if (asked) open(asked, asked);
  } catch (error) {
    fail(error);
  }
});
