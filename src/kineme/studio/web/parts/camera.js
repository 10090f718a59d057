// From coordinates to pixels: straight from above in the plane; in space orthographic, turned by dragging.
import { axesOf, facing, OBLIQUE } from "./facing.js";
import { bounds, clamp, distance, spans } from "./geometry.js";

const MARGIN = 0.14; // of the smaller side
const ABOVE = { around: 0, above: Math.PI / 2 };

const inSpace = (point) => [0, 1, 2].map((k) => point[k] ?? 0);

export class Camera {
  constructor() {
    this.around = OBLIQUE.around;
    this.above = OBLIQUE.above;
    this.flat = true;
    this.scale = 1;
    this.middle = [0, 0, 0];
    this.size = [1, 1];
  }

  /** Look from where paths are seen best. */
  face(paths) {
    if (paths[0]?.[0].length >= 3) Object.assign(this, facing(paths));
  }

  /** Directions on the screen: right and up. */
  axes() {
    return axesOf(this.flat ? ABOVE : this);
  }

  /** Show all of the points. */
  fit(points, width, height) {
    this.size = [width, height];
    if (!points.length || !width) return;
    this.flat = points[0].length < 3;
    const placed = points.map(inSpace);
    const [low, high] = bounds(placed);
    this.middle = low.map((value, k) => (value + high[k]) / 2);
    const round = 2 * Math.max(...placed.map((point) => distance(point, this.middle)));
    const [across, along] = this.flat ? spans(placed) : [round, round];
    const room = 1 - 2 * MARGIN;
    this.scale = Math.min((room * width) / Math.max(across, 1e-9), (room * height) / Math.max(along, 1e-9));
  }

  /** Show a place in the middle, and as much around it as fills a share of the smaller side. */
  center(middle, radius, share, width, height) {
    this.size = [width, height];
    this.flat = middle.length < 3;
    this.middle = inSpace(middle);
    this.scale = (share * Math.min(width, height)) / (2 * radius);
  }

  /** @returns Pixels. */
  toScreen(point) {
    const { right, up } = this.axes();
    const away = inSpace(point).map((value, k) => value - this.middle[k]);
    const dot = (axis) => axis[0] * away[0] + axis[1] * away[1] + axis[2] * away[2];
    return [this.size[0] / 2 + this.scale * dot(right), this.size[1] / 2 - this.scale * dot(up)];
  }

  /** A point moved by pixels, in the plane of the screen. */
  moved(point, dx, dy) {
    const { right, up } = this.axes();
    return point.map((value, k) => (k < 3 ? value + (right[k] * dx - up[k] * dy) / this.scale : value));
  }

  /** Turn by pixels. */
  turn(dx, dy) {
    this.around -= 0.008 * dx;
    this.above = clamp(this.above + 0.008 * dy, -1.5, 1.5);
  }
}
