// Shapes of stretches of a recording: asked for once they are painted, and the one at the playhead, drawn large.
import { post } from "../parts/api.js";
import { Camera } from "../parts/camera.js";
import { Board, color } from "../parts/canvas.js";
import { byId, write } from "../parts/elements.js";
import { line, mark } from "../parts/lines.js";
import { colorOf } from "./strip.js";

const MOST = 200; // shapes in one question
const HELD = 4000;
const REST = 10; // of a stretch without a name, at most so much is drawn at once [s]

/** @typedef {{times: number[], path: number[][], flat?: number[][]}} Shape */

export class Shapes {
  /** @param {number} points Of each. @param {() => void} arrived */
  constructor(points, arrived) {
    this.points = points;
    this.arrived = arrived;
    /** @type {Map<string, Shape>} By begin and end. */
    this.known = new Map();
    /** @type {Map<string, {begin: number, end: number}>} */
    this.wanted = new Map();
    this.asking = false;
  }

  /** Of another recording, or of other channels. @param {string} key @param {any} body */
  open(key, body) {
    this.path = `/api/recordings/${encodeURIComponent(key)}/shapes`;
    this.body = { ...body, points: this.points };
    this.known.clear();
    this.wanted.clear();
  }

  /** The shape of a stretch, once the server has said it. @param {number} begin @param {number} end */
  of(begin, end) {
    const id = `${begin} ${end}`;
    if (!this.known.has(id)) {
      this.wanted.set(id, { begin, end });
      this.ask();
    }
    return this.known.get(id);
  }

  async ask() {
    if (this.asking) return;
    this.asking = true;
    await null; // all that is painted at once is one question
    const [asked, body] = [[...this.wanted].slice(-MOST), this.body];
    this.wanted.clear();
    const shapes = await post(this.path, { ...body, spans: asked.map(([, span]) => span) }).catch(() => []);
    this.asking = false;
    if (body === this.body) {
      if (this.known.size > HELD) this.known.clear();
      for (const [k, [id]] of asked.entries()) this.known.set(id, shapes[k] ?? { times: [], path: [] });
    }
    this.arrived();
  }
}

export class ShapeView {
  constructor() {
    this.shapes = new Shapes(400, () => this.board.draw());
    this.board = new Board(byId("shape"), () => this.paint());
    this.camera = new Camera();
    this.head = 0;
    /** @type {{begin: number, end: number, label: string|null, named: boolean}} Around the playhead. */
    this.around = { begin: 0, end: 0, label: null, named: false };
    /** @type {Shape|undefined} */
    this.shape = undefined;
  }

  /** @param {number} head [s] @param {import("./timeline.js").Span[]} spans @param {number} last [s] */
  goTo(head, spans, last) {
    const at = spans.find(({ begin, end }) => begin <= head && head <= end);
    let [begin, end] = at ? [at.begin, at.end] : [0, last];
    if (!at) {
      for (const span of spans) {
        if (span.end < head) begin = Math.max(begin, span.end);
        if (span.begin > head) end = Math.min(end, span.begin);
      }
      begin += REST * Math.floor((head - begin) / REST);
      end = Math.min(end, begin + REST);
    }
    this.head = head;
    this.around = { begin, end, label: at?.label ?? null, named: Boolean(at) };
    this.board.draw();
  }

  paint() {
    const { context, width, height } = this.board;
    const { begin, end, label, named } = this.around;
    const shape = this.shapes.of(begin, end) ?? this.shape;
    if (!shape?.path.length) return;
    if (shape !== this.shape || this.camera.size[0] !== width) {
      this.camera.face([shape.path]);
      this.camera.fit(shape.path, width, height);
      shape.flat = shape.path.map((point) => this.camera.toScreen(point));
      this.shape = shape;
    }
    const { times, flat } = shape;
    const k = Math.max(times.findIndex((time) => time > this.head) - 1, -1);
    const share = k < 0 ? 0 : (this.head - times[k]) / (times[k + 1] - times[k]);
    const near = k < 0 ? flat[this.head < times[0] ? 0 : flat.length - 1] : flat[k];
    const at = k < 0 ? near : near.map((value, axis) => value + share * (flat[k + 1][axis] - value));
    const paint = named ? colorOf(label) : color("--soft");
    line(context, flat, { color: paint, width: 2, alpha: 0.4 });
    const done = this.head < times[0] ? [] : k < 0 ? flat : flat.slice(0, k + 1);
    line(context, [...done, at], { color: paint, width: 4 });
    mark(context, at, "dot", 7, color("--text"));
    const name = named ? (label ?? "unknown") : "Nothing named here";
    write(byId("shape-name"), `${name}, ${begin.toFixed(2)} to ${end.toFixed(2)} s`);
  }
}
