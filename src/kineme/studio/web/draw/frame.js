// What the canvas shows of a movement that was not drawn on it: wide enough from the start, wider when it leaves.
import { Camera } from "../parts/camera.js";

const WIDER = 0.25; // of the size, on the side on which it leaves

export class Frame {
  /** The size is that of a usual movement; it may be like one of the paths. */
  constructor(size, paths) {
    this.camera = new Camera();
    this.camera.face(paths);
    this.size = size;
    this.low = [];
    this.high = [];
  }

  /** Whether the movement is in space and can be turned. */
  get turns() {
    return !this.camera.flat;
  }

  /** Let points be seen. */
  include(points, board) {
    for (const point of points) this.grow(point.slice(0, 3));
    if (this.low.length) this.camera.fit([this.low, this.high], board.width, board.height);
  }

  grow(point) {
    if (!this.low.length)
      [this.low, this.high] = [-0.5, 0.5].map((share) => point.map((value) => value + share * this.size));
    point.forEach((value, k) => {
      const more = WIDER * (this.high[k] - this.low[k]);
      if (value < this.low[k]) this.low[k] = value - more;
      if (value > this.high[k]) this.high[k] = value + more;
    });
  }
}
