// A drawing over an example: the example in gray, the drawing in color, and in another where it is far from it.
import { Camera } from "./camera.js";
import { Board, color } from "./canvas.js";
import { line, mark } from "./lines.js";

const FAR = 0.3; // of the size of the drawing: the other color

export class Overlay {
  constructor(canvas) {
    this.shown = null;
    this.board = new Board(canvas, () => this.paint());
  }

  /** Show the path of an example, alone or with what was drawn and its differences; null for none. */
  show(shown) {
    this.shown = shown;
    this.board.draw();
  }

  paint() {
    if (!this.shown) return;
    const { path, drawn, differences } = this.shown;
    const { context, width, height } = this.board;
    const camera = new Camera();
    camera.face([drawn ?? path]);
    camera.fit([...path, ...(drawn ?? [])], width, height);
    const [below, above] = [path, drawn ?? path].map((points) => points.map((point) => camera.toScreen(point)));
    line(context, below, drawn ? { color: color("--gray"), width: 8, alpha: 0.45 } : { color: color("--ink") });
    for (let k = 1; drawn && k < above.length; k += 1) {
      const far = `${color("--predicted")} ${Math.min((100 * differences[k]) / FAR, 100)}%`;
      const mixed = `color-mix(in oklch increasing hue, ${color("--ink")}, ${far})`;
      line(context, above.slice(k - 1, k + 1), { color: mixed, width: 4 });
    }
    mark(context, above[0], "dot", 4, color("--ink"));
  }
}
