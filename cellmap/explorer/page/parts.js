// A scene put together from parts: the choice of a body, and a switch for each effect.

import { choices } from "./controls.js";

export class Parts {
  // `chosen(parts)` is called with the body and the effects that are switched on.
  constructor(place, chosen) {
    this.place = place;
    this.chosen = chosen;
  }

  // Shows the parts of a scene, nothing for other systems.
  make(scene) {
    this.place.hidden = !scene;
    this.place.replaceChildren(Object.assign(document.createElement("legend"), { textContent: "Parts of the scene" }));
    if (!scene) return;
    const body = document.createElement("select");
    choices(body, scene.bodies.map((name) => [name, name]), scene.parts[0]);
    const boxes = scene.effects.map((name) => {
      const box = Object.assign(document.createElement("input"), { type: "checkbox", value: name });
      box.checked = scene.parts.includes(name);
      return box;
    });
    const tell = () => this.chosen([body.value, ...boxes.filter((box) => box.checked).map((box) => box.value)]);
    this.place.append(labelled("Body ", body), ...boxes.map((box) => labelled(box, ` ${box.value}`)));
    for (const element of [body, ...boxes]) element.addEventListener("change", tell);
  }
}

function labelled(...content) {
  const label = document.createElement("label");
  label.append(...content);
  return label;
}
