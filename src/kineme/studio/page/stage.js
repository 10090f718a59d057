// The drawing area: where a movement is on the screen, and how it is painted.

import { Camera } from "../web/parts/camera.js";
import { Board, color } from "../web/parts/canvas.js";
import { bounds } from "../web/parts/geometry.js";
import { line, mark, words } from "../web/parts/lines.js";

const RADIUS = 9; // of start and goal [CSS pixels]
const EDGE = 1.5; // half of the line around a dot
const FILLED = 0.8; // of the shorter side, by a typical movement

/** A view as the snapshot has it, turned about what is up on the screen, then tilted. */
class View extends Camera {
  /** The first view is a rotation matrix, row by row: what is right, up and near on the screen. */
  constructor(first) {
    super();
    this.first = first;
    this.angles = [0, 0]; // [degrees]
  }

  axes() {
    if (this.first.length === 4) return super.axes();
    const [a, b] = this.angles.map((angle) => (angle * Math.PI) / 180);
    const [right, up, near] = [0, 1, 2].map((k) => this.first.slice(3 * k, 3 * k + 3));
    const mix = (u, x, v, y) => u.map((value, k) => x * value + y * v[k]);
    const behind = mix(near, Math.cos(a), right, -Math.sin(a));
    return {
      right: mix(right, Math.cos(a), near, Math.sin(a)),
      up: mix(up, Math.cos(b), behind, -Math.sin(b)),
    };
  }
}

export class Stage {
  /** A box is in view, in the unit of the movements; see `View`. @param {Box} box */
  constructor(canvas, first, box, paint) {
    this.box = box;
    this.camera = new View(first);
    this.board = new Board(canvas, paint);
    this.board.resized = () => this.fit();
    this.fit();
  }

  fit() {
    this.camera.center(this.box.center, this.box.half, FILLED, this.board.width, this.board.height);
  }

  /** Turn and tilt the view by angles [degrees]. */
  turn(angles) {
    this.camera.angles = angles;
    this.board.draw();
  }

  project(x) {
    return this.camera.toScreen(x);
  }

  /** The place under a point of the screen, as deep in the view as another place. */
  unproject(px, py, like = this.box.center) {
    const [x, y] = this.project(like);
    return this.camera.moved(like, px - x, py - y);
  }

  /** A line through places. */
  line(points, token, { width = 4, dash = [] } = {}) {
    const pixels = points.map((x) => this.project(x));
    line(this.board.context, pixels, { color: color(token), width, dash });
  }

  dot(x, token, { radius = RADIUS, edge = EDGE, hollow = false } = {}) {
    const [outer, inner] = hollow ? [token, "--surface"] : ["--surface", token];
    mark(this.board.context, this.project(x), "dot", radius + edge, color(outer));
    mark(this.board.context, this.project(x), "dot", radius - edge, color(inner));
  }

  /** A word beside a place: on the side where a path does not go on. */
  word(text, x, token, path) {
    const { context, width } = this.board;
    const [px, py] = this.project(x);
    const pixels = path.map((point) => this.project(point));
    const near = pixels.filter(([u, v]) => Math.abs(v - py) < 14 && Math.abs(u - px) < 60);
    const right = near.filter(([u]) => u > px).length;
    const left = px > width - 80 || (px > 80 && right > near.length - right);
    Object.assign(context, { font: `600 14px ${color("--font")}`, textAlign: left ? "right" : "left" });
    words(context, text, px + (left ? -1 : 1) * (RADIUS + 7), py + 5, color(token), color("--surface"));
  }
}

/** A place in the middle of what points cover, and half of how far they reach. @returns {Box} */
export function boxOf(points) {
  const [low, high] = bounds(points);
  const center = low.map((value, k) => (value + high[k]) / 2);
  return { center, half: Math.max(...high.map((value, k) => value - center[k])) || 1 };
}
