// All movements as dots, alike ones close together; names stand at the middle of their dots.
import { get } from "../parts/api.js";
import { Board, color } from "../parts/canvas.js";
import { byId } from "../parts/elements.js";
import { bounds, clamp, distance } from "../parts/geometry.js";
import { library, lookOf, symbolOf } from "../parts/library_state.js";
import { mark, words } from "../parts/lines.js";
import { tried } from "../parts/toasts.js";

const EDGE = 34; // [px]
const NEAR = 18; // how close a pointer must be [px]
const MANY = 40; // symbols, whose names would cover the dots

export class MovementMap {
  /** `open` opens a symbol, or "" for a movement without one. */
  constructor(open) {
    this.open = open;
    this.points = [];
    this.at = -1;
    this.board = new Board(byId("map"), () => this.paint());
    Object.assign(byId("map"), {
      onpointermove: (event) => this.point(event),
      onpointerleave: () => this.show(-1),
      onclick: (event) => {
        this.point(event);
        this.choose();
      },
      onkeydown: (event) => this.key(event),
    });
  }

  async load() {
    const { version } = library();
    const answer = await tried(get("/api/library/map"));
    if (!answer || version !== library().version) return;
    this.points = [...answer.points].sort((a, b) => a.x - b.x);
    this.at = -1;
    byId("map").closest("section").hidden = this.points.length < 3;
    this.board.fit();
    this.board.draw();
  }

  /** Pixels of all points. */
  pixels() {
    if (!this.points.length) return [];
    const { width, height } = this.board;
    const [[left, low], [right, high]] = bounds(this.points.map(({ x, y }) => [x, y]));
    const scale = Math.min((width - 2 * EDGE) / (right - left || 1), (height - 2 * EDGE) / (high - low || 1));
    return this.points.map(({ x, y }) => [
      width / 2 + scale * (x - (left + right) / 2),
      height / 2 - scale * (y - (low + high) / 2),
    ]);
  }

  paint() {
    const { context } = this.board;
    const pixels = this.pixels();
    const chosen = this.points[this.at]?.symbol;
    this.points.forEach((point, k) => {
      const look = lookOf(point.symbol);
      context.globalAlpha = this.at < 0 || point.symbol === chosen ? 1 : 0.3;
      mark(context, pixels[k], look.mark, k === this.at ? 9 : 5, color(look.color));
    });
    context.globalAlpha = 1;
    this.names(pixels);
  }

  /** As many names as fit; the one under the pointer in any case, and clearly. */
  names(pixels) {
    const { context } = this.board;
    const places = new Map();
    for (const [k, { symbol }] of this.points.entries())
      if (symbol !== null) places.set(symbol, [...(places.get(symbol) ?? []), pixels[k]]);
    const chosen = this.points[this.at]?.symbol ?? null;
    const taken = places.size > MANY ? pixels.map(([x, y]) => [x - 7, x + 7, y + 4, 12]) : [];
    Object.assign(context, { font: `600 13px ${color("--font")}`, textAlign: "center" });
    context.globalAlpha = chosen === null ? 1 : 0.3;
    for (const [id, members] of places) if (id !== chosen) this.name(id, members, taken);
    context.globalAlpha = 1;
    if (chosen !== null) this.name(chosen, places.get(chosen), []);
  }

  /** Write a name; `taken` is from where to where, on which line, how far from it, and gets this one. */
  name(id, members, taken) {
    const { context } = this.board;
    const name = symbolOf(id)?.name ?? "";
    const short = name.length > 18 ? `${name.slice(0, 17)}…` : name;
    const half = context.measureText(short).width / 2 + 4;
    const [x, y] = this.freePlace(members, half, taken);
    if (x === undefined) return;
    taken.push([x - half, x + half, y, 15]);
    words(context, short, x, y, color("--text"), color("--surface"));
  }

  /** Above, below or beside the dots of a name, where nothing else stands; [] where there is no room. */
  freePlace(members, half, taken) {
    const { width, height } = this.board;
    const [across, along] = [0, 1].map((axis) => members.map((pixel) => pixel[axis]));
    const middle = (some) => some.reduce((sum, value) => sum + value, 0) / some.length;
    const x = clamp(middle(across), half, width - half);
    const places = [
      [x, Math.max(Math.min(...along) - 11, 14)],
      [x, Math.min(Math.max(...along) + 21, height - 6)],
      [Math.max(...across) + half + 8, middle(along) + 4],
      [Math.min(...across) - half - 8, middle(along) + 4],
    ];
    const free = ([at, line]) =>
      taken.every(
        ([left, right, other, room]) => at + half < left || at - half > right || Math.abs(line - other) > room,
      );
    return places.find(([at, line]) => at >= half && at <= width - half && free([at, line])) ?? [];
  }

  point(event) {
    const box = this.board.canvas.getBoundingClientRect();
    const at = [event.clientX - box.left, event.clientY - box.top];
    const away = this.pixels().map((pixel) => distance(pixel, at));
    const nearest = away.indexOf(Math.min(...away));
    this.show(away[nearest] < NEAR ? nearest : -1);
  }

  show(at) {
    if (at === this.at) return;
    this.at = at;
    const tip = byId("map-tip");
    tip.hidden = at < 0;
    if (at >= 0) tip.textContent = symbolOf(this.points[at].symbol)?.name ?? "without a name";
    this.board.canvas.style.cursor = at < 0 ? "default" : "pointer";
    this.board.draw();
  }

  choose() {
    if (this.at >= 0) this.open(this.points[this.at].symbol ?? "");
  }

  key(event) {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (step && this.points.length) this.show((this.at + step + this.points.length) % this.points.length);
    else if (event.key === "Enter") this.choose();
    else return;
    event.preventDefault();
  }
}
