// Diagrams with scales, names and units: a frame with ticks, in which others draw.

import { axisName, ticks } from "./numbers.js";
import { apart, fresh } from "./overlay.js";

// Draws the frame of two axes, `{ lower, upper, symbol, unit }`, and returns where values are in it.
export function chart(canvas, x, y, { top = 0, bottom = null, bare = false } = {}) {
  const { context, width, height } = top ? sized(canvas) : fresh(canvas);
  const style = getComputedStyle(canvas);
  const size = parseFloat(style.fontSize);
  const [left, below] = [4.6 * size, bare ? 4 : 3.2 * size];
  const end = bottom ?? height;
  const inside = { left, top: top + 1.5 * size, right: width - 6, bottom: end - below };
  const across = (v) => inside.left + ((inside.right - inside.left) * (v - x.lower)) / (x.upper - x.lower || 1);
  const up = (v) => inside.bottom - ((inside.bottom - inside.top) * (v - y.lower)) / (y.upper - y.lower || 1);
  Object.assign(context, { font: `${size}px system-ui, sans-serif`, fillStyle: style.color, strokeStyle: style.getPropertyValue("--line"), lineWidth: 1 });
  context.strokeRect(inside.left - 0.5, inside.top - 0.5, inside.right - inside.left + 1, inside.bottom - inside.top + 1);
  const measured = (text) => context.measureText(text).width;
  if (!bare) {
    context.textAlign = "center";
    const marks = ticks(x.lower, x.upper, Math.max(2, (inside.right - inside.left) / (7 * size))).map(({ at, text }) => ({ place: across(at), text }));
    for (const { place } of marks) line(context, [place, inside.bottom], [place, inside.bottom + 4]);
    for (const { place, text } of apart(marks, measured, 0, width)) context.fillText(text, place, inside.bottom + 1.35 * size);
    context.fillText(axisName(x, x.lower, x.upper), (inside.left + inside.right) / 2, inside.bottom + 2.7 * size);
  }
  context.textAlign = "right";
  const rows = ticks(y.lower, y.upper, Math.max(2, (inside.bottom - inside.top) / (3.2 * size))).map(({ at, text }) => ({ place: up(at), text }));
  for (const { place } of rows) line(context, [inside.left - 4, place], [inside.left, place]);
  for (const { place, text } of apart(rows.reverse(), () => size, inside.top - size, inside.bottom + size, 2)) context.fillText(text, inside.left - 6, place + 0.35 * size);
  context.textAlign = "left";
  context.fillText(axisName(y, y.lower, y.upper), 2, inside.top - 0.5 * size);
  const fraction = (event) => {
    const box = canvas.getBoundingClientRect();
    return [(event.clientX - box.left - inside.left) / (inside.right - inside.left), (inside.bottom - event.clientY + box.top) / (inside.bottom - inside.top)];
  };
  return { context, across, up, inside, size, fraction, color: style.color };
}

function sized(canvas) {
  return { context: canvas.getContext("2d"), width: canvas.clientWidth, height: canvas.clientHeight };
}

export function line(context, ...points) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x, y));
  context.stroke();
}

// Returns the limits of some numbers, a little apart from them.
export function around(values, margin = 0.04) {
  let [lower, upper] = [Infinity, -Infinity];
  for (const v of values) {
    if (!Number.isFinite(v)) continue;
    if (v < lower) lower = v;
    if (v > upper) upper = v;
  }
  if (!(lower <= upper)) return { lower: 0, upper: 1 };
  const half = margin * (upper - lower) || Math.abs(upper) * 1e-3 || 1e-3;
  return { lower: lower - half, upper: upper + half };
}
