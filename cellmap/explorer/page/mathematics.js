// The equations of a system, typeset by the browser, with a sentence about it.

const MATHML = "http://www.w3.org/1998/Math/MathML";
const SHORT = 8; // lines that are shown at once

function formula(text) {
  const math = document.createElementNS(MATHML, "math");
  math.setAttribute("displaystyle", "true");
  math.innerHTML = text;
  return math;
}

// Shows what a system is, in a section with a sentence and a list of lines that can be folded.
export function showSystem(place, { about, equations }) {
  const [sentence, folded] = place.children;
  const [summary, lines] = folded.children;
  sentence.textContent = about;
  place.hidden = !about && !equations;
  folded.hidden = !equations;
  folded.open = equations?.length <= SHORT;
  summary.textContent = "Equations";
  // Each term is a formula of its own, so that long sums are continued on the next line.
  lines.replaceChildren(...(equations ?? []).map((terms) => {
    const line = document.createElement("p");
    line.append(...terms.flatMap((term) => [formula(term), " "]));
    return line;
  }));
}
