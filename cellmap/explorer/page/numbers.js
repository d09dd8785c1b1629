// Numbers as text, with the digits that a window needs, and the round numbers along an axis.

const NARROW = 1e-6; // of its numbers, is a window in which places are told from a number near by
const ROUNDING = 1e-3; // steps by which limits in narrow windows are beside round numbers

export const percent = (f) => `${(100 * f).toPrecision(3)} %`;

export const short = (value) => Number(value.toPrecision(6));

export function small(v) {
  if (v === null || v === undefined) return "–";
  const rounded = Number(v.toPrecision(3));
  return rounded !== 0 && Math.abs(rounded) < 1e-3 ? rounded.toExponential() : String(rounded);
}

// Returns a number with the digits in which a difference of `step` is seen.
export function shown(value, step) {
  if (!(Math.abs(value) >= step / 2)) return Number.isFinite(value) ? "0" : "–";
  const digits = Math.ceil(Math.log10(Math.abs(value) / step)) + 1;
  return String(Number(value.toPrecision(Math.min(17, Math.max(1, digits)))));
}

// Returns the number from which places between two limits are told, not above them: 0 unless these agree in many digits.
export function origin(lower, upper) {
  const [width, size] = [upper - lower, Math.max(Math.abs(lower), Math.abs(upper))];
  if (!(width > 0) || width > NARROW * size) return 0;
  const digits = Math.floor(Math.log10(size)) - Math.ceil(Math.log10(width)) + 1;
  const kept = Math.min(17, Math.max(1, digits));
  const near = Number(lower.toPrecision(kept));
  if (near <= lower) return near;
  return Number((near - 10 ** (Math.floor(Math.log10(size)) + 1 - kept)).toPrecision(kept));
}

// Returns a place between two limits with the digits of a part of their distance: 1.25, or 0.3 + 4.01e-13.
export function placed(value, lower, upper, parts = 1000) {
  const [from, step] = [origin(lower, upper), Math.abs(upper - lower) / parts];
  if (!from) return shown(value, step);
  const rest = shown(Math.abs(value - from), step);
  return rest === "0" ? String(from) : `${from} ${value < from ? "-" : "+"} ${rest}`;
}

// Returns the number that a text says, which may be a sum such as 0.3 + 4e-13; NaN for other texts.
export function entered(text) {
  const number = "\\d+\\.?\\d*(?:e[+-]?\\d+)?|\\.\\d+(?:e[+-]?\\d+)?";
  const match = text.replace("−", "-").match(new RegExp(`^\\s*([+-]?\\s*(?:${number}))\\s*(?:([+-]\\s*(?:${number})))?\\s*$`, "i"));
  return match ? Number(match[1].replaceAll(" ", "")) + Number((match[2] ?? "0").replaceAll(" ", "")) : NaN;
}

// Returns about `count` round numbers between two limits, each with a text that is relative to their origin.
export function ticks(lower, upper, count) {
  const from = origin(lower, upper);
  const [first, last] = [lower - from, upper - from];
  const power = 10 ** Math.floor(Math.log10((last - first) / count));
  const step = power * ([1, 2, 5].find((f) => f * power * count >= last - first) ?? 10);
  if (!(step > 0) || !Number.isFinite(step)) return [];
  const begin = Math.ceil(first / step - ROUNDING);
  const number = Math.min(Math.floor(last / step + ROUNDING) - begin + 1, 3 * count);
  return Array.from({ length: Math.max(0, number) }, (_, i) => {
    const value = Number(((begin + i) * step).toPrecision(12)) || 0;
    return { at: from + value, text: String(value) };
  });
}

// Returns the name of a coordinate at an axis between two limits, less their origin, with its unit.
export function axisName({ name, symbol = name, unit }, lower, upper) {
  const from = origin(lower, upper);
  const difference = from ? `${symbol} ${from < 0 ? "+" : "−"} ${Math.abs(from)}` : symbol;
  return unit ? `${difference} (${unit})` : difference;
}

// Returns why a window of some cells is none: floating-point numbers do not separate its cells, or do not reach so far.
export function impossible(lower, upper, cells) {
  for (const [k, a] of lower.entries()) {
    const size = Math.max(Math.abs(a), Math.abs(upper[k]));
    const gap = 2 ** (Math.floor(Math.log2(size || Number.MIN_VALUE)) - 52);
    if (!(size < 1e150)) return "farther out numbers have no squares: this is the largest window";
    if ((upper[k] - a) / cells[k] < 2 * Math.max(gap, 1e-290)) {
      return `closer in there are no numbers: those near ${shown(a, size / 1e4)} are ${small(gap)} apart, and this image has ${cells[k]} cells`;
    }
  }
  return "";
}
