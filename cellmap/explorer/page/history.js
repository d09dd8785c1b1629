// Undo and redo of all that the page shows: system, parameters, phase, window, map.

const TOGETHER = 500; // milliseconds within which changes are one step, as while a slider is dragged
const LONGEST = 200; // steps

export class History {
  // `take()` returns the state that is shown; `restore(state)` shows another one, and may promise its end.
  constructor({ take, restore, undo, redo }) {
    Object.assign(this, { take, restore, past: [], future: [], present: null, going: false, when: -Infinity });
    this.buttons = [undo, redo];
    undo.addEventListener("click", () => this.undo());
    redo.addEventListener("click", () => this.redo());
    addEventListener("keydown", (event) => this.key(event));
    this.offer();
  }

  // Notes that the state has changed, or may have.
  note() {
    const now = this.take();
    if (this.present && !this.going && same(now, this.present)) return;
    const moment = performance.now();
    const [of, before] = [now, this.present ?? {}].map(({ name, text, parts }) => ({ name, text, parts }));
    if (this.present && !this.going) {
      if (moment - this.when > TOGETHER || !same(of, before)) this.past.push(this.present);
      this.past = this.past.slice(-LONGEST);
      this.future = [];
    }
    this.when = this.going || !this.present ? -Infinity : moment;
    this.present = { ...now, anchors: this.going ? this.present.anchors : [] };
    this.offer();
  }

  // Notes points of the attractors, whose colours come back with the state.
  colours(anchors) {
    if (this.present) this.present.anchors = anchors;
  }

  undo() { return this.go(this.past, this.future); }
  redo() { return this.go(this.future, this.past); }

  async go(from, to) {
    if (!from.length || this.going) return;
    to.push(this.present);
    this.present = from.pop();
    this.going = true;
    try {
      await this.restore(structuredClone(this.present));
    } finally {
      this.going = false;
      this.offer();
    }
  }

  offer() {
    this.buttons[0].disabled = !this.past.length;
    this.buttons[1].disabled = !this.future.length;
  }

  // Ctrl-Z and Ctrl-Y, or shift, control and Z; texts have an undo of their own.
  key(event) {
    if (!(event.ctrlKey || event.metaKey) || event.altKey || event.target.matches("textarea, [type=url]")) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    if (key === "y" || event.shiftKey) this.redo();
    else this.undo();
  }
}

function same(one, other) {
  const text = ({ anchors, ...rest }) => JSON.stringify(rest);
  return text(one) === text(other);
}
