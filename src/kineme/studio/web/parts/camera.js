// From coordinates to pixels: straight from above in the plane; in space orthographic, turned by dragging.
import { axesOf, facing, OBLIQUE } from "./facing.js";

const MARGIN = 0.14; // of the smaller side

export class Camera {
  constructor() {
    this.flat = true;
    this.around = OBLIQUE.around;
    this.above = OBLIQUE.above;
    this.scale = 1;
    this.middle = [0, 0, 0];
    this.size = [1, 1];
  }

  /** Look from where paths are seen best. @param {number[][][]} paths */
  face(paths) {
    if (paths[0]?.[0].length >= 3) Object.assign(this, facing(paths));
  }

  /** Directions on the screen: right and up. */
  axes() {
    return axesOf(this.flat ? { around: 0, above: Math.PI / 2 } : this);
  }

  /** Show all of the points. @param {number[][]} points @param {number} width @param {number} height */
  fit(points, width, height) {
    this.size = [width, height];
    if (!points.length || !width) return;
    this.flat = points[0].length < 3;
    const low = [0, 1, 2].map((k) => Math.min(...points.map((point) => point[k] ?? 0)));
    const high = [0, 1, 2].map((k) => Math.max(...points.map((point) => point[k] ?? 0)));
    this.middle = low.map((value, k) => (value + high[k]) / 2);
    const room = 1 - 2 * MARGIN;
    const spans = high.map((value, k) => value - low[k]);
    const away = (/** @type {number[]} */ point) =>
      Math.hypot(...this.middle.map((value, k) => (point[k] ?? 0) - value));
    const round = this.flat ? 0 : 2 * Math.max(...points.map(away));
    const across = this.flat ? spans : [round, round];
    this.scale = Math.min((room * width) / Math.max(across[0], 1e-9), (room * height) / Math.max(across[1], 1e-9));
  }

  /**
   * Show a place in the middle, and as much around it as fills a share of the smaller side.
   * @param {number[]} middle @param {number} radius @param {number} share @param {number} width @param {number} height
   */
  center(middle, radius, share, width, height) {
    this.size = [width, height];
    this.flat = middle.length < 3;
    this.middle = [0, 1, 2].map((k) => middle[k] ?? 0);
    this.scale = (share * Math.min(width, height)) / (2 * radius);
  }

  /** @param {number[]} point @returns {number[]} Pixels. */
  toScreen(point) {
    const { right, up } = this.axes();
    const away = [0, 1, 2].map((k) => (point[k] ?? 0) - this.middle[k]);
    const dot = (/** @type {number[]} */ axis) => axis[0] * away[0] + axis[1] * away[1] + axis[2] * away[2];
    return [this.size[0] / 2 + this.scale * dot(right), this.size[1] / 2 - this.scale * dot(up)];
  }

  /**
   * A point moved by pixels, in the plane of the screen.
   * @param {number[]} point @param {number} dx @param {number} dy
   */
  moved(point, dx, dy) {
    const { right, up } = this.axes();
    return point.map((value, k) => (k < 3 ? value + (right[k] * dx - up[k] * dy) / this.scale : value));
  }

  /** @param {number} dx Pixels. @param {number} dy */
  turn(dx, dy) {
    this.around -= 0.008 * dx;
    this.above = Math.min(Math.max(this.above + 0.008 * dy, -1.5), 1.5);
  }
}
