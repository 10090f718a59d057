// Programs that send movements: what each has sent so far, a line for each, and whether one is ignored.
import { byId, fill, make } from "../parts/elements.js";

const MOST = 10000; // samples that are kept of a movement, the last ones

/**
 * @typedef {{id: number, name: string, movement: number, samples: number[][], state: any, ended: any}} Source
 */

export class Sources {
  /** @param {(source: Source) => void} changed @param {() => void} fewer One is gone or ignored. */
  constructor(changed, fewer) {
    this.changed = changed;
    this.fewer = fewer;
    /** @type {Map<number, Source>} */
    this.known = new Map();
    /** @type {Set<string>} Names: a program that comes back stays ignored. */
    this.ignored = new Set();
  }

  /** @param {any} told By the server: what is new of one source. */
  hear(told) {
    if (told.gone) return this.forget(told.id);
    const known = this.known.get(told.id);
    const before = known?.movement === told.movement ? known.samples : [];
    const width = (before[0] ?? told.samples[0])?.length;
    const source = {
      ...told,
      samples: [...before, ...told.samples.filter((/** @type {number[]} */ one) => one.length === width)].slice(-MOST),
    };
    this.known.set(told.id, source);
    if (known?.name !== told.name) this.list();
    if (!this.ignored.has(source.name)) this.changed(source);
  }

  /** @param {number} id */
  forget(id) {
    this.known.delete(id);
    this.list();
    this.fewer();
  }

  /** The connection is new: the server tells of all that are there. */
  renewed() {
    this.known.clear();
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
    const focused = document.activeElement?.closest("#sources li")?.getAttribute("data-id");
    const line = (/** @type {Source} */ one) => {
      const off = this.ignored.has(one.name);
      const button = make(
        "button",
        {
          class: "button quiet",
          type: "button",
          "aria-pressed": String(off),
          "aria-label": `Ignore ${one.name}`,
          on: { click: () => this.ignore(one) },
        },
        off ? "Ignored" : "Ignore",
      );
      return make(
        "li",
        { "data-id": String(one.id), class: off ? "off" : "" },
        make("span", { class: "source-dot", "aria-hidden": "true" }),
        make("span", { class: "source-name" }, `Live source connected: ${one.name}`),
        button,
      );
    };
    fill(byId("sources"), ...[...this.known.values()].map(line));
    /** @type {HTMLElement} */ (byId("sources").querySelector(`[data-id="${focused}"] button`))?.focus();
  }
}
