// The drawing on its canvas: ink, the predicted rest, the arrival, the pen of the keyboard.
import { Board, color } from "../parts/canvas.js";
import { ground, line, mark } from "../parts/lines.js";

const FINGER = 10; // radius of the replayed point [px]
/** Landmarks of a hand that belong together: the palm, and each finger from the wrist to its tip. */
const HAND = [[5, 9, 13, 17], ...[1, 5, 9, 13, 17].map((k) => [0, k, k + 1, k + 2, k + 3])];

export class Picture {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.ink = [];
    this.rest = [];
    this.pen = null;
    /** @type {number[][]|null} Landmarks of the hand that a camera sees. */
    this.hand = null;
    /**
     * Height of the canvas when the drawing began [px]: ink stays under the hand whatever the window does.
     * @type {number|null}
     */
    this.height = null;
    this.replayed = null;
    this.run = {}; // of the replay that is under way
    /** @type {import("./frame.js").Frame|null} Of a movement that was not drawn here. */
    this.frame = null;
    this.board = new Board(canvas, () => this.paint());
    this.board.resized = () => this.frame?.include([], this.board);
  }

  /** @param {number[]} point */
  pixel(point) {
    if (this.frame) return this.frame.camera.toScreen(point);
    const height = this.height ?? this.board.height;
    return [point[0] * height, (1 - point[1]) * height];
  }

  /** Whether what is shown is in space. */
  get turns() {
    return this.frame?.turns ?? false;
  }

  /** @param {number} dx Pixels. @param {number} dy */
  turn(dx, dy) {
    this.frame?.camera.turn(dx, dy);
    this.board.draw();
  }

  paint() {
    const { context } = this.board;
    const ink = this.ink.map((sample) => this.pixel(sample.slice(1)));
    const rest = this.rest.map((point) => this.pixel(point));
    if (this.turns) ground(context, this.frame.camera, this.frame.low, this.frame.high, color("--line"));
    if (rest.length && ink.length)
      line(context, [ink[ink.length - 1], ...rest], { color: color("--predicted"), width: 3, dash: [2, 9] });
    line(context, ink, { color: color("--ink"), width: 5, alpha: this.replayed === null ? 1 : 0.35 });
    if (ink.length) mark(context, ink[0], "dot", 6, color("--ink"));
    if (rest.length) mark(context, rest[rest.length - 1], "diamond", 8, color("--goal"));
    if (this.replayed !== null) this.paintReplayed(ink);
    for (const bones of this.hand ? HAND : []) {
      const joints = bones.map((k) => [this.hand[k][0] * this.board.height, (1 - this.hand[k][1]) * this.board.height]);
      line(context, joints, { color: color("--soft"), width: 4, alpha: 0.5 });
    }
    if (this.pen) mark(context, this.pixel(this.pen), "ring", 9, color("--text"));
  }

  /** @param {number[][]} ink */
  paintReplayed(ink) {
    const upTo = this.ink.findIndex(([t]) => t > this.replayed);
    const done = upTo < 0 ? ink : ink.slice(0, Math.max(upTo, 1));
    line(this.board.context, done, { color: color("--ink"), width: 5 });
    mark(this.board.context, done[done.length - 1], "dot", FINGER, color("--predicted"));
  }

  /** Show the drawing again, as fast as it was. */
  replay() {
    const run = {};
    this.run = run;
    const began = performance.now();
    const duration = this.ink[this.ink.length - 1][0];
    const step = (/** @type {number} */ now) => {
      if (this.replayed === null || this.run !== run) return;
      this.replayed = (now - began) / 1000;
      if (this.replayed > duration) this.replayed = null;
      else requestAnimationFrame(step);
      this.board.now();
    };
    this.replayed = 0;
    requestAnimationFrame(step);
  }
}
