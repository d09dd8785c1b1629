// The image of the present values: asked for, shown while it is refined, dimmed where it is that of others; films; questions.

import { remember } from "./address.js";
import { short } from "./numbers.js";
import { accuracy, news, noise, showAttractors } from "./report.js";
import { showLegend } from "./viewer.js";
import { Work } from "./work.js";

const OFTEN = 15; // milliseconds between two views that are sent: values in between are dropped here already
const SLOWLY = 150; // milliseconds between two tables of attractors
const KEPT = 200; // views whose images may still come

export class Live {
  // `state` has the view; `put()` shows its parameters, `put(name, value)` another one; `near()` is the place to begin at.
  constructor(state, connection, { $, names, put, near, redraw, changed, whole, caption }) {
    Object.assign(this, { state, connection, $, names, put, near, redraw, caption, done: whole });
    this.views = new Map(); // by the numbers of their requests
    this.newest = 0; // request of the image that was asked for last
    this.current = this.whole = false; // whether the picture is of it, and complete
    this.fresh = true; // the system has had no complete picture yet
    this.oldest = 0; // requests before this one belong to another system
    this.waiting = []; // for the complete image
    this.film = null; // request and view of one whose images are shown
    this.asking = null; // timer of the view that is sent next
    this.sent = this.listed = -Infinity; // when a view was sent, and a table made
    this.codes = {};
    this.again = changed;
    this.working = new Work($("band"));
    this.working.changed = () => this.dim();
    const lit = (event) => this.light(Number(event.target.closest("tr[data-identity]")?.dataset.identity ?? NaN));
    for (const [begin, end] of [["pointerover", "pointerleave"], ["focusin", "focusout"]]) {
      $("attractors").addEventListener(begin, lit);
      $("attractors").addEventListener(end, () => this.light(NaN));
    }
  }

  // Lights the basin of a row of the table, for none NaN.
  light(identity) {
    if (!this.picture || Object.is(this.picture.lit, identity)) return;
    this.picture.lit = identity;
    this.picture.repaint();
    this.redraw();
  }

  // Begins with another system.
  begin() {
    this.leaveFilm();
    this.views.clear();
    this.fresh = true;
    this.oldest = this.connection.number + 1;
    this.picture.clear();
    this.working.end();
  }

  // Asks for the image of values that have changed, soon.
  changed() {
    this.leaveFilm();
    this.$("preview").hidden = false;
    this.$("quality").textContent = "The image is a preview.";
    this.$("news").textContent = "";
    this.$("verdict").textContent = "";
    this.$("noise").hidden = true;
    if (!this.working.running || this.current) this.clock();
    this.current = this.whole = false;
    this.asking ??= setTimeout(() => this.send(), Math.max(0, this.sent + OFTEN - performance.now()));
  }

  clock() {
    const doing = this.fresh ? "compiling, and searching for attractors" : "computing the image";
    this.working.begin(doing, () => this.connection.cancel(this.newest));
  }

  send() {
    [this.asking, this.sent] = [null, performance.now()];
    const view = structuredClone(this.state.view);
    const anchors = this.fresh ? { anchors: this.state.anchors } : {};
    this.newest = this.connection.send({ type: "view", view, near: this.near(), caption: this.caption(), ...anchors });
    this.views.set(this.newest, view);
    for (const request of this.views.keys()) if (this.views.size > KEPT) this.views.delete(request);
    clearTimeout(this.later);
    this.later = setTimeout(() => remember(this.state), 250);
  }

  // Dims what is not of these values, once it has been there for long.
  dim() {
    const stale = !this.film && !this.current && (this.working.late || !this.working.running);
    for (const id of ["frame", "attractors"]) this.$(id).classList.toggle("stale", stale);
  }

  // Says why there is no image of these values.
  without(error) {
    for (const { reject } of this.waiting.splice(0)) reject(new Error("there is no image of these values"));
    this.current = false;
    this.working.end(error, error.cancelled ? this.again : null);
  }

  arrived(frame) {
    const { $ } = this;
    const view = this.film && frame.request === this.film.request ? this.ofFilm(frame) : this.views.get(frame.request);
    const drawn = () => this.connection.send({ type: "drawn", frame: frame.frame });
    if (frame.request < this.oldest || !view || (frame.film && !this.film)) {
      drawn();
      return;
    }
    this.picture.show(frame, view);
    this.redraw(() => {
      drawn();
      document.dispatchEvent(new CustomEvent("drawn", { detail: frame }));
    });
    const present = frame.request === this.newest && !this.film;
    if (present) {
      $("failure").textContent = "";
      [this.current, this.whole] = [true, frame.complete];
      if (frame.complete) this.working.end();
      else this.working.say("refining the image");
      this.dim();
    } else if (this.working.running) {
      this.clock();
    }
    if (frame.complete || performance.now() - this.listed > SLOWLY) {
      showAttractors($("attractors").tBodies[0], frame, this.codes);
      showLegend($("legend"), [
        ...frame.attractors.map((a) => ({ number: a.identity, name: a.name, fraction: a.fraction })),
        ...Object.entries(frame.others).map(([name, fraction]) => ({ number: this.codes[name], name, fraction })),
      ].slice(0, 12));
      this.listed = performance.now();
    }
    const told = frame.complete && news(frame, this.names);
    if (told && !this.fresh) $("news").textContent = told;
    if (present && frame.complete) this.completed(frame);
  }

  completed(frame) {
    const { $ } = this;
    $("preview").hidden = true;
    this.fresh = false;
    this.state.anchors = frame.attractors.map((a) => [a.identity, a.points[0]]);
    remember(this.state);
    this.done();
    for (const { resolve } of this.waiting.splice(0)) resolve();
    this.connection.ask({ type: "quality" }).then((quality) => {
      if (frame.request !== this.newest) return;
      $("quality").textContent = accuracy(quality, frame);
      const finer = quality.noise?.tolerance;
      const [text, button] = $("noise").children;
      text.textContent = noise(quality);
      $("noise").hidden = !quality.noise;
      button.hidden = !finer;
      button.textContent = `Tolerance ${finer?.toExponential()}`;
      button.onclick = () => { $("tolerance").value = finer; $("tolerance").dispatchEvent(new Event("change")); };
    }, () => {});
  }

  // --- films: while one is computed, its images are shown with their parameter, and the slider follows it

  beginFilm(request, view) {
    this.film = { request, view };
    this.working.end();
    this.current = this.whole = false;
    this.$("quality").textContent = "The image is one of a film.";
    this.dim();
  }

  ofFilm({ film: { number, of, values } }) {
    const reel = this.$("reel");
    reel.hidden = false;
    reel.textContent = `film: ${number} of ${of}, ${Object.entries(values).map(([name, v]) => `${name} = ${short(v)}`).join(", ")}`;
    for (const [name, value] of Object.entries(values)) this.put(name, value);
    return { ...this.film.view, params: { ...this.film.view.params, ...values } };
  }

  leaveFilm() {
    if (!this.film) return;
    this.film = null;
    this.$("reel").hidden = true;
    this.put();
  }

  endFilm(request) {
    if (this.film?.request === request) this.again();
  }

  // --- questions

  // Asks a question as a part of some work, which can be cancelled.
  ask(work, message, numbered = () => {}) {
    return this.connection.ask(message, (request) => {
      work.say(work.doing.textContent, () => this.connection.cancel(request));
      numbered(request);
    });
  }

  // Waits for the complete image.
  async complete(work) {
    const doing = work.doing.textContent;
    if (this.film) throw new Error("a film is being computed: wait for its end, or cancel it");
    if (!this.whole && !this.working.running) throw new Error("there is no image of these values");
    if (!this.whole) {
      await new Promise((resolve, reject) => {
        this.waiting.push({ resolve, reject });
        const cancelled = Object.assign(new Error("cancelled"), { cancelled: true });
        work.say("waiting for the complete image", () => reject(cancelled));
      });
    }
    work.say(doing, null);
  }

  // Asks about the complete image.
  async askOfImage(work, message, numbered) {
    await this.complete(work);
    return this.ask(work, message, numbered);
  }

  // Asks about the image, and shows the answer unless the image has changed meanwhile.
  async ofThisImage(work, message, show) {
    await this.complete(work);
    const before = this.newest;
    const answer = await this.ask(work, message);
    if (before !== this.newest || this.asking) return "the image has changed meanwhile: press it again";
    show(answer);
    this.redraw();
    return null;
  }
}
