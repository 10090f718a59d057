// Small plots over time: a line for each formulation, the highest value, the duration.
import { Board, color } from "./canvas.js";
import { line } from "./lines.js";

const EDGE = { left: 8, right: 8, top: 18, bottom: 20 };

export class Plot {
  constructor(canvas) {
    /** @type {Curve[]} */
    this.curves = [];
    this.cursor = null;
    this.board = new Board(canvas, () => this.paint());
  }

  /** @param {Curve[]} curves */
  show(curves) {
    this.curves = curves;
    this.board.draw();
  }

  paint() {
    if (!this.curves.length) return;
    const { context, width, height } = this.board;
    const end = Math.max(...this.curves.map((curve) => curve.times.at(-1)), 1e-9);
    const high = Math.max(...this.curves.flatMap((curve) => curve.values), 1e-9);
    const [w, h] = [width - EDGE.left - EDGE.right, height - EDGE.top - EDGE.bottom];
    const at = (t, v) => [EDGE.left + (w * t) / end, EDGE.top + h * (1 - v / high)];
    line(context, [at(0, 0), at(end, 0)], { color: color("--line"), width: 1 });
    for (const { times, values, look } of this.curves) {
      const points = times.map((t, k) => at(t - times[0], values[k]));
      line(context, points, { color: color(look.color), width: 2.2, dash: look.dash });
    }
    if (this.cursor !== null && this.cursor <= end)
      line(context, [at(this.cursor, 0), at(this.cursor, high)], { color: color("--text"), width: 1.5 });
    Object.assign(context, { font: `12px ${color("--font")}`, fillStyle: color("--soft"), textAlign: "left" });
    context.fillText(`at most ${Number(high.toPrecision(3))}`, EDGE.left, 12);
    context.fillText("0 s", EDGE.left, height - 5);
    context.textAlign = "right";
    context.fillText(`${end.toFixed(2)} s`, width - EDGE.right, height - 5);
  }
}
