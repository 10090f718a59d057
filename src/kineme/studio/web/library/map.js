// All movements as dots, alike ones close together; names stand at the middle of their dots.
import { get } from "../parts/api.js";
import { Board, color } from "../parts/canvas.js";
import { byId } from "../parts/elements.js";
import { library, lookOf, symbolOf } from "../parts/library_state.js";
import { mark } from "../parts/lines.js";
import { tried } from "../parts/toasts.js";

const EDGE = 34; // [px]
const NEAR = 18; // how close a pointer must be [px]

export class MovementMap {
  /** @param {(symbol: string) => void} open "" for a movement without one. */
  constructor(open) {
    this.open = open;
    this.points = [];
    this.at = -1;
    this.board = new Board(byId("map"), () => this.paint());
    this.board.canvas.addEventListener("pointermove", (event) => this.point(event));
    this.board.canvas.addEventListener("pointerleave", () => this.show(-1));
    this.board.canvas.addEventListener("click", (event) => (this.point(event), this.choose()));
    this.board.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  async load() {
    const { version } = library();
    const answer = await tried(() => get("/api/library/map"));
    if (!answer || version !== library().version) return;
    this.points = [...answer.points].sort((a, b) => a.x - b.x);
    this.at = -1;
    byId("map").closest("section").hidden = this.points.length < 3;
    this.board.fit();
    this.board.draw();
  }

  /** @returns {number[][]} Pixels of all points. */
  pixels() {
    const { width, height } = this.board;
    const range = (/** @type {"x"|"y"} */ axis) => [Math.min(...this.points.map((p) => p[axis])), Math.max(...this.points.map((p) => p[axis]))];
    const [[left, right], [low, high]] = [range("x"), range("y")];
    const scale = Math.min((width - 2 * EDGE) / (right - left || 1), (height - 2 * EDGE) / (high - low || 1));
    return this.points.map(({ x, y }) => [width / 2 + scale * (x - (left + right) / 2), height / 2 - scale * (y - (low + high) / 2)]);
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

  /** @param {number[][]} pixels */
  names(pixels) {
    const { context, width } = this.board;
    const places = new Map();
    /** @type {number[][]} */
    const taken = [];
    this.points.forEach((point, k) => point.symbol !== null && places.set(point.symbol, [...(places.get(point.symbol) ?? []), pixels[k]]));
    if (places.size > 40) return;
    Object.assign(context, { font: `600 13px ${color("--font")}`, textAlign: "center", lineWidth: 4, strokeStyle: color("--surface"), fillStyle: color("--text"), lineJoin: "round" });
    for (const [id, members] of places) {
      const name = symbolOf(id)?.name ?? "";
      const short = name.length > 18 ? `${name.slice(0, 17)}…` : name;
      const half = context.measureText(short).width / 2 + 4;
      const x = Math.min(Math.max(members.reduce((/** @type {number} */ sum, /** @type {number[]} */ one) => sum + one[0], 0) / members.length, half), width - half);
      const y = this.freeLine(members, x, half, taken);
      if (y === null) continue;
      taken.push([x - half, x + half, y]);
      context.strokeText(short, x, y);
      context.fillText(short, x, y);
    }
  }

  /** Above or below the dots of a name, where no other name stands; null where there is no room. */
  freeLine(/** @type {number[][]} */ members, /** @type {number} */ x, /** @type {number} */ half, /** @type {number[][]} */ taken) {
    const heights = members.map((one) => one[1]);
    const lines = [Math.max(Math.min(...heights) - 11, 14), Math.min(Math.max(...heights) + 21, this.board.height - 6)];
    const free = (/** @type {number} */ y) => taken.every(([left, right, other]) => x + half < left || x - half > right || Math.abs(y - other) > 15);
    return lines.find(free) ?? null;
  }

  /** @param {MouseEvent} event */
  point(event) {
    const box = this.board.canvas.getBoundingClientRect();
    const away = this.pixels().map(([x, y]) => Math.hypot(x - event.clientX + box.left, y - event.clientY + box.top));
    const nearest = away.indexOf(Math.min(...away));
    this.show(away[nearest] < NEAR ? nearest : -1);
  }

  /** @param {number} at */
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

  /** @param {KeyboardEvent} event */
  key(event) {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (step && this.points.length) this.show((this.at + step + this.points.length) % this.points.length);
    else if (event.key === "Enter") this.choose();
    else return;
    event.preventDefault();
  }
}
