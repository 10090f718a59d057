// The recording over time: its columns, the shapes and names of what was found, the edges of the span that is chosen.
import { Board, color } from "../parts/canvas.js";
import { drag } from "../parts/dragging.js";
import { byId, keyed, make } from "../parts/elements.js";
import { clamp } from "../parts/geometry.js";
import { COLORS } from "../parts/library_state.js";
import { line } from "../parts/lines.js";
import { placed } from "./shapes.js";
import { signal } from "./signal.js";
import { BY_HAND } from "./spans.js";
import { colorOf, lanesOf, paintLanes } from "./strip.js";

const BAND = 36; // height of the names [px]
const SHAPE = 72; // of the shapes above them
const SIDE = 12;
const AXIS = 26;
const LEAST = 0.02; // duration of a span [s]

export class Timeline {
  /** @param {TimelinePage} page */
  constructor(page) {
    this.page = page;
    this.plot = { times: [0, 1], columns: [] };
    /** @type {Span[]} */
    this.spans = [];
    this.shapes = new WeakMap(); // of spans
    this.chosen = -1;
    this.range = [0, 1];
    this.head = 0; // where the playhead is [s]
    const canvas = byId("timeline-canvas");
    this.board = new Board(canvas, () => this.paint());
    this.playhead = make("div", { class: "playhead", "aria-hidden": "true" });
    byId("edges").append(this.playhead);
    this.edges = ["begin", "end"].map((which) => this.edge(which));
    Object.assign(canvas, {
      tabIndex: 0,
      onpointerdown: (event) => this.grab(event),
      onwheel: (event) => this.wheel(event),
      onkeydown: (event) => this.key(event),
      ondblclick: () => (this.chosen < 0 ? this.page.add() : this.name()),
    });
  }

  show(plot) {
    this.plot = plot;
    this.extent = [plot.times[0] ?? 0, plot.times.at(-1) ?? 1];
    this.range = [...this.extent];
    this.chosen = -1;
    this.board.fit();
    this.board.draw();
  }

  /** Seconds in a pixel. */
  get scale() {
    return (this.range[1] - this.range[0]) / (this.board.width - 2 * SIDE);
  }

  x(time) {
    return SIDE + (time - this.range[0]) / this.scale;
  }

  time(x) {
    return this.range[0] + (x - SIDE) * this.scale;
  }

  paint() {
    const { context, height } = this.board;
    const top = height - BAND - AXIS;
    for (const [k, span] of this.spans.entries()) this.paintSpan(span, k === this.chosen, top);
    paintLanes(context, this.spans, (time) => this.x(time), [top, BAND], this.chosen);
    const x = this.plot.times.map((time) => this.x(time));
    for (const [k, column] of this.plot.columns.entries()) {
      const look = { color: color(column.color ?? COLORS[k % COLORS.length]), width: 1.4 };
      signal(context, x, column.values, [8, top - 12 - (this.spans.length ? SHAPE : 0)], look);
    }
    this.paintAxis();
    this.placeEdges();
    this.goTo(this.head);
  }

  paintSpan(span, isChosen, bottom) {
    const { context, width } = this.board;
    const [x, paint, shape] = [this.x(span.begin), colorOf(span.label), this.shapes.get(span)];
    const w = Math.max(this.x(span.end) - x, 2);
    Object.assign(context, { fillStyle: paint, globalAlpha: isChosen ? 0.2 : 0.09 });
    context.fillRect(x, 0, w, bottom);
    context.globalAlpha = 1;
    if (!shape?.path.length || w < 14 || x > width || x + w < 0) return;
    const middle = [x + w / 2, bottom - SHAPE / 2];
    line(context, placed(shape, middle, Math.min(w - 2, SHAPE)), { color: paint, width: 2 });
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

  edge(which) {
    const look = { class: "edge", type: "button", role: "slider", hidden: true };
    const go = (now) => this.moveEdge(which, this.time(now.clientX - this.board.canvas.getBoundingClientRect().left));
    const onpointerdown = (event) => {
      if (!drag(button, event, go, () => this.page.changed())) return;
      event.preventDefault();
      button.focus({ preventScroll: true });
    };
    const onkeydown = (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -1, ArrowUp: 1 }[event.key];
      if (!step) return this.key(event);
      event.preventDefault();
      const by = (step * (event.shiftKey ? 10 : 1) * (this.range[1] - this.range[0])) / 500;
      this.moveEdge(which, this.spans[this.chosen][which] + by);
      this.page.changed();
    };
    const button = make("button", { ...look, "data-key": `edge ${which}`, onpointerdown, onkeydown });
    byId("edges").append(button);
    return { which, button };
  }

  moveEdge(which, time) {
    const span = this.spans[this.chosen];
    if (!span) return; // another finger has chosen none
    const [first, last] = this.extent;
    if (which === "begin") span.begin = clamp(time, first, span.end - LEAST);
    else span.end = clamp(time, span.begin + LEAST, last);
    Object.assign(span, BY_HAND);
    this.board.now();
  }

  /** Move the playhead. */
  goTo(time) {
    this.head = time;
    const x = this.x(time);
    this.playhead.hidden = x < 0 || x > this.board.width;
    this.playhead.style.setProperty("--x", `${x}px`);
  }

  placeEdges() {
    const span = this.spans[this.chosen];
    for (const { which, button } of this.edges) {
      button.hidden = !span || this.x(span[which]) < 0 || this.x(span[which]) > this.board.width;
      if (!span) continue;
      button.style.setProperty("--x", `${this.x(span[which])}px`);
      const [now, low, high] = [span[which], ...this.extent].map((time) => time.toFixed(2));
      Object.assign(button, { ariaValueNow: now, ariaValueMin: low, ariaValueMax: high });
      button.ariaValueText = `${now} seconds`;
      button.ariaLabel = `${which === "begin" ? "Begin" : "End"} of ${span.label ?? "unknown"}`;
    }
  }

  /** A click chooses a span, dragging moves along a recording that is longer than the picture. */
  grab(event) {
    const at = this.time(event.offsetX);
    if (!drag(this.board.canvas, event, (now) => this.pan(-now.movementX * this.scale))) return;
    const lanes = lanesOf(this.spans);
    const lane = Math.ceil(((event.offsetY - this.board.height + BAND + AXIS) * Math.max(...lanes)) / BAND);
    const hits = [...this.spans.keys()].filter((k) => this.spans[k].begin <= at && at <= this.spans[k].end);
    this.page.choose(hits.find((k) => lanes[k] === lane) ?? hits[0] ?? -1);
    this.page.seek(at);
  }

  pan(by) {
    const length = this.range[1] - this.range[0];
    const from = clamp(this.range[0] + by, this.extent[0], this.extent[1] - length);
    this.range = [from, from + length];
    this.board.draw();
  }

  zoom(factor, around = (this.range[0] + this.range[1]) / 2) {
    const [[low, high], [from, to]] = [this.extent, this.range];
    const length = clamp((to - from) * factor, (high - low) / 2000, high - low);
    const begin = around - ((around - from) / (to - from)) * length;
    this.range = [begin, begin + length];
    this.pan(0);
  }

  wheel(event) {
    const isAll = this.range[0] === this.extent[0] && this.range[1] === this.extent[1];
    const isAcross = Math.abs(event.deltaX) > Math.abs(event.deltaY);
    if (isAll && event.deltaY > 0 && !isAcross) return; // nothing is left to show: the page scrolls
    if (isAcross) this.pan(event.deltaX * this.scale);
    else this.zoom(1.0015 ** event.deltaY, this.time(event.offsetX));
    event.preventDefault();
  }

  key(event) {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (event.key === "+" || event.key === "=") this.zoom(0.7);
    else if (event.key === "-") this.zoom(1 / 0.7);
    else if (step) this.page.choose(clamp(this.chosen + step, 0, this.spans.length - 1));
    else if (event.key === "Enter" && this.chosen >= 0) this.name();
    else if (event.key === "Delete" && this.chosen >= 0) this.page.remove(this.chosen);
    else if (event.key === "Insert") this.page.add();
    else return this.page.key(event);
    event.preventDefault();
  }

  /** Let the person name the span that is chosen. */
  name() {
    keyed(`span ${this.chosen} name`)?.focus();
  }
}
