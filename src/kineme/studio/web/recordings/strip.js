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
    Object.assign(context, { font: `600 11px ${color("--font")}`, textAlign: "center" });
    for (const { begin, end, label } of spans) {
      const [paint, name, wide] = [colorOf(label), label ?? "unknown", Math.max(x(end) - x(begin) - 1, 2)];
      Object.assign(context, { fillStyle: paint, globalAlpha: label === null ? 0.25 : 1 });
      context.fillRect(x(begin), height - LANE, wide, LANE);
      Object.assign(context, { fillStyle: label === null ? color("--text") : readableOn(paint), globalAlpha: 1 });
      if (context.measureText(name).width < wide - 6) context.fillText(name, x(begin) + wide / 2, height - 4);
    }
  }
}
