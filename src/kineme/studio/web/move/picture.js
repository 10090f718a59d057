// The stage of Move: paths, obstacles, points in time; in space it turns.
import { Board, color } from "../parts/canvas.js";
import { ground, line, mark } from "../parts/lines.js";
import { byId } from "../parts/elements.js";
import { followTurns } from "../parts/dragging.js";
import { extent } from "./plan.js";

const LEGEND_ROOM = 40; // at the lower edge [px]

export class MovePicture {
  /** @param {import("../parts/camera.js").Camera} camera @param {() => void} turned */
  constructor(camera, turned) {
    this.camera = camera;
    this.paths = [];
    this.plan = null;
    this.time = null;
    this.board = new Board(byId("move-canvas"), () => this.paint());
    this.board.resized = () => {
      this.fit();
      turned();
    };
    this.turned = turned;
    followTurns(
      this.board.canvas,
      () => !this.camera.flat,
      (dx, dy) => this.turn(dx, dy),
    );
  }

  /** Points that must be in the picture: those one can take hold of, and paths unless they run far away. */
  points() {
    const { path, start, goal, via, obstacles } = this.plan;
    const own = [
      start,
      goal,
      ...via.map((/** @type {any} */ { point }) => point),
      ...obstacles.map((/** @type {any} */ { center }) => center),
    ];
    const around = [...path, ...own];
    const far = 1.5 * extent(around);
    const near = (/** @type {number[]} */ point) => Math.hypot(...point.map((value, k) => value - path[0][k])) < far;
    return [...around, ...this.paths.flatMap(({ path: drawn }) => drawn.positions.filter(near))];
  }

  /** The recorded path alone, until it is known how it moves. @param {number[][]} path */
  sketch(path) {
    this.paths = [];
    this.plan = { path, start: path[0], goal: path[path.length - 1], via: [], obstacles: [] };
    this.fit();
  }

  /** Show the whole movement. */
  fit() {
    if (!this.plan) return;
    this.camera.fit(this.points(), this.board.width, this.board.height - LEGEND_ROOM);
    this.board.canvas.tabIndex = this.camera.flat ? -1 : 0;
    this.board.draw();
  }

  /** Whether a point lies out of the picture. */
  losesAnything() {
    if (!this.plan || !this.board.width) return false;
    return this.points().some((point) => {
      const [x, y] = this.camera.toScreen(point);
      return x < 12 || y < 12 || x > this.board.width - 12 || y > this.board.height - 12;
    });
  }

  paint() {
    const { context } = this.board;
    if (!this.plan) return;
    const pixels = (/** @type {number[][]} */ rows) => rows.map((row) => this.camera.toScreen(row));
    if (!this.camera.flat) this.ground();
    for (const { center, radius } of this.plan.obstacles)
      this.obstacle(this.camera.toScreen(center), radius * this.camera.scale);
    line(context, pixels(this.plan.path), { color: color("--gray"), width: 7, alpha: 0.28 });
    for (const { path, look } of this.paths)
      line(context, pixels(path.positions), { color: color(look.color), width: 3.5, dash: look.dash });
    if (this.time !== null)
      for (const { path, look } of this.paths)
        mark(context, this.camera.toScreen(this.at(path)), "dot", 9, color(look.color));
  }

  /** @param {number[]} at @param {number} radius [px] */
  obstacle(at, radius) {
    const { context } = this.board;
    context.globalAlpha = 0.22;
    mark(context, at, "dot", radius, color("--purple"));
    context.globalAlpha = 1;
    mark(context, at, "ring", radius, color("--purple"));
  }

  /** A grid below a movement in space, so that one sees how it lies. */
  ground() {
    const { path } = this.plan;
    const low = [0, 1, 2].map((k) => Math.min(...path.map((/** @type {number[]} */ p) => p[k])));
    const high = [0, 1, 2].map((k) => Math.max(...path.map((/** @type {number[]} */ p) => p[k])));
    ground(this.board.context, this.camera, low, high, color("--line"));
  }

  /** Where a path is now. @param {any} path */
  at(path) {
    const next = path.times.findIndex((/** @type {number} */ t) => t - path.times[0] >= this.time);
    if (next < 0) return path.positions[path.positions.length - 1];
    if (next === 0) return path.positions[0];
    const [before, after] = [path.times[next - 1] - path.times[0], path.times[next] - path.times[0]];
    const share = (this.time - before) / (after - before);
    return path.positions[next].map(
      (/** @type {number} */ value, /** @type {number} */ k) =>
        path.positions[next - 1][k] + share * (value - path.positions[next - 1][k]),
    );
  }

  turn(/** @type {number} */ dx, /** @type {number} */ dy) {
    this.camera.turn(dx, dy);
    this.turned();
    this.board.draw();
  }
}
