// Colours of attractors by their identities: those of the library's figures (cellmap.plot).

// Written from cellmap/plot/_colours.py by a test; codes: escaped, diverged, undecided, did not return, unlabelled, out of
// steps, doubtful, ended.
const COLOURS = ["#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#5C005C", "#0000B8", "#990A00", "#AD00FF", "#70F5AD", "#5C4770", "#A37AFF", "#C2E0FF", "#995233", "#523DCC", "#85B87A", "#700029", "#3D1485"];
const CODES = {"-1": [184, 184, 184], "-2": [115, 115, 115], "-3": [0, 0, 0], "-4": [61, 61, 61], "-5": [255, 255, 255], "-6": [107, 68, 35], "-7": [138, 138, 0], "-8": [187, 0, 136]};
const ENDED = -8;

export function colourOf(number) {
  if (number < 0) return CODES[Math.max(number, ENDED)].map((c) => Math.round(255 - (255 - c) * 0.7 ** Math.max(0, ENDED - number)));
  const value = parseInt(COLOURS[number % COLOURS.length].slice(1), 16);
  const paler = 0.55 ** Math.floor(number / COLOURS.length);
  return [value >> 16, (value >> 8) & 255, value & 255].map((c) => Math.round(255 - (255 - c) * paler));
}

export function css(number) {
  return `rgb(${colourOf(number).join(" ")})`;
}

// Whether a pixel is dark in the pattern of an attractor: lines of eight directions and distances, two of them dotted.
function dark(number, x, y) {
  const period = 8 + 4 * Math.floor((number % 32) / 8);
  const along = [x + y, x - y, y, x, x + 2 * y, 2 * x - y, x + y, x - y][number & 7];
  const line = ((along % period) + period) % period < 2;
  return (number & 7) < 6 ? line : line && ((x >> 1) & 1) === 0;
}

const PALE = 0.25; // of its colour is left to a basin beside one that is lit

// Fills the pixels of an image from its codes, which are numbers less `lowest`; `lit`: a number beside which others are pale.
export function paint(image, codes, lowest, hatched, lit = NaN) {
  const pixels = new Uint32Array(image.data.buffer);
  let last = 0;
  for (let i = 0; i < codes.length; i++) if (codes[i] > last) last = codes[i];
  const table = new Uint32Array(last + 1);
  for (let k = 0; k < table.length; k++) {
    const part = Number.isNaN(lit) || k + lowest === lit ? 1 : PALE;
    const [r, g, b] = colourOf(k + lowest).map((c) => Math.round(255 - part * (255 - c)));
    table[k] = (255 << 24) | (b << 16) | (g << 8) | r;
  }
  for (let i = 0; i < codes.length; i++) pixels[i] = table[codes[i]];
  if (!hatched) return;
  for (let i = 0; i < codes.length; i++) {
    const number = codes[i] + lowest;
    if (number >= 0 && dark(number, i % image.width, Math.floor(i / image.width))) {
      pixels[i] = (255 << 24) | ((pixels[i] >> 1) & 0x7f7f7f);
    }
  }
}
