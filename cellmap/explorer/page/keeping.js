// Views that are kept with a thumbnail, files that are saved, and the image as SVG.

import { css } from "./colours.js";
import { axisName, ticks } from "./numbers.js";

// Adds a button with a thumbnail of an image, which calls `back`.
export function keep(place, image, title, back) {
  const button = document.createElement("button");
  const thumbnail = Object.assign(document.createElement("canvas"), { width: 144, height: 144 });
  thumbnail.getContext("2d").drawImage(image, 0, 0, 144, 144);
  button.title = title;
  button.setAttribute("aria-label", `Back to ${title}`);
  button.append(thumbnail);
  button.addEventListener("click", back);
  place.append(button);
}

// Saves a file.
export function download(name, blob) {
  const link = Object.assign(document.createElement("a"), { download: name, href: URL.createObjectURL(blob) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const escaped = (text) => text.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

// Returns an image with axes and attractors as SVG; its pixels are embedded as PNG.
export function svg(image, view, coordinates, attractors) {
  const [left, bottom, size] = [60, 45, 500];
  const x = (v) => left + (size * (v - view.lower[0])) / (view.upper[0] - view.lower[0]);
  const y = (v) => size * (1 - (v - view.lower[1]) / (view.upper[1] - view.lower[1]));
  const flat = view.axes.length < 2;
  const name = (k) => escaped(axisName(coordinates[view.axes[k]], view.lower[k], view.upper[k]));
  const parts = [
    `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 -8 ${left + size + 10} ${size + bottom + 8}" font-family="sans-serif" font-size="13">`,
    `<image x="${left}" y="0" width="${size}" height="${size}" preserveAspectRatio="none" style="image-rendering:pixelated" href="${image.toDataURL()}"/>`,
    `<rect x="${left}" y="0" width="${size}" height="${size}" fill="none" stroke="#000"/>`,
  ];
  for (const { at, text } of ticks(view.lower[0], view.upper[0], 6)) {
    parts.push(`<path d="M${x(at)} ${size}v5" stroke="#000"/><text x="${x(at)}" y="${size + 18}" text-anchor="middle">${text}</text>`);
  }
  parts.push(`<text x="${left + size / 2}" y="${size + 38}" text-anchor="middle">${name(0)}</text>`);
  if (!flat) {
    for (const { at, text } of ticks(view.lower[1], view.upper[1], 6)) {
      parts.push(`<path d="M${left} ${y(at)}h-5" stroke="#000"/><text x="${left - 8}" y="${y(at) + 4}" text-anchor="end">${text}</text>`);
    }
    parts.push(`<text transform="translate(14 ${size / 2}) rotate(-90)" text-anchor="middle">${name(1)}</text>`);
  }
  for (const a of attractors) {
    for (const p of a.points) {
      const [u, w] = [x(p[view.axes[0]]), flat ? size / 2 : y(p[view.axes[1]])];
      if (u < left || u > left + size || w < 0 || w > size) continue;
      parts.push(`<circle cx="${u}" cy="${w}" r="${a.points.length > 64 ? 1 : 4}" fill="${css(a.identity)}" stroke="#fff"/>`);
    }
  }
  return `${parts.join("\n")}\n</svg>\n`;
}
