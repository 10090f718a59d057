// The drawing on its canvas: ink, the predicted rest, the arrival, the pen of the keyboard.
import { Board, color } from "../parts/canvas.js";
import { ground, line, mark } from "../parts/lines.js";

const FINGER = 10; // radius of the replayed point [px]
/** Landmarks of a hand that belong together: the palm, and each finger from the wrist to its tip. */
const HAND = [[5, 9, 13, 17], ...[1, 5, 9, 13, 17].map((k) => [0, k, k + 1, k + 2, k + 3])];

export class Picture {
  constructor(canvas) {
    this.ink = [];
    this.rest = [];
    this.pen = null;
    this.hand = null; // landmarks of the hand that a camera sees
    /** Height of the canvas when the drawing began [px]: ink stays under the hand whatever the window does. */
    this.height = null;
    this.replayed = null;
    this.frame = null; // of a movement that was not drawn here
    this.board = new Board(canvas, () => this.paint());
    this.board.resized = () => this.frame?.include([], this.board);
  }

  pixel(point) {
    if (this.frame) return this.frame.camera.toScreen(point);
    const height = this.height ?? this.board.height;
    return [point[0] * height, (1 - point[1]) * height];
  }

  /** Whether what is shown is in space. */
  get turns() {
    return this.frame?.turns ?? false;
  }

  turn(dx, dy) {
    this.frame?.camera.turn(dx, dy);
    this.board.draw();
  }

  paint() {
    const { context } = this.board;
    const ink = this.ink.map((sample) => this.pixel(sample.slice(1)));
    const rest = this.rest.map((point) => this.pixel(point));
    if (this.turns) ground(context, this.frame.camera, [this.frame.low, this.frame.high], color("--line"));
    if (rest.length && ink.length)
      line(context, [ink.at(-1), ...rest], { color: color("--predicted"), width: 3, dash: [2, 9] });
    line(context, ink, { color: color("--ink"), width: 5, alpha: this.replayed === null ? 1 : 0.35 });
    if (ink.length) mark(context, ink[0], "dot", 6, color("--ink"));
    if (rest.length) mark(context, rest.at(-1), "diamond", 8, color("--goal"));
    if (this.replayed !== null) this.paintReplayed(ink);
    for (const bones of this.hand ? HAND : []) {
      const { height } = this.board;
      const joints = bones.map((k) => [this.hand[k][0] * height, (1 - this.hand[k][1]) * height]);
      line(context, joints, { color: color("--soft"), width: 4, alpha: 0.5 });
    }
    if (this.pen) mark(context, this.pixel(this.pen), "ring", 9, color("--text"));
  }

  paintReplayed(ink) {
    const upTo = this.ink.findIndex(([t]) => t > this.replayed);
    const done = upTo < 0 ? ink : ink.slice(0, Math.max(upTo, 1));
    line(this.board.context, done, { color: color("--ink"), width: 5 });
    mark(this.board.context, done.at(-1), "dot", FINGER, color("--predicted"));
  }

  /** Show the drawing again, as fast as it was. */
  replay() {
    const duration = this.ink.at(-1)[0];
    this.replayed = 0;
    this.board.run((time) => {
      if (this.replayed === null) return false;
      this.replayed = time > duration ? null : time;
      this.board.now();
      return this.replayed !== null;
    });
  }
}
