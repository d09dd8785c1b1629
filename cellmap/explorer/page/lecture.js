// Lecture mode, and the keys of the whole page: L, the numbers of prepared views, space and arrows for a parameter.

const REST = 3000; // milliseconds after which a pointer that does not move is hidden

export class Lecture {
  // `prepared` has the views, `controls` the sliders; `changed()` is told that the layout has.
  constructor(button, { prepared, controls, changed }) {
    Object.assign(this, { button, prepared, controls, changed });
    button.addEventListener("click", () => this.toggle());
    addEventListener("keydown", (event) => this.key(event));
    addEventListener("fullscreenchange", () => { if (!document.fullscreenElement && this.full) this.toggle(false); });
    addEventListener("pointermove", () => this.awake());
  }

  get on() {
    return document.body.classList.contains("lecture");
  }

  // Begins or ends it; a browser may refuse the full screen, and the page is as large as its window then.
  async toggle(on = !this.on) {
    document.body.classList.toggle("lecture", on);
    this.button.ariaPressed = String(on);
    this.awake();
    this.changed();
    if (!on) {
      this.full = false;
      if (document.fullscreenElement) await document.exitFullscreen();
    } else if (document.fullscreenEnabled) {
      await document.documentElement.requestFullscreen().then(() => { this.full = true; }, () => {});
    }
  }

  awake() {
    document.body.classList.remove("resting");
    clearTimeout(this.timer);
    if (this.on) this.timer = setTimeout(() => document.body.classList.add("resting"), REST);
  }

  key(event) {
    const at = event.target;
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
    if (at.matches("textarea, select, input:not([type=range], [type=checkbox])")) return;
    const free = at === document.body;
    const number = /^[0-9]$/.test(event.key) ? (Number(event.key) + 9) % 10 : null;
    const act = {
      l: () => this.toggle(),
      Escape: this.on && (() => this.toggle(false)),
      PageDown: this.prepared.views.length && (() => this.prepared.step(1)),
      PageUp: this.prepared.views.length && (() => this.prepared.step(-1)),
      " ": (free || at.id === "image") && (() => this.controls.play(this.controls.chosen)),
      ArrowRight: free && (() => this.controls.step(this.controls.chosen, 1)),
      ArrowLeft: free && (() => this.controls.step(this.controls.chosen, -1)),
      ArrowDown: free && this.on && (() => this.controls.choose(1)),
      ArrowUp: free && this.on && (() => this.controls.choose(-1)),
    }[event.key.length === 1 ? event.key.toLowerCase() : event.key] ?? (number !== null && this.prepared.views.length && (() => this.prepared.show(number)));
    if (!act) return;
    event.preventDefault();
    act();
  }
}
