// A signal over time as lines; what is no number is a gap.
import { line } from "../parts/lines.js";

/** Values of samples at x, in a lane from top to bottom [px]. */
export function signal(context, x, values, [top, bottom], look) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    low = Math.min(low, value ?? low);
    high = Math.max(high, value ?? high);
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
