// A grid below a movement in space, so that one sees how it lies.
import { color } from "./canvas.js";
import { line } from "./lines.js";

const CELLS = 6;

/**
 * @param {CanvasRenderingContext2D} context
 * @param {import("./camera.js").Camera} camera
 * @param {number[]} low Corner.
 * @param {number[]} high
 */
export function ground(context, camera, low, high) {
  for (let k = 0; k <= CELLS; k += 1) {
    const [x, y] = [0, 1].map((axis) => low[axis] + ((high[axis] - low[axis]) * k) / CELLS);
    for (const ends of [
      [
        [x, low[1]],
        [x, high[1]],
      ],
      [
        [low[0], y],
        [high[0], y],
      ],
    ])
      line(
        context,
        ends.map(([a, b]) => camera.toScreen([a, b, low[2]])),
        { color: color("--line"), width: 1 },
      );
  }
}
