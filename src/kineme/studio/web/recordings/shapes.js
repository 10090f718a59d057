// The shape of the movement at the playhead, drawn large: what is done of it, and a marker where it is now.
import { Board, color } from "../parts/canvas.js";
import { byId, write } from "../parts/elements.js";
import { line, mark } from "../parts/lines.js";
import { flattened } from "../parts/thumbnails.js";
import { colorOf } from "./strip.js";

/** A path in pixels: its middle is at a point, and it fits into a square. @param {Shape} shape @param {number[]} at */
export function placed(shape, [x, y], side) {
  shape.flat ??= flattened(shape.path);
  return shape.flat.map(([a, b]) => [x + (side / 100) * (a - 50), y + (side / 100) * (b - 50)]);
}

export class ShapeView {
  constructor() {
    this.head = 0;
    /** @type {any} The stretch around the playhead. */
    this.span = {};
    /** @type {Shape|undefined} */
    this.shape = undefined;
    this.board = new Board(byId("shape"), () => this.paint());
  }

  show(head, span, shape) {
    Object.assign(this, { head, span, shape });
    this.board.draw();
  }

  paint() {
    const { context, width, height } = this.board;
    const { begin, end, label } = this.span;
    const name = label === undefined ? "no annotation" : (label ?? "unknown");
    write(byId("shape-name"), this.shape ? `${begin.toFixed(2)} to ${end.toFixed(2)} s: ${name}` : "");
    if (!this.shape?.path.length) return;
    const points = placed(this.shape, [width / 2, height / 2], Math.min(width, height));
    const done = points.filter((_, k) => !k || this.shape.times[k] <= this.head);
    const paint = label === undefined ? color("--soft") : colorOf(label);
    line(context, points, { color: paint, width: 2, alpha: 0.4 });
    line(context, done, { color: paint, width: 4 });
    mark(context, done.at(-1), "dot", 7, color("--text"));
  }
}
