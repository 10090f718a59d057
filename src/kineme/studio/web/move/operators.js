// The path as a sum: positions = a(t) start + b(t) goal + c(t). It follows the hand without asking anyone.
import { post } from "../parts/api.js";

/** @typedef {{times: number[], of_start: number[], of_goal: number[], constant: number[][]}} Operators */

/** @type {Map<string, Promise<Operators|null>>} */
const known = new Map();

/** @param {any} what @param {string} formulation @param {number} version Of the library. @returns {Promise<Operators|null>} */
export function operatorsOf(what, formulation, version) {
  const key = JSON.stringify([what, formulation, version]);
  if (!known.has(key)) {
    if (known.size > 60) known.clear();
    known.set(key, post("/api/rollout/operators", { what, formulation }).catch(() => null));
  }
  return /** @type {Promise<Operators|null>} */ (known.get(key));
}

/** @param {Operators} operators @param {number[]} start @param {number[]} goal @param {number} share Of the duration. */
export function evaluate(operators, start, goal, share) {
  const positions = operators.constant.map((row, t) => row.map((value, k) => value + operators.of_start[t] * start[k] + operators.of_goal[t] * goal[k]));
  const times = operators.times.map((time) => time * share);
  const velocities = slopes(times, positions);
  return { times, positions, velocities, accelerations: slopes(times, velocities), warnings: [] };
}

/** Central differences. @param {number[]} times @param {number[][]} rows */
function slopes(times, rows) {
  const last = rows.length - 1;
  return rows.map((_, t) => {
    const [before, after] = [Math.max(t - 1, 0), Math.min(t + 1, last)];
    return rows[t].map((__, k) => (rows[after][k] - rows[before][k]) / (times[after] - times[before]));
  });
}
