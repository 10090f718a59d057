// An episode in the list: its signals as thin lines, the lane of its symbols below, and words about it.
import { get, path } from "../parts/api.js";
import { Board, color } from "../parts/canvas.js";
import { button, counted, fill, make } from "../parts/elements.js";
import { COLORS, lookOf, symbolNamed } from "../parts/library_state.js";
import { readableOn } from "../parts/lines.js";
import { signal } from "./signal.js";

const LANE = 16; // height of the symbols [px]
const NAMED = 4; // symbols that are written out

/** The color of a name: that of the symbol, gray where there is none. */
export const colorOf = (label) => {
  const symbol = label === null ? null : symbolNamed(label);
  return color(symbol ? lookOf(symbol.id).color : "--gray");
};

/**
 * Spans as bars with their names; those that overlap lie in lanes, one below the other. The time becomes pixels by `x`.
 * @type {(context: CanvasRenderingContext2D, spans: Span[], x: (time: number) => number, place: number[], chosen?:
 *   number) => void}
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

/** The lane of each span, from 1: the first in which no earlier one lies beside it. */
export function lanesOf(spans) {
  const ends = [];
  const lanes = spans.map(() => 1);
  for (const k of Object.keys(spans).sort((a, b) => spans[a].begin - spans[b].begin)) {
    const free = ends.findIndex((end) => end <= spans[k].begin);
    lanes[k] = (free < 0 ? ends.length : free) + 1;
    ends[lanes[k] - 1] = spans[k].end;
  }
  return lanes;
}

export class Strip {
  constructor(open) {
    this.episode = null;
    this.plot = null;
    this.canvas = make("canvas", { "aria-hidden": "true" });
    this.about = make("span", "strip-about");
    this.symbols = make("span", "strip-symbols small");
    this.button = button("", () => open(this), { class: "strip" });
    this.button.append(this.about, this.canvas, this.symbols);
    this.element = make("li", {}, this.button);
    this.board = new Board(this.canvas, () => this.paint());
    this.board.resized = () => this.load();
    this.seen = false;
    new IntersectionObserver(([entry]) => {
      this.seen = entry.isIntersecting;
      this.load();
    }).observe(this.element);
  }

  /** Show an episode, or none where the page has fewer. */
  show(episode) {
    this.element.hidden = !episode;
    if (this.episode?.key !== episode?.key) this.plot = null;
    this.episode = episode;
    if (!episode) return;
    this.button.dataset.key = episode.key;
    const { number, duration, task, place } = episode;
    const title = task ?? place;
    const name = make("span", { class: "strip-task", title }, title);
    const time = make("span", "soft small numbers", `${duration.toFixed(1)} s`);
    fill(this.about, make("b", "numbers", number), name, time);
    this.say();
    this.board.draw();
    this.load();
  }

  /** What was found, in words: symbols with their counts, the most frequent first. */
  say() {
    const { spans, problems, corrected } = this.episode;
    const counts = new Map();
    for (const { label } of spans) counts.set(label ?? "unknown", (counts.get(label ?? "unknown") ?? 0) + 1);
    const names = [...counts].sort((a, b) => b[1] - a[1]);
    const words = [];
    if (names.length > NAMED) words.push(`${names.length - NAMED} more`);
    if (corrected) words.push("corrected");
    if (problems.length) words.push(counted(problems.length, "problem"));
    const shown = names.slice(0, NAMED).map(([name, n]) => {
      const key = make("span", "strip-key");
      key.style.background = colorOf(name);
      return make("span", "strip-symbol", key, n > 1 ? `${name} ×${n}` : name);
    });
    const rest = make("span", "soft", words.join(", "));
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
    const width = Math.max(Math.round(this.board.width), 16);
    const plot = await get(path`/api/episodes/${key}/strip?width=${width}`).catch(() => null);
    if (this.episode?.key !== key || !plot) return;
    this.plot = plot;
    this.board.draw();
  }

  paint() {
    const { context, width, height } = this.board;
    if (!this.episode) return;
    const { duration, spans } = this.episode;
    const x = (time) => (duration ? (time / duration) * width : 0);
    for (const [k, { values }] of (this.plot?.columns ?? []).entries()) {
      const look = { color: color(COLORS[k % COLORS.length]), width: 1 };
      signal(context, this.plot.times.map(x), values, [2, height - LANE - 4], look);
    }
    paintLanes(context, spans, x, [height - LANE, LANE]);
  }
}
