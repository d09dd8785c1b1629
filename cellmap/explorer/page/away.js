// What a page says when the server has ended: its view is kept, and goes with it to the address of the next one.

import { written } from "./address.js";

export class Away {
  constructor({ place, address: field, go, state }, view) {
    Object.assign(this, { place, state, lost: 0 });
    go.addEventListener("click", () => {
      const found = /^(http:\/\/(?:127\.0\.0\.1|localhost):\d+\/[\w-]+\/)/.exec(field.value.trim());
      if (found) location.assign(found[1] + written(view()));
      else this.state.textContent = "That is no address of an explorer: it begins with http://127.0.0.1:";
    });
    if (location.protocol === "about:") for (const element of [field, go]) element.closest(".row").hidden = true;
  }

  // Is told whether there is a connection, and why not.
  changed(open, reason) {
    this.lost = open ? 0 : this.lost + 1;
    this.place.hidden = this.lost < 2 || Boolean(reason);
    this.state.textContent = open ? "" : reason || (this.lost < 2 ? "The connection was lost; trying again." : "The server cannot be reached.");
  }
}
