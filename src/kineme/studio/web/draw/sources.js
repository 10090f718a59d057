// Programs that send movements: what each has sent so far, a line for each, and whether one is ignored.
import { button, byId, fill, keepingFocus, make } from "../parts/elements.js";

const MOST = 10000; // samples that are held of a movement, the last ones

export class Sources {
  /** There are fewer where a program is gone or ignored. */
  constructor(changed, fewer) {
    this.changed = changed;
    this.fewer = fewer;
    this.hand = null; // takes what a camera sees
    /** @type {Map<number, Source>} */
    this.connected = new Map();
    this.ignored = new Set(); // names: a program that comes back stays ignored
  }

  /** Hear news of a source. @param {Source} news */
  hear(news) {
    if (news.gone) return this.forget(news.id);
    const before = this.connected.get(news.id);
    const samples = before?.movement === news.movement ? before.samples : [];
    const width = (samples[0] ?? news.samples[0])?.length;
    const added = news.samples.filter((sample) => sample.length === width);
    const source = { ...news, samples: [...samples, ...added].slice(-MOST) };
    this.connected.set(news.id, source);
    if (!before && news.name === "phone") byId("phone").close(); // its code has been scanned
    if (before?.name !== news.name) this.list();
    if (this.ignored.has(source.name)) return;
    this.changed(source);
    if (news.hand && news.hand.time !== before?.hand?.time) this.hand(news.hand);
  }

  forget(id) {
    this.connected.delete(id);
    this.list();
    this.fewer();
  }

  /** The connection is new: the server tells of all that it has; a gamepad is none of its. */
  renewed() {
    for (const id of this.connected.keys()) if (id >= 0) this.connected.delete(id);
    this.list();
  }

  /** @param {Source} source */
  ignore(source) {
    if (!this.ignored.delete(source.name)) this.ignored.add(source.name);
    this.list();
    if (this.ignored.has(source.name)) this.fewer();
    else this.changed(source);
  }

  list() {
    keepingFocus(() => fill(byId("sources"), ...[...this.connected.values()].map((source) => this.line(source))));
  }

  /** @param {Source} source */
  line(source) {
    const { id, name } = source;
    const off = this.ignored.has(name);
    return make(
      "li",
      off ? "off" : "",
      make("span", { class: "source-dot", "aria-hidden": "true" }),
      make("span", "source-name", `Live source connected: ${name}`),
      button(off ? "Ignored" : "Ignore", () => this.ignore(source), {
        ...{ class: "button quiet", "aria-pressed": String(off) },
        ...{ "data-key": `source ${id}`, "aria-label": `Ignore ${name}` },
      }),
    );
  }
}
