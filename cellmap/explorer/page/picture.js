// The basin image: the newest frame, drawn where its window lies in the present one, and what is under the pointer.

import { paint } from "./colours.js";

export class Picture {
  constructor(canvas, lowest) {
    this.canvas = canvas;
    this.lowest = lowest;
    this.hatched = false;
    this.lit = NaN; // number of the only basin in full colour
    this.buffer = document.createElement("canvas");
    this.frame = null;
  }

  // Takes a frame with the view that it was computed for.
  show(frame, view) {
    this.frame = { ...frame, view };
    const kind = frame.pixels === "uint8" ? Uint8Array : Uint16Array;
    this.codes = spread(new kind(frame.data.buffer, frame.data.byteOffset, frame.columns * frame.rows), frame);
    this.repaint();
  }

  repaint() {
    if (!this.frame) return;
    const { width, height } = this.frame;
    if (this.buffer.width !== width || this.buffer.height !== height) {
      Object.assign(this.buffer, { width, height });
      Object.assign(this.canvas, { width, height });
    }
    const context = this.buffer.getContext("2d");
    if (this.image?.width !== width || this.image.height !== height) this.image = context.createImageData(width, height);
    paint(this.image, this.codes, this.lowest, this.hatched, this.lit);
    context.putImageData(this.image, 0, 0);
  }

  clear() {
    this.frame = null;
    this.canvas.getContext("2d").clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  // Draws the frame into the window of a view: to the pixel where the windows agree, else stretched until a new one comes.
  draw(view) {
    if (!this.frame) return;
    const context = this.canvas.getContext("2d");
    const { width, height } = this.canvas;
    context.imageSmoothingEnabled = false;
    const [left, right] = place(this.frame.view, view, 0, width);
    const [bottom, top] = view.axes.length < 2 ? [0, height] : place(this.frame.view, view, 1, height);
    context.clearRect(0, 0, width, height);
    context.drawImage(this.buffer, left, height - top, right - left, top - bottom);
  }

  // Returns the number of the attractor, or the code, at a place of the frame given in fractions; null outside.
  numberAt(x, y) {
    if (!this.frame || x < 0 || x >= 1 || y < 0 || y >= 1) return null;
    const { width, height } = this.frame;
    return this.codes[Math.floor((1 - y) * height - 1e-9) * width + Math.floor(x * width)] + this.lowest;
  }
}

// Gives each pixel of an image the code of the coarse pixel in whose middle it lies.
export function spread(codes, { width, height, columns, rows, stride }) {
  if (columns === width && rows === height) return codes;
  const filled = new codes.constructor(width * height);
  const nearest = (i, count) => Math.min(Math.floor((i + (stride >> 1)) / stride), count - 1);
  const across = Array.from({ length: width }, (_, i) => nearest(i, columns));
  let before = -1;
  for (let y = 0; y < height; y++) {
    const row = rows - 1 - nearest(height - 1 - y, rows);
    if (row === before) filled.copyWithin(y * width, (y - 1) * width, y * width);
    else for (let x = 0; x < width; x++) filled[y * width + x] = codes[row * columns + across[x]];
    before = row;
  }
  return filled;
}

function place(from, to, k, size) {
  const span = to.upper[k] - to.lower[k];
  return [from.lower[k], from.upper[k]].map((v) => ((v - to.lower[k]) / span) * size);
}
