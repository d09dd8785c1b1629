// The page of those who watch: the images of the explorer's page, with their system and values.

import { Connection, connect } from "./connection.js";
import { showSystem } from "./mathematics.js";
import { short } from "./numbers.js";
import { Viewer } from "./viewer.js";

const $ = (id) => document.getElementById(id);
let viewer = null;
let newest = 0; // image that came last
let system = "";

async function arrived(message) {
  const number = ++newest;
  const stream = new Blob([message.data]).stream().pipeThrough(new DecompressionStream("deflate"));
  const data = new Uint8Array(await new Response(stream).arrayBuffer());
  if (number !== newest) return;
  viewer ??= new Viewer(message.codes, message.lowest);
  viewer.codes = message.codes;
  viewer.show({ ...message, data }, message.view, message.system);
  $("title").textContent = document.title = message.title;
  $("sentence").textContent = message.caption;
  if (system !== JSON.stringify(message.system)) showSystem($("mathematics"), message.system);
  system = JSON.stringify(message.system);
  const { symbols, units } = message.system;
  const phase = message.view.phase ? [["phase of the section", message.view.phase]] : [];
  $("values").replaceChildren(...[...Object.entries(message.view.params), ...phase].flatMap(([name, value]) => [
    Object.assign(document.createElement("dt"), { textContent: symbols[name] ?? name }),
    Object.assign(document.createElement("dd"), { textContent: `${short(value)} ${units[name] ?? ""}`.trim() }),
  ]));
  $("state").textContent = message.complete ? "" : "preview";
  document.dispatchEvent(new CustomEvent("drawn", { detail: message }));
}

new Connection(connect, { shown: arrived }, (open, reason) => {
  if (!open) $("state").textContent = reason || "The connection was lost; trying again.";
});
