// A signal over time as lines; what is no number is a gap.
import { line } from "../parts/lines.js";

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number[]} x Of the samples [px].
 * @param {(number|null)[]} values
 * @param {number[]} lane Its top and its bottom [px].
 * @param {{color: string, width: number}} look
 */
export function signal(context, x, values, [top, bottom], look) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value === null) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  const scale = (bottom - top) / (high - low || 1);
  let points = [];
  for (const [k, value] of values.entries()) {
    if (value !== null) points.push([x[k], bottom - scale * (value - low)]);
    else if (points.length) {
      line(context, points, look);
      points = [];
    }
  }
  line(context, points, look);
}
