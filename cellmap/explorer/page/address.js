// The state in the page's address: a fragment, which is never sent to a server.

const SCHEMA = 1;
const LISTS = ["axes", "lower", "upper", "others", "cells"];
const MOST = 64; // attractors that keep their colours
const NUMBERS = ["phase", "nodes", "tolerance"];

export function written({ name, text, parts, view, anchors }) {
  const query = new URLSearchParams({ schema: SCHEMA });
  if (text) query.set("text", text);
  else query.set("system", name);
  if (parts) query.set("parts", parts.join(","));
  for (const key of LISTS) query.set(key, view[key].join(","));
  for (const key of NUMBERS) if (view[key] !== null) query.set(key, view[key]);
  for (const [key, value] of Object.entries(view.params)) query.set(`p.${key}`, value);
  for (const [number, point] of (anchors ?? []).slice(0, MOST)) query.set(`a.${number}`, point.map((v) => Number(v.toPrecision(8))).join(","));
  return `#${query}`;
}

// Writes the state into the address; a page in a frame of a notebook has none.
export function remember(state) {
  if (location.protocol !== "about:") history.replaceState(null, "", written(state));
}

// Returns the state of an address, null for one without; throws for one of another version.
export function read(fragment) {
  const query = new URLSearchParams(fragment.replace(/^#/, ""));
  if (!query.has("schema")) return null;
  if (query.get("schema") !== String(SCHEMA)) {
    throw new Error(`address: its state has the version ${query.get("schema")}, and this page reads version ${SCHEMA}`);
  }
  const view = { params: {} };
  for (const key of LISTS) if (query.has(key)) view[key] = query.get(key).split(",").map(Number);
  for (const key of NUMBERS) if (query.has(key)) view[key] = Number(query.get(key));
  for (const [key, value] of query) if (key.startsWith("p.")) view.params[key.slice(2)] = Number(value);
  const anchors = [...query].filter(([key]) => /^a\.\d{1,4}$/.test(key)).map(([key, value]) => [Number(key.slice(2)), value.split(",").map(Number)]);
  return { name: query.get("system"), text: query.get("text"), parts: query.get("parts")?.split(",") ?? null, view, anchors };
}

// Returns those of an address's points of attractors that are states of a system.
export function fittingAnchors(anchors, { coordinates }) {
  return (anchors ?? []).filter(([, point]) => point.length === coordinates.length && point.every(Number.isFinite)).slice(0, MOST);
}

// Returns the view of a system with what fits of another one: an address may say anything.
export function fitting(view, system) {
  const { view: own, coordinates } = system;
  const shape = (value) => [value === null, value?.length].join();
  const sound = ([key, value]) => shape(value) === shape(own[key]) && [value ?? []].flat().every(Number.isFinite)
    && (key !== "axes" || (value.every((j) => j in coordinates) && new Set(value).size === value.length));
  const known = Object.entries(view.params ?? {}).filter(([name, v]) => name in own.params && Number.isFinite(v));
  const rest = Object.entries(view).filter(([key]) => key in own && key !== "params").filter(sound);
  return { ...own, ...Object.fromEntries(rest), params: { ...own.params, ...Object.fromEntries(known) } };
}
