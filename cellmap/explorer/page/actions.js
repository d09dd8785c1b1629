// The buttons of the page: what each does, how its work is called, and why it cannot be done where it cannot.

import { remember } from "./address.js";
import { download, keep, svg } from "./keeping.js";
import { certified, showMeasures, showSaddles, verified } from "./report.js";
import { Work } from "./work.js";

// Connects the buttons with a page, and returns `offer`, which enables what its present system and map allow.
export function actions(page) {
  const { $, state, live, gestures, sweep, plane, orbits, shown, redraw, open, tabs } = page;
  const verdict = (text) => { $("verdict").textContent = text; };
  const file = async (work, type) => {
    const { name, media, data } = await live.askOfImage(work, { type });
    download(name, new Blob([data], { type: media }));
  };
  const answered = (work) => (message) => live.askOfImage(work, message);

  const atOnce = {
    back: () => gestures.back(),
    forward: () => gestures.forward(),
    reset: () => gestures.reset(),
    in: () => { gestures.remember(); gestures.zoom(0.5); },
    out: () => { gestures.remember(); gestures.zoom(2); },
    html: () => {
      $("format").value = "html";
      tabs.showWith($("film"));
      $("film").click();
    },
    clear: () => { orbits.clear(); redraw(); },
    "first-values": () => page.reset(),
    type: () => { $("equations").hidden = !$("equations").hidden; $("type").ariaExpanded = String(!$("equations").hidden); },
  };
  for (const [id, act] of Object.entries(atOnce)) $(id).addEventListener("click", act);

  const lasting = {
    verify: ["verifying", (work) => live.ofThisImage(work, { type: "verify" }, (found) => verdict(verified(found)))],
    certify: ["certifying", (work) => live.ofThisImage(work, { type: "certify" }, (found) => {
      shown.open = found;
      verdict(certified(found));
    })],
    diagram: ["following the attractors", (work) => sweep.diagram(answered(work))],
    film: ["computing the images of the film", async (work) => {
      let request = null;
      const view = structuredClone(state.view);
      const asks = (message) => live.askOfImage(work, message, (number) => {
        request = number;
        live.beginFilm(number, view);
      });
      try {
        const { name, media, data } = await sweep.film(view, asks);
        download(name, new Blob([data], { type: media }));
      } finally {
        live.endFilm(request);
      }
    }],
    stability: ["following the attractors", (work) => plane.compute(sweep.first.asked(), sweep.second.asked(), answered(work))],
    saddles: ["searching for saddles", (work) => live.ofThisImage(work, { type: "saddles", longest_period: Number($("longest").value) }, (found) => {
      shown.saddles = { ...found, points: new Float32Array(found.data.slice().buffer) };
      showSaddles($("found"), shown.saddles);
      tabs.showWith($("found"));
    })],
    measure: ["measuring", (work) => live.ofThisImage(work, { type: "measures" }, ({ measures }) => showMeasures($("measures"), measures))],
    script: ["writing", async (work) => {
      const { text } = await live.askOfImage(work, { type: "script" });
      download("basins.py", new Blob([text], { type: "text/x-python" }));
    }],
    hdf5: ["writing", (work) => file(work, "hdf5")],
    netcdf: ["writing", (work) => file(work, "netcdf")],
    svg: ["drawing", async (work) => {
      await live.complete(work);
      const text = svg($("image"), state.view, state.system.coordinates, live.picture.frame.attractors);
      download("basins.svg", new Blob([text], { type: "image/svg+xml" }));
    }],
    png: ["drawing", () => $("image").toBlob((blob) => download("basins.png", blob))],
    keep: ["keeping", () => {
      const { name, text, parts, view, anchors } = structuredClone({ ...state, system: null });
      const title = [state.system.title, ...Object.entries(view.params).map(([k, v]) => `${k} = ${v}`)].join(", ");
      keep($("kept"), $("image"), title, () => open({ name, text, parts }, { view, anchors }));
    }],
    link: ["copying", async (work) => {
      await live.complete(work);
      remember(state);
      await navigator.clipboard.writeText(location.href).catch(() => { throw new Error("the browser does not allow it: copy the address of the page"); });
      return "copied: the address opens this view, with its colours";
    }],
  };
  const works = {};
  for (const [id, [doing, act]] of Object.entries(lasting)) {
    works[id] = Work.of($(id));
    $(id).addEventListener("click", () => works[id].run(doing, act));
  }
  $("link").hidden = location.protocol === "about:"; // a notebook's address is not this page's

  const why = {};
  // Enables a control, or disables it and says why.
  function allow(id, reason) {
    if (why[id] === reason) return;
    why[id] = reason;
    $(id).disabled = Boolean(reason);
    $(id).title = reason;
    works[id]?.tell(reason ? `${$(id).textContent}: ${reason}` : "");
  }

  function offer() {
    const { system, view } = state;
    const [dimension, parameters] = [system.coordinates.length, Object.keys(view.params).length];
    const flat = dimension === 2 ? "" : "it is for systems of two coordinates";
    $("back").disabled = !gestures.past.length;
    $("forward").disabled = !gestures.future.length;
    allow("certify", flat || (view.nodes ? "" : "the map is exact, and has no interpolation errors; choose a map of cells"));
    allow("saddles", flat);
    for (const id of ["diagram", "film", "html"]) allow(id, parameters ? "" : "the system has no parameter");
    allow("stability", parameters > 1 ? "" : "it is for systems of two parameters or more");
    allow("nodes", dimension > 2 ? "interpolated maps have at most two coordinates" : "");
    allow("tolerance", system.forced ? "" : "a discrete map is not integrated");
  }

  return { offer };
}
