// An episode in the list: its signals as thin lines, the lane of its symbols below, and words about it.
import { get } from "../parts/api.js";
import { Board, color } from "../parts/canvas.js";
import { counted, fill, make } from "../parts/elements.js";
import { COLORS, lookOf, symbolNamed } from "../parts/library_state.js";
import { readableOn } from "../parts/lines.js";
import { signal } from "./signal.js";

const LANE = 16; // height of the symbols [px]
const NAMED = 4; // symbols that are written out

/** The color of a name: that of the symbol, gray where there is none. @param {string|null} label */
export const colorOf = (label) => {
  const symbol = label === null ? null : symbolNamed(label);
  return color(symbol ? lookOf(symbol.id).color : "--gray");
};

/**
 * Spans as bars with their names; those that overlap lie in lanes, one below the other.
 * @param {CanvasRenderingContext2D} context
 * @param {any[]} spans
 * @param {(time: number) => number} x [px]
 * @param {number[]} place Top and height [px].
 * @param {number} chosen
 */
export function paintLanes(context, spans, x, [top, height], chosen = -1) {
  const lanes = lanesOf(spans);
  const tall = height / Math.max(...lanes, 1);
  Object.assign(context, { font: `600 ${Math.min(13, tall - 4)}px ${color("--font")}`, textAlign: "center" });
  for (const [k, { begin, end, label }] of spans.entries()) {
    const [paint, name, y] = [colorOf(label), label ?? "unknown", top + (lanes[k] - 1) * tall];
    const [left, wide] = [x(begin), Math.max(x(end) - x(begin) - 1, 2)];
    Object.assign(context, { fillStyle: paint, globalAlpha: label === null ? 0.25 : 1 });
    context.beginPath();
    context.roundRect(left, y + 1, wide, tall - 2, 5);
    context.fill();
    context.globalAlpha = 1;
    if (k === chosen) Object.assign(context, { lineWidth: 3, strokeStyle: color("--text") }).stroke();
    context.fillStyle = label === null ? color("--text") : readableOn(paint);
    if (context.measureText(name).width < wide - 6) context.fillText(name, left + wide / 2, y + tall / 2 + 4);
  }
}

/** The lane of each span, from 1: the first in which no earlier one lies beside it. @param {any[]} spans */
export function lanesOf(spans) {
  /** @type {number[]} */
  const ends = [];
  const lanes = spans.map(() => 1);
  for (const k of [...spans.keys()].sort((a, b) => spans[a].begin - spans[b].begin)) {
    const free = ends.findIndex((end) => end <= spans[k].begin);
    lanes[k] = (free < 0 ? ends.length : free) + 1;
    ends[lanes[k] - 1] = spans[k].end;
  }
  return lanes;
}

export class Strip {
  /** @param {(strip: Strip) => void} open */
  constructor(open) {
    /** @type {any} */
    this.episode = null;
    /** @type {any} */
    this.plot = null;
    this.canvas = make("canvas", { "aria-hidden": "true" });
    this.about = make("span", { class: "strip-about" });
    this.symbols = make("span", { class: "strip-symbols small" });
    this.button = make(
      "button",
      { class: "strip", type: "button", on: { click: () => open(this) } },
      this.about,
      this.canvas,
      this.symbols,
    );
    this.element = make("li", {}, this.button);
    this.board = new Board(this.canvas, () => this.paint());
    this.board.resized = () => this.load();
    this.seen = false;
    new IntersectionObserver(([entry]) => {
      this.seen = entry.isIntersecting;
      this.load();
    }).observe(this.element);
  }

  /** @param {any} episode Null where the page has fewer. */
  show(episode) {
    this.element.hidden = !episode;
    if (this.episode?.key !== episode?.key) this.plot = null;
    this.episode = episode;
    if (!episode) return;
    this.button.dataset.key = episode.key;
    fill(
      this.about,
      make("b", { class: "numbers" }, `${episode.number}`),
      make("span", { class: "strip-task", title: episode.task ?? episode.place }, episode.task ?? episode.place),
      make("span", { class: "soft small numbers" }, `${episode.duration.toFixed(1)} s`),
    );
    this.say();
    this.board.draw();
    this.load();
  }

  /** What was found, in words: symbols with their counts, the most frequent first. */
  say() {
    const { spans, problems, corrected } = this.episode;
    /** @type {Map<string, number>} */
    const counts = new Map();
    for (const { label } of spans) counts.set(label ?? "unknown", (counts.get(label ?? "unknown") ?? 0) + 1);
    const names = [...counts].sort((a, b) => b[1] - a[1]);
    const words = [];
    if (names.length > NAMED) words.push(`${names.length - NAMED} more`);
    if (corrected) words.push("corrected");
    if (problems.length) words.push(counted(problems.length, "problem"));
    const shown = names.slice(0, NAMED).map(([name, n]) => {
      const key = make("span", { class: "strip-key" });
      key.style.background = colorOf(name);
      return make("span", { class: "strip-symbol" }, key, n > 1 ? `${name} ×${n}` : name);
    });
    const rest = make("span", { class: "soft" }, words.join(", "));
    fill(this.symbols, ...shown.flatMap((symbol) => [symbol, " "]), rest);
    this.symbols.title = problems.join("\n");
  }

  /** Symbols have other names, and so colors. */
  recolor() {
    if (this.episode) this.say();
    this.board.draw();
  }

  /** Ask for the signals once the strip is on the screen. */
  async load() {
    if (!this.seen || !this.episode || this.plot || !this.board.width) return;
    const { key } = this.episode;
    this.plot = { times: [], columns: [] };
    const plot = await get(`/api/episodes/${key}/strip?width=${Math.max(Math.round(this.board.width), 16)}`).catch(
      () => null,
    );
    if (this.episode?.key !== key || !plot) return;
    this.plot = plot;
    this.board.draw();
  }

  paint() {
    const { context, width, height } = this.board;
    if (!this.episode) return;
    const { duration, spans } = this.episode;
    const x = (/** @type {number} */ time) => (duration ? (time / duration) * width : 0);
    for (const [k, column] of (this.plot?.columns ?? []).entries())
      signal(context, this.plot.times.map(x), column.values, [2, height - LANE - 4], {
        color: color(COLORS[k % COLORS.length]),
        width: 1,
      });
    paintLanes(context, spans, x, [height - LANE, LANE]);
  }
}
