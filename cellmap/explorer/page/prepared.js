// Views that were prepared for a lecture: numbered, with a title and a sentence each.

export class Prepared {
  // `open(asked, shownAt)` shows a system at a view.
  constructor({ list, caption }, open) {
    Object.assign(this, { list, caption, open, views: [], present: -1 });
  }

  make(views) {
    this.views = views;
    this.list.hidden = !views.length;
    this.list.replaceChildren(...views.map(({ title }, k) => {
      const button = Object.assign(document.createElement("button"), { type: "button", title });
      button.textContent = k + 1;
      button.ariaLabel = `View ${k + 1}${title && `: ${title}`}`;
      button.addEventListener("click", () => this.show(k));
      return button;
    }));
  }

  // Shows a view by its number from 0, and what is said of it.
  async show(number) {
    const chosen = this.views[number];
    if (!chosen) return;
    const { name, text, parts, view, title, sentence } = structuredClone(chosen);
    this.say(number, title, sentence);
    await this.open({ name, text, parts }, { view });
  }

  step(by) {
    this.show(Math.min(this.views.length - 1, Math.max(0, this.present + by)));
  }

  // Takes the caption away, where something else is shown.
  leave() {
    this.say(-1, "", "");
  }

  say(number, title, sentence) {
    this.present = number;
    const [heading, text] = this.caption.children;
    [heading.textContent, text.textContent] = [title, sentence];
    this.caption.hidden = !title && !sentence;
    [...this.list.children].forEach((button, k) => { button.ariaCurrent = String(k === number); });
  }

  // What watchers are told.
  get sentence() {
    return this.caption.hidden ? "" : [...this.caption.children].map((e) => e.textContent).filter(Boolean).join(". ");
  }
}
