// The stage of Move: paths, obstacles, points in time; in space it turns.
import { Board, color } from "../parts/canvas.js";
import { followTurns } from "../parts/dragging.js";
import { byId } from "../parts/elements.js";
import { bounds, distance } from "../parts/geometry.js";
import { ground, line, mark } from "../parts/lines.js";
import { extent, isTouched } from "./plan.js";

const LEGEND_ROOM = 40; // at the lower edge [px]
const NEAR = { mouse: 12, pen: 16, touch: 24 }; // from the path, where it can be taken hold of [px]
const ENDS = 0.03; // of the duration: nearer to start and goal the path is theirs

export class MovePicture {
  constructor(camera, turned, grabbed) {
    this.camera = camera;
    this.paths = [];
    this.plan = null;
    this.time = null;
    this.under = null; // the place of the path under the pointer, a via point
    this.board = new Board(byId("move-canvas"), () => this.paint());
    this.board.resized = () => {
      this.fit();
      turned();
    };
    this.turned = turned;
    const { canvas } = this.board;
    canvas.addEventListener("pointermove", (event) => event.buttons || this.point(event));
    canvas.addEventListener("pointerleave", () => this.point(null));
    canvas.addEventListener("pointerdown", (event) => {
      this.point(event);
      if (this.under && event.button === 0) grabbed(this.under, event);
    });
    // The page does not scroll with a finger that holds the path.
    canvas.addEventListener("touchstart", (event) => this.under && event.preventDefault(), { passive: false });
    followTurns(canvas, this);
  }

  get turns() {
    return !this.camera.flat && !this.under;
  }

  /** Points that must be in the picture: those one can take hold of, and paths unless they run far away. */
  points() {
    const { path, start, goal, via, obstacles } = this.plan;
    const own = [start, goal, ...via.map(({ point }) => point), ...obstacles.map(({ center }) => center)];
    const around = [...path, ...own];
    const far = 1.5 * extent(around);
    const near = (point) => distance(point, path[0]) < far;
    return [...around, ...this.paths.flatMap(({ path: drawn }) => drawn.positions.filter(near))];
  }

  /** Find the place of the path under the pointer. */
  point(event) {
    const before = this.under;
    this.under = null;
    const drawn = this.paths[0]?.path.positions;
    if (event && drawn) {
      const away = drawn.map((point) => distance(this.camera.toScreen(point), [event.offsetX, event.offsetY]));
      const k = away.indexOf(Math.min(...away));
      const at = k / (drawn.length - 1);
      if (away[k] < NEAR[event.pointerType] && at > ENDS && at < 1 - ENDS) this.under = { at, point: [...drawn[k]] };
    }
    this.board.canvas.classList.toggle("grabs", this.under !== null);
    if (before?.at !== this.under?.at) this.board.draw();
  }

  /** The recorded path alone, until it is known how it moves. */
  sketch(path) {
    this.paths = [];
    this.plan = { path, start: path[0], goal: path.at(-1), via: [], obstacles: [] };
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
    const pixels = (rows) => rows.map((row) => this.camera.toScreen(row));
    if (!this.camera.flat) ground(context, this.camera, bounds(this.plan.path), color("--line"));
    for (const obstacle of this.plan.obstacles) this.paintObstacle(obstacle);
    line(context, pixels(this.plan.path), { color: color("--gray"), width: 7, alpha: 0.28 });
    for (const { path, look } of this.paths)
      line(context, pixels(path.positions), { color: color(look.color), width: 3.5, dash: look.dash });
    if (this.under) mark(context, this.camera.toScreen(this.under.point), "ring", 8, color("--predicted"));
    if (this.time !== null)
      for (const { path, look } of this.paths)
        mark(context, this.camera.toScreen(this.at(path)), "dot", 9, color(look.color));
  }

  paintObstacle(obstacle) {
    const { context } = this.board;
    const [at, radius] = [this.camera.toScreen(obstacle.center), obstacle.radius * this.camera.scale];
    const touched = this.paths.some(({ path }) => isTouched(obstacle, path.positions));
    const paint = color(touched ? "--failed" : "--purple");
    context.globalAlpha = touched ? 0.4 : 0.22;
    mark(context, at, "dot", radius, paint);
    context.globalAlpha = 1;
    mark(context, at, "ring", radius, paint);
  }

  /** Where a path is now; its samples are even in time. */
  at({ times, positions }) {
    const last = times.length - 1;
    const at = Math.min((last * this.time) / (times[last] - times[0]), last);
    const k = Math.min(Math.floor(at), last - 1);
    return positions[k].map((value, axis) => value + (at - k) * (positions[k + 1][axis] - value));
  }

  turn(dx, dy) {
    this.camera.turn(dx, dy);
    this.turned();
    this.board.draw();
  }
}
