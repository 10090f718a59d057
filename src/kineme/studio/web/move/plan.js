// What the movement shall do: where from, where to, past what, how fast.
import { clamp, distance, spans } from "../parts/geometry.js";

/** @param {Plan} plan @returns {PlanPoint[]} */
export const pointsOf = (plan) => [
  { key: "start", kind: "start", name: "Start", owner: plan, field: "start" },
  { key: "goal", kind: "goal", name: "Goal", owner: plan, field: "goal" },
  ...listed("via", "Point", "point", plan.via),
  ...listed("obstacle", "Obstacle", "center", plan.obstacles),
];

const listed = (kind, name, field, list) =>
  list.map((owner, k) => ({ key: `${kind} ${k}`, kind, name: `${name} ${k + 1}`, owner, field, list }));

/** From start to goal. */
const way = ({ start, goal }) => goal.map((value, k) => value - start[k]);

/** The way from start to goal where it was dragged to another one, else null. @param {Plan} plan */
export function draggedWay(plan) {
  const to = way(plan);
  const least = 1e-6 * extent(plan.path);
  return to.some((value, k) => Math.abs(value - plan.reach[k]) > least) ? to : null;
}

/** The movement as it was shown. @returns {Plan} */
export const asShown = (symbol, rollout) => ({
  symbol: symbol.id,
  start: [...rollout.start],
  goal: [...rollout.goal],
  path: rollout.recorded ?? rollout.positions,
  reach: way(rollout),
  usual: rollout.times.at(-1) - rollout.times[0],
  ...{ share: 1, style: null, via: [], obstacles: [] },
});

/** The size of the movement, for distances that fit it. */
export const extent = (path) => Math.hypot(...spans(path)) || 1;

/** Whether a path runs through an obstacle. */
export const isTouched = ({ center, radius }, path) => path.some((point) => distance(center, point) < 0.999 * radius);

/** A coordinate as far as it matters in a movement of a size. */
export const rounded = (value, size) => String(Number(value.toFixed(clamp(Math.ceil(2.2 - Math.log10(size)), 0, 12))));

/** What moves: the prototype, or a style of its symbol. @param {Plan} plan */
export const what = (plan) =>
  plan.style ? { style: { symbol: plan.symbol, values: plan.style } } : { symbol: plan.symbol };

/** A question to the server. @param {Plan} plan */
export function question(plan, formulation) {
  const { start, goal, usual, share, obstacles } = plan;
  const via = plan.via.toSorted((a, b) => a.at - b.at).map(({ at, point }) => [at, point]);
  const past = { ...(via.length && { via }), ...(obstacles.length && { obstacles }) };
  return { what: what(plan), formulation, start, goal, in_turn: false, duration: usual * share, ...past };
}
