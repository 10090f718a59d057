// The recording over time: its columns, what was found, and the edges of the span that is chosen.
import { Board, color } from "../parts/canvas.js";
import { drag } from "../parts/dragging.js";
import { byId, make } from "../parts/elements.js";
import { COLORS } from "../parts/library_state.js";
import { line } from "../parts/lines.js";
import { flattened } from "../parts/thumbnails.js";
import { Shapes } from "./shapes.js";
import { signal } from "./signal.js";
import { BY_HAND } from "./spans.js";
import { colorOf, lanesOf, paintLanes } from "./strip.js";

const BAND = 40; // height of the spans [px]
const SHAPE = 72; // height of the shapes above them
const SIDE = 12;
const AXIS = 22;

/** @typedef {{begin: number, end: number, label: string|null, p: number|null, confidence?: number|null}} Span */

/**
 * @typedef {Object} Page
 * @property {(k: number) => void} choose
 * @property {() => void} add
 * @property {(k: number) => void} remove
 * @property {() => void} changed By the person.
 * @property {(time: number) => void} seek
 * @property {(event: KeyboardEvent) => void} key For the playhead.
 */

export class Timeline {
  /** @param {Page} page */
  constructor(page) {
    this.page = page;
    this.plot = { times: [0, 1], columns: [] };
    /** @type {Span[]} */
    this.spans = [];
    this.chosen = -1;
    this.range = [0, 1];
    this.head = 0; // where the playhead is [s]
    this.board = new Board(byId("timeline-canvas"), () => this.paint());
    this.shapes = new Shapes(64, () => this.board.draw());
    /** @type {WeakMap<Span, import("./shapes.js").Shape>} The last one of each span. */
    this.last = new WeakMap();
    this.playhead = make("div", { class: "playhead", "aria-hidden": "true" });
    byId("edges").append(this.playhead);
    this.edges = ["begin", "end"].map((which) => this.edge(/** @type {"begin"|"end"} */ (which)));
    this.board.canvas.addEventListener("pointerdown", (event) => this.grab(event));
    this.board.canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    this.board.canvas.addEventListener("keydown", (event) => this.key(event));
    this.board.canvas.addEventListener("dblclick", () => (this.chosen < 0 ? this.page.add() : this.name()));
    this.board.canvas.tabIndex = 0;
  }

  /** @param {any} plot */
  show(plot) {
    this.plot = plot;
    this.extent = [plot.times[0] ?? 0, plot.times[plot.times.length - 1] ?? 1];
    this.range = [...this.extent];
    this.chosen = -1;
    this.board.fit();
    this.board.draw();
  }

  x(/** @type {number} */ time) {
    return SIDE + ((time - this.range[0]) / (this.range[1] - this.range[0])) * (this.board.width - 2 * SIDE);
  }

  time(/** @type {number} */ x) {
    return this.range[0] + ((x - SIDE) / (this.board.width - 2 * SIDE)) * (this.range[1] - this.range[0]);
  }

  paint() {
    const { context, height } = this.board;
    const lane = height - BAND - AXIS - 12 - (this.spans.length ? SHAPE : 0);
    for (const [k, span] of this.spans.entries()) this.paintSpan(span, k);
    paintLanes(context, this.spans, (time) => this.x(time), [height - BAND - AXIS, BAND - 4], this.chosen);
    const x = this.plot.times.map((/** @type {number} */ time) => this.x(time));
    this.plot.columns.forEach((/** @type {any} */ column, /** @type {number} */ k) => {
      const look = { color: color(column.color ?? COLORS[k % COLORS.length]), width: 1.4 };
      signal(context, x, column.values, [8, 8 + lane], look);
    });
    this.paintAxis();
    this.placeEdges();
    this.placeHead();
  }

  /** @param {Span} span @param {number} k */
  paintSpan(span, k) {
    const { context, height } = this.board;
    const [x, w] = [this.x(span.begin), Math.max(this.x(span.end) - this.x(span.begin), 2)];
    const paint = colorOf(span.label);
    const top = height - BAND - AXIS - SHAPE;
    Object.assign(context, { fillStyle: paint, globalAlpha: k === this.chosen ? 0.2 : 0.09 });
    context.fillRect(x, 0, w, top + SHAPE);
    context.globalAlpha = 1;
    const shape = w < 14 || x + w < 0 || x > this.board.width ? undefined : this.shapes.of(span.begin, span.end);
    if (shape) this.last.set(span, shape); // while an edge is dragged it is the one before
    const drawn = shape ?? this.last.get(span);
    if (!drawn?.path.length) return;
    drawn.flat ??= flattened(drawn.path);
    const scale = Math.min(w - 2, SHAPE) / 100;
    const place = ([a, b]) => [x + w / 2 + scale * (a - 50), top + SHAPE / 2 + scale * (b - 50)];
    line(context, drawn.flat.map(place), { color: paint, width: 2 });
  }

  paintAxis() {
    const { context, width, height } = this.board;
    const raw = (this.range[1] - this.range[0]) / Math.max(width / 90, 2);
    const ten = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map((m) => m * ten).find((s) => s >= raw) ?? raw;
    Object.assign(context, { font: `12px ${color("--font")}`, textAlign: "center", fillStyle: color("--soft") });
    for (let t = Math.ceil(this.range[0] / step) * step; t <= this.range[1]; t += step) {
      if (this.x(t) < SIDE || this.x(t) > width - SIDE - 8) continue;
      context.fillText(`${Number(t.toPrecision(6))}`, this.x(t), height - 6);
    }
    context.textAlign = "right";
    context.fillText("s", width - 4, height - 6);
  }

  /** @param {"begin"|"end"} which */
  edge(which) {
    const button = make("button", {
      class: "edge",
      type: "button",
      role: "slider",
      hidden: true,
      "data-key": `edge ${which}`,
    });
    const go = (/** @type {PointerEvent} */ now) =>
      this.moveEdge(which, this.time(now.clientX - this.board.canvas.getBoundingClientRect().left));
    button.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
      if (!drag(button, event, go, () => this.page.changed())) return;
      event.preventDefault();
      button.focus({ preventScroll: true });
    });
    button.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -1, ArrowUp: 1 }[event.key];
      if (!step) return this.key(event);
      event.preventDefault();
      this.moveEdge(
        which,
        this.spans[this.chosen][which] + (step * (event.shiftKey ? 10 : 1) * (this.range[1] - this.range[0])) / 500,
      );
      this.page.changed();
    });
    byId("edges").append(button);
    return { which, button };
  }

  /** @param {"begin"|"end"} which @param {number} time */
  moveEdge(which, time) {
    const span = this.spans[this.chosen];
    if (!span) return; // another finger has chosen none
    const least = 0.02;
    span[which] =
      which === "begin"
        ? Math.min(Math.max(time, this.extent[0]), span.end - least)
        : Math.max(Math.min(time, this.extent[1]), span.begin + least);
    Object.assign(span, BY_HAND);
    this.board.now();
  }

  /** Move the playhead. @param {number} time */
  goTo(time) {
    this.head = time;
    this.placeHead();
  }

  placeHead() {
    const x = this.x(this.head);
    this.playhead.hidden = x < 0 || x > this.board.width;
    this.playhead.style.setProperty("--x", `${x}px`);
  }

  placeEdges() {
    const span = this.spans[this.chosen];
    for (const { which, button } of this.edges) {
      button.hidden = !span || this.x(span[which]) < 0 || this.x(span[which]) > this.board.width;
      if (!span) continue;
      button.style.setProperty("--x", `${this.x(span[which])}px`);
      const values = {
        "aria-label": `${which === "begin" ? "Begin" : "End"} of ${span.label ?? "unknown"}`,
        "aria-valuenow": span[which].toFixed(2),
        "aria-valuemin": this.extent[0].toFixed(2),
        "aria-valuemax": this.extent[1].toFixed(2),
        "aria-valuetext": `${span[which].toFixed(2)} seconds`,
      };
      for (const [name, value] of Object.entries(values)) button.setAttribute(name, value);
    }
  }

  /**
   * A click chooses a span, dragging moves along a recording that is longer than the picture.
   * @param {PointerEvent} event
   */
  grab(event) {
    const at = this.time(event.offsetX);
    const lanes = lanesOf(this.spans);
    const down = (event.offsetY - this.board.height + BAND + AXIS) / ((BAND - 4) / Math.max(...lanes, 1));
    const hits = [...this.spans.keys()].filter((k) => this.spans[k].begin <= at && at <= this.spans[k].end);
    const hit = hits.find((k) => lanes[k] === Math.ceil(down)) ?? hits[0] ?? -1;
    const go = (/** @type {PointerEvent} */ now) =>
      this.pan((-now.movementX / (this.board.width - 2 * SIDE)) * (this.range[1] - this.range[0]));
    if (!drag(this.board.canvas, event, go)) return;
    this.page.choose(hit);
    this.page.seek(at);
  }

  pan(/** @type {number} */ by) {
    const length = this.range[1] - this.range[0];
    const from = Math.min(Math.max(this.range[0] + by, this.extent[0]), this.extent[1] - length);
    this.range = [from, from + length];
    this.board.draw();
  }

  zoom(/** @type {number} */ factor, around = (this.range[0] + this.range[1]) / 2) {
    const [low, high] = this.extent;
    const length = Math.min(Math.max((this.range[1] - this.range[0]) * factor, (high - low) / 2000), high - low);
    const share = (around - this.range[0]) / (this.range[1] - this.range[0]);
    const from = Math.min(Math.max(around - share * length, low), high - length);
    this.range = [from, from + length];
    this.board.draw();
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    const isAll = this.range[0] === this.extent[0] && this.range[1] === this.extent[1];
    if (isAll && event.deltaY > Math.abs(event.deltaX)) return; // nothing is left to show: the page scrolls
    if (Math.abs(event.deltaX) > Math.abs(event.deltaY))
      this.pan((event.deltaX / this.board.width) * (this.range[1] - this.range[0]));
    else this.zoom(1.0015 ** event.deltaY, this.time(event.offsetX));
    event.preventDefault();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.key === "+" || event.key === "=") this.zoom(0.7);
    else if (event.key === "-") this.zoom(1 / 0.7);
    else if (event.key === "ArrowUp" || event.key === "ArrowDown")
      this.page.choose(
        Math.min(Math.max(this.chosen + (event.key === "ArrowDown" ? 1 : -1), 0), this.spans.length - 1),
      );
    else if (event.key === "Enter" && this.chosen >= 0) this.name();
    else if (event.key === "Delete" && this.chosen >= 0) this.page.remove(this.chosen);
    else if (event.key === "Insert" || event.key === "n") this.page.add();
    else return this.page.key(event);
    event.preventDefault();
  }

  /** Let the person name the span that is chosen. */
  name() {
    /** @type {HTMLElement} */ (document.querySelector(`[data-key="span ${this.chosen} name"]`))?.focus();
  }
}
