// What is said of an image: the table of attractors, news, accuracy, and where orbits end.

import { around, chart, line } from "./chart.js";
import { css } from "./colours.js";
import { percent, small } from "./numbers.js";

// What names of labels mean, and what helps, where many initial conditions have them.
const MEANINGS = {
  escaped: "Escaped: orbits left the grid of the interpolated map; the exact map follows them further",
  diverged: "Diverged: orbits grew beyond all bounds, or the formulas have no value there; take another window or other parameters",
  undecided: "Undecided: orbits had not settled when they were given up; with weak damping they take long",
  "did not return": "Did not return: orbits have not come back to the section",
  unlabelled: "Unlabelled: there was no time for them; take fewer cells",
  "out of steps": "Out of steps: one period of these orbits needs more steps than the explorer allows; take a looser tolerance or a smaller window",
};
const MANY = 0.01;

function cells(identity, ...parts) {
  const row = document.createElement("tr");
  row.dataset.identity = identity;
  row.tabIndex = 0;
  for (const part of parts) {
    const cell = document.createElement("td");
    cell.append(part);
    row.append(cell);
  }
  return row;
}

function swatch(number) {
  const mark = Object.assign(document.createElement("span"), { className: "swatch" });
  mark.style.background = css(number);
  return mark;
}

export function showAttractors(body, frame, codes) {
  const error = (f) => (frame.complete ? ` ± ${(100 * Math.sqrt((f * (1 - f)) / (frame.width * frame.height))).toPrecision(1)}` : "");
  const rows = frame.attractors.map((a) => {
    const moduli = a.multipliers.map(([re, im]) => small(Math.hypot(re, im)));
    const sizes = moduli.length > 1 && moduli.every((m) => m === moduli[0]) ? `${moduli[0]} (${moduli.length})` : moduli.join(", ");
    const exponent = a.exponents.length ? `exponent ${small(a.exponents[0])}` : "";
    return cells(a.identity, swatch(a.identity), a.name, a.period ? String(a.period) : "–", sizes || exponent, percent(a.fraction) + error(a.fraction));
  });
  rows.push(...Object.entries(frame.others).map(([name, f]) => cells(codes[name], swatch(codes[name]), name, "", "", percent(f))));
  body.replaceChildren(...rows);
}

export function nameOf(number, frame, codes) {
  const known = frame.attractors.find((a) => a.identity === number);
  return known ? known.name : (Object.entries(codes).find(([, code]) => code === number)?.[0] ?? "");
}

// Returns the news of a complete frame as one sentence; `names` keeps the names of attractors that may be gone.
export function news(frame, names) {
  for (const a of frame.attractors) names.set(a.identity, a.name);
  const list = (numbers) => numbers.map((n) => names.get(n) ?? `attractor ${n}`).join("; ");
  const parts = [];
  if (frame.born.length) parts.push(`New: ${list(frame.born)}.`);
  if (frame.gone.length) parts.push(`Gone: ${list(frame.gone)}.`);
  return parts.join(" ");
}

export function accuracy(quality, frame) {
  const parts = [];
  if (quality.map === "interpolated") {
    parts.push(`Interpolated map, ${quality.nodes} cells along each axis`);
    parts.push(`error of a period ${small(quality.error.median)}, at most ${small(quality.error.largest)}`);
    if (quality.fallback) parts.push(`fallback cells ${percent(quality.fallback)}${quality.fallback > 0.5 ? " (take more cells, or the exact map)" : ""}`);
  } else {
    parts.push("Exact map");
  }
  if (quality.map !== "discrete") parts.push(`tolerance ${small(quality.tolerance)}`);
  parts.push(`undecided ${frame.others.undecided ? percent(frame.others.undecided) : "0 %"}`);
  const reasons = Object.entries(frame.undecided).map(([why, n]) => `${why} (${n})`);
  if (reasons.length) parts.push(reasons.join(", "));
  if (frame.inaccurate) parts.push(`${frame.inaccurate} initial conditions missed the tolerance`);
  if (quality.unknown_formulas) parts.push(`formulas unknown: ${quality.unknown_formulas}`);
  const { grown } = quality;
  for (const name of Object.keys(frame.others).filter((n) => frame.others[n] > MANY && n in MEANINGS)) {
    parts.push(name === "out of steps" && grown?.grown
      ? `Out of steps: orbits grow without bound (${grown.grown} of ${grown.followed} that were followed, to ${small(grown.reached)}) until a period needs more steps than the explorer allows; take other parameters`
      : MEANINGS[name]);
  }
  return `${parts.join("; ")}.`;
}

// Says of pixels that are finer than the map is accurate what helps; nothing of others.
export function noise({ noise: found }) {
  if (!found) return "";
  const wide = found.pixels < 1e4 ? small(found.pixels) : found.pixels.toExponential(0);
  const remedy = found.tolerance ? `take the tolerance ${found.tolerance.toExponential()}`
    : found.exact ? "no tolerance resolves this window: zoom out" : "take the exact map, or more cells for it";
  return `Noise: the error of the map is ${wide} pixels wide here; ${remedy}.`;
}

export function verified(v) {
  const rest = [v.excluded && `${v.excluded} escaped`, v.undecided && `${v.undecided} undecided`].filter(Boolean);
  return `${v.wrong} of ${v.compared} random labels differ from those of the exact map (between ${percent(v.low)} and `
    + `${percent(v.high)}, 95 % confidence)${rest.length ? `; ${rest.join(", ")}` : ""}.`;
}

export function ending(orbit) {
  const place = orbit.point.map((v) => Number(v.toPrecision(4))).join(", ");
  const after = orbit.settled === null ? "" : `, in its trapping region after ${orbit.settled} periods`;
  return `(${place}): ${orbit.name}${after}`;
}

export function certified(c) {
  return `Certified: ${c.redone} labels were recomputed with the exact map, ${c.changed} of them changed, ${c.open} are open`
    + `${c.open ? " (marked in the image)" : ""}; between ${percent(c.wrong[0])} and ${percent(c.wrong[1])} of the labels are `
    + "wrong, with 95 % confidence.";
}

// Lists saddles, with what is left out of their manifolds.
export function showSaddles(list, { saddles, lengths }) {
  const place = (p) => p.map((v) => (Math.abs(v) < 1e-12 ? 0 : Number(v.toPrecision(5)))).join(", ");
  const lines = saddles.map((s, k) => `${s.kind}, period ${s.period}, at (${place(s.points[0])}), |multipliers| `
    + `${s.multipliers.map(small).join(", ")}${lengths.stable[k] && lengths.unstable[k] ? "" : ": a manifold is left out, for want of time"}`);
  if (!saddles.length) lines.push("There is no saddle with a point in the window.");
  list.replaceChildren(...lines.map((text) => Object.assign(document.createElement("li"), { textContent: text })));
}

// Lists measures, each with its error, and its points and line where it is the slope of one.
export function showMeasures(list, measures) {
  list.replaceChildren(...measures.map((m) => {
    const item = document.createElement("li");
    item.append(m.reason ? `${m.name}: ${m.reason}` : `${m.name}: ${small(m.value)} ± ${small(m.error)}`);
    if (m.fit) item.append(Object.assign(document.createElement("canvas"), { className: "fit" }));
    return item;
  }));
  const fits = measures.filter((m) => m.fit).map((m) => m.fit);
  list.querySelectorAll("canvas").forEach((canvas, k) => drawFit(canvas, fits[k]));
}

function drawFit(canvas, { x, y, labels, window: [first, last], slope, intercept }) {
  const finite = (values) => around(values.map((v) => v ?? NaN), 0.06);
  const { context, across, up } = chart(canvas, { ...finite(x), symbol: labels[0] }, { ...finite(y), symbol: labels[1] });
  context.fillStyle = css(0);
  x.forEach((v, k) => { if (v !== null && y[k] !== null) context.fillRect(across(v) - 2, up(y[k]) - 2, 4, 4); });
  Object.assign(context, { strokeStyle: css(5), lineWidth: 1.5 });
  line(context, ...[x[first], x[last]].map((v) => [across(v), up(intercept + slope * v)]));
}
