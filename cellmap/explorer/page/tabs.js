// Tabs: one panel at a time, chosen by a click, the arrow keys, or by what has something to show there.

export class Tabs {
  constructor(list, changed) {
    this.tabs = [...list.children];
    this.changed = changed;
    for (const tab of this.tabs) tab.addEventListener("click", () => this.show(tab));
    list.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      const next = by && this.tabs[(this.tabs.indexOf(event.target) + by + this.tabs.length) % this.tabs.length];
      if (!next) return;
      event.preventDefault();
      this.show(next);
      next.focus();
    });
  }

  show(chosen) {
    for (const tab of this.tabs) {
      tab.ariaSelected = String(tab === chosen);
      tab.tabIndex = tab === chosen ? 0 : -1;
      document.getElementById(tab.getAttribute("aria-controls")).hidden = tab !== chosen;
    }
    this.changed();
  }

  // Shows the panel that an element is in.
  showWith(element) {
    const panel = element.closest("[role=tabpanel]");
    if (panel?.hidden) this.show(this.tabs.find((tab) => tab.getAttribute("aria-controls") === panel.id));
  }
}
