// What lies above the image: axes, attractors, orbits, the cross of the keyboard and the box that is being dragged.

import { around, chart } from "./chart.js";
import { css } from "./colours.js";
import { axisName, ticks } from "./numbers.js";

const ORBITS = ["#ffffff", "#ffe14d"];

// Sizes a canvas to the screen's pixels and returns its context, cleared, with its size in CSS pixels.
export function fresh(canvas) {
  const scale = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  const size = { width: Math.round(width * scale), height: Math.round(height * scale) };
  if (canvas.width !== size.width || canvas.height !== size.height) Object.assign(canvas, size);
  const context = canvas.getContext("2d");
  context.setTransform(scale, 0, 0, scale, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

// Returns where a state is in the window of a view, as fractions; angles in the period that begins with it.
export function placeIn(state, view, coordinates) {
  const share = (k) => {
    const j = view.axes[k];
    const { period } = coordinates[j];
    const turns = period ? Math.floor((state[j] - view.lower[k]) / period) : 0;
    return (state[j] - turns * (period ?? 0) - view.lower[k]) / (view.upper[k] - view.lower[k]);
  };
  return [share(0), view.axes.length < 2 ? 0.5 : share(1)];
}

export function drawOverlay(canvas, { view, coordinates, attractors, orbits, saddles, cross, box, open }) {
  const { context, width, height } = fresh(canvas);
  const along = (k, v) => (v - view.lower[k]) / (view.upper[k] - view.lower[k]);
  const at = (state) => {
    const [x, y] = placeIn(state, view, coordinates);
    return [x * width, (1 - y) * height];
  };
  const disc = (x, y, radius, fill) => {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = fill;
    context.fill();
    context.lineWidth = 1.2;
    context.strokeStyle = "#000";
    context.stroke();
  };
  if (open) {
    context.fillStyle = "#ff00ff";
    const size = Math.max(2, width / open.width);
    open.data.forEach((mark, k) => {
      if (mark) context.fillRect(((k % open.width) * width) / open.width, (Math.floor(k / open.width) * height) / open.height, size, size);
    });
  }
  if (saddles) drawSaddles(context, saddles, at, width, height);
  drawAxes(context, width, height, view, coordinates, along);
  for (const a of attractors) {
    const radius = a.points.length > 64 ? 1.5 : 4;
    for (const p of a.points) {
      const [x, y] = at(p);
      if (radius > 2) disc(x, y, radius + 2, "#fff");
      disc(x, y, radius, css(a.identity));
    }
  }
  orbits.forEach((orbit, k) => drawOrbit(context, orbit, at, coordinates, view, ORBITS[k % 2], disc));
  if (cross) {
    const [x, y] = [cross[0] * width, (1 - cross[1]) * height];
    context.strokeStyle = "#fff";
    context.lineWidth = 3;
    for (const style of ["#fff", "#000"]) {
      context.strokeStyle = style;
      context.beginPath();
      context.moveTo(x - 9, y); context.lineTo(x + 9, y);
      context.moveTo(x, y - 9); context.lineTo(x, y + 9);
      context.stroke();
      context.lineWidth = 1;
    }
  }
  if (box) {
    context.strokeStyle = "#000";
    context.setLineDash([4, 3]);
    const [[a, b], [c, d]] = box;
    context.strokeRect(a * width, (1 - b) * height, (c - a) * width, (b - d) * height);
    context.setLineDash([]);
  }
}

// Draws the manifolds of saddles as curves, stable ones black and unstable ones white, and the saddles as crosses.
function drawSaddles(context, { saddles, lengths, points }, at, width, height) {
  const strokes = (...styles) => styles.forEach(([size, style]) => {
    Object.assign(context, { lineWidth: size, strokeStyle: style });
    context.stroke();
  });
  const stable = 2 * lengths.stable.reduce((a, b) => a + b, 0);
  const curves = [[0, stable, "#fffc", "#000"], [stable, points.length, "#000c", "#fff"]];
  for (const [begin, end, back, front] of curves) {
    context.beginPath();
    let before = null;
    for (let k = begin; k < end; k += 2) {
      const [x, y] = at([points[k], points[k + 1]]);
      const near = before && Math.abs(x - before[0]) < width / 2 && Math.abs(y - before[1]) < height / 2;
      if (near) context.lineTo(x, y);
      else if (Number.isFinite(x)) context.moveTo(x, y);
      before = Number.isFinite(x) ? [x, y] : null;
    }
    strokes([2.8, back], [1.3, front]);
  }
  const cross = (x, y) => {
    context.moveTo(x - 5, y - 5); context.lineTo(x + 5, y + 5);
    context.moveTo(x - 5, y + 5); context.lineTo(x + 5, y - 5);
  };
  context.beginPath();
  for (const saddle of saddles) for (const state of saddle.points) cross(...at(state));
  strokes([5, "#fff"], [2.5, "#c00"]);
}

function drawOrbit(context, orbit, at, coordinates, view, colour, disc) {
  if (orbit.motion) {
    context.beginPath();
    let before = null;
    for (const state of orbit.motion.states) {
      const cut = before && view.axes.some((j) => coordinates[j].period && Math.abs(state[j] - before[j]) > coordinates[j].period / 2);
      const [x, y] = at(state);
      if (before && !cut) context.lineTo(x, y);
      else context.moveTo(x, y);
      before = state;
    }
    context.lineWidth = 2.5;
    context.strokeStyle = "#0008";
    context.stroke();
    context.lineWidth = 1;
    context.strokeStyle = colour;
    context.stroke();
  }
  orbit.strobe.forEach((state, n) => { if (state[0] !== null) disc(...at(state), n ? 2.5 : 5, colour); });
}

// Returns the labels, each with its place and text, that stand apart from those before them and end within a range.
export function apart(labels, size, from, to, gap = 6) {
  let end = from - gap;
  return labels.filter(({ place, text }) => {
    const half = size(text) / 2;
    if (place - half < end + gap || place + half > to) return false;
    end = place + half;
    return true;
  });
}

function drawAxes(context, width, height, view, coordinates, along) {
  const size = parseFloat(getComputedStyle(context.canvas).fontSize);
  context.font = `${size}px system-ui, sans-serif`;
  const label = (text, x, y) => {
    context.lineWidth = 0.3 * size;
    context.lineJoin = "round";
    context.strokeStyle = "#fffd";
    context.strokeText(text, x, y);
    context.fillStyle = "#000";
    context.fillText(text, x, y);
  };
  const measured = (text) => context.measureText(text).width;
  const [across, up] = view.axes.map((j, k) => axisName(coordinates[j], view.lower[k], view.upper[k]));
  const marks = ticks(view.lower[0], view.upper[0], Math.max(3, width / (8 * size))).map(({ at, text }) => ({ place: along(0, at) * width, text }));
  context.fillStyle = "#000";
  for (const { place } of marks) context.fillRect(place, height - 5, 1, 5);
  context.textAlign = "center";
  for (const { place, text } of apart(marks, measured, 12, width - measured(across) - 12)) label(text, place, height - 8);
  context.textAlign = "right";
  label(across, width - 5, height - 8);
  context.textAlign = "left";
  if (view.axes.length < 2) return;
  const rows = ticks(view.lower[1], view.upper[1], Math.max(3, height / (6 * size))).map(({ at, text }) => ({ place: (1 - along(1, at)) * height, text }));
  context.fillStyle = "#000";
  for (const { place } of rows) context.fillRect(0, place, 5, 1);
  for (const { place, text } of apart(rows.reverse(), () => size, 2 * size, height - 2 * size, 2)) label(text, 8, place + 0.35 * size);
  label(up, 6, 1.2 * size);
}

// Draws each coordinate of the orbits over time, in periods.
export function drawSeries(canvas, orbits, coordinates) {
  canvas.style.height = `${coordinates.length > 2 ? 80 * coordinates.length + 50 : 250}px`;
  const { height } = fresh(canvas);
  const style = getComputedStyle(canvas);
  const lines = orbits.map((o) => (o.motion ?? { times: o.strobe.map((_, n) => n), states: o.strobe }));
  const time = { lower: 0, upper: Math.max(1, ...lines.map((o) => o.times.at(-1))), symbol: "time", unit: "periods" };
  const names = 2.4 * parseFloat(style.fontSize);
  const row = (height - names) / coordinates.length;
  coordinates.forEach((c, j) => {
    const last = j === coordinates.length - 1;
    const place = { top: row * j || 1e-9, bottom: row * (j + 1) + (last ? names : 0), bare: !last };
    const { context, across, up } = chart(canvas, time, { ...around(lines.flatMap((o) => o.states.map((s) => s[j] ?? NaN))), ...c }, place);
    lines.forEach((o, k) => {
      context.beginPath();
      o.states.forEach((s, n) => {
        const jump = n && c.period && Math.abs(s[j] - o.states[n - 1][j]) > c.period / 2;
        if (s[j] === null) return;
        if (n && !jump) context.lineTo(across(o.times[n]), up(s[j]));
        else context.moveTo(across(o.times[n]), up(s[j]));
      });
      context.strokeStyle = style.getPropertyValue(k ? "--other" : "--one");
      context.lineWidth = 1.3;
      context.stroke();
    });
  });
}
