// Work that takes time: what is being done, for how long, a button that ends it, and why it failed, beside what began it.

const SOON = 500; // milliseconds after which work is shown

function made(name, facts) {
  return Object.assign(document.createElement(name), facts);
}

export class Work {
  // `place` shows the work; `button`, if any, began it, and is busy meanwhile.
  constructor(place, button = null) {
    Object.assign(this, { place, button, running: false });
    this.doing = made("span", { role: "status" });
    this.clock = made("span", { className: "clock" });
    this.clock.ariaHidden = "true";
    this.ending = made("button", { type: "button", className: "cancel", textContent: "Cancel" });
    this.ending.addEventListener("click", () => this.cancel?.());
    this.why = made("span", { role: "alert", className: "why" });
    place.append(this.doing, this.clock, this.ending, this.why);
    place.classList.add("work");
    this.show(false);
  }

  // Returns the work that a button begins, which is shown below the row of the button.
  static of(button) {
    const place = document.createElement("div");
    if (button.closest("#tools")) button.after(place);
    else (button.closest("header")?.querySelector("#opening") ?? button.closest(".row, .parameter, label") ?? button).after(place);
    return new Work(place, button);
  }

  show(visible) {
    this.place.hidden = !visible && !this.why.textContent;
    this.doing.hidden = this.clock.hidden = !visible;
    this.ending.hidden = !visible || !this.cancel;
  }

  begin(doing, cancel = null) {
    clearInterval(this.timer);
    Object.assign(this, { running: true, cancel, late: false, since: performance.now() });
    this.doing.textContent = doing;
    this.why.textContent = "";
    this.ending.textContent = "Cancel";
    if (this.button) this.button.ariaBusy = "true";
    this.show(false);
    this.timer = setInterval(() => this.tick(), 100);
  }

  // Says what is being done now; at once where it began long ago.
  say(doing, cancel = this.cancel) {
    this.cancel = cancel;
    if (this.doing.textContent !== doing) this.doing.textContent = doing;
    if (this.late) this.show(true);
  }

  tick() {
    const passed = performance.now() - this.since;
    this.clock.textContent = `, ${Math.floor(passed / 1000)} s`;
    if (passed < SOON || this.late) return;
    this.late = true;
    this.show(true);
    this.changed?.();
  }

  // Ends it, well, or with an error that is told until it begins again, perhaps with a button that does so.
  end(error = null, again = null) {
    clearInterval(this.timer);
    Object.assign(this, { running: false, late: false, cancel: again });
    this.why.textContent = error ? capital(error.message ?? String(error)) : "";
    this.why.classList.toggle("failure", Boolean(error) && !error.cancelled);
    if (this.button) this.button.ariaBusy = "false";
    this.show(false);
    this.ending.hidden = !again;
    this.ending.textContent = "Compute again";
    this.changed?.();
  }

  // Says that it is done, where nothing else shows it.
  tell(text) {
    this.end({ message: text, cancelled: true });
  }

  // Does something that promises its end, unless it is being done.
  async run(doing, act) {
    if (this.running) return;
    this.begin(doing);
    try {
      const told = await act(this);
      if (typeof told === "string") this.tell(told);
      else this.end();
    } catch (error) {
      this.end(error);
    }
  }
}

const capital = (text) => text.slice(0, 1).toUpperCase() + text.slice(1);
