// The pendulum or mass itself, beside the plane: what an orbit's state looks like.

import { fresh } from "./overlay.js";

const PULL = 0.8; // of half the width, as far as a mass moves

// Returns a function that draws a state on a canvas; null for systems without a picture.
export function pictureOf(system, states) {
  const angles = system.coordinates.flatMap((c, j) => (c.period ? [j] : []));
  const draw = { chain, rotors, mass, above }[system.drawnAs];
  if (!draw) return null;
  const reach = Math.max(1e-12, ...states.map((s) => Math.abs(s[0])));
  return (canvas, state, trail, pivot) => {
    const { context, width, height } = fresh(canvas);
    const style = getComputedStyle(canvas);
    context.translate(width / 2, height / 2);
    Object.assign(context, { strokeStyle: style.color, fillStyle: style.getPropertyValue("--one"), lineWidth: 2, lineCap: "round" });
    draw(context, { state, trail, angles, reach, half: 0.5 * Math.min(width, height), pivot: pivot ?? [0, 0], accent: style.getPropertyValue("--other"), line: style.getPropertyValue("--line") });
  };
}

function line(context, ...points) {
  context.beginPath();
  points.forEach(([x, y]) => context.lineTo(x, y));
  context.stroke();
}

function disc(context, [x, y], radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

// Pendulums, one below the other, each with its angle from the downward vertical.
function chain(context, { state, trail, angles, half, pivot, accent, line: pale }) {
  const rod = (0.85 * half) / (angles.length + Math.abs(pivot[0]) + 0.25);
  const joints = (s) => {
    const places = [[rod * pivot[0], -rod * pivot[1]]];
    for (const j of angles) {
      const [x, y] = places.at(-1);
      places.push([x + rod * Math.sin(s[j]), y + rod * Math.cos(s[j])]);
    }
    return places;
  };
  context.save();
  Object.assign(context, { strokeStyle: accent, lineWidth: 1, globalAlpha: 0.6 });
  line(context, ...trail.map((s) => joints(s).at(-1)));
  context.restore();
  const places = joints(state);
  context.save();
  context.strokeStyle = pale;
  line(context, [0, -rod * 0.3], [0, rod * 0.3]);
  context.restore();
  line(context, [places[0][0] - 9, places[0][1]], [places[0][0] + 9, places[0][1]]);
  line(context, ...places);
  for (const place of places.slice(1)) disc(context, place, Math.max(5, 0.09 * half));
}

function rotors(context, { state, angles, half }) {
  context.save();
  context.globalAlpha = 0.3;
  context.beginPath();
  context.arc(0, 0, 0.75 * half, 0, 2 * Math.PI);
  context.stroke();
  context.restore();
  angles.forEach((j) => {
    const place = [0.75 * half * Math.sin(state[j]), -0.75 * half * Math.cos(state[j])];
    line(context, [0, 0], place);
    disc(context, place, 6);
  });
}

// A mass on a spring.
function mass(context, { state, half, reach }) {
  const x = (PULL * half * state[0]) / reach;
  const size = 0.16 * half;
  line(context, [-half, size + 3], [half, size + 3]);
  const coil = Array.from({ length: 15 }, (_, k) => [-half + ((x - size + half) * k) / 14, k % 14 ? (k % 2 ? -1 : 1) * 0.35 * size : 0]);
  context.lineWidth = 1.2;
  line(context, ...coil);
  context.fillRect(x - size, -size, 2 * size, 2 * size);
}

function above(context, { state, trail, half, reach, accent }) {
  const far = Math.max(reach, 1e-12);
  const at = (s) => [(PULL * half * s[0]) / far, (-PULL * half * s[1]) / far];
  context.save();
  Object.assign(context, { strokeStyle: accent, lineWidth: 1 });
  line(context, ...trail.map(at));
  context.restore();
  disc(context, at(state), 7);
}
