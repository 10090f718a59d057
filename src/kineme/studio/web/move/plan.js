// What the movement shall do: where from, where to, past what, how fast.

/**
 * @typedef {{at: number, point: number[]}} ViaPoint
 * @typedef {{center: number[], radius: number}} Obstacle
 *
 * @typedef {Object} Plan
 * @property {string} symbol
 * @property {number[]} start
 * @property {number[]} goal
 * @property {number[][]} path
 * @property {number[]} reach The demonstrated way from start to goal.
 * @property {number} usual The demonstrated duration [s].
 * @property {number} share By which the duration is stretched.
 * @property {number[]|null} style
 * @property {string} [styled] The formulation of the style.
 * @property {ViaPoint[]} via
 * @property {Obstacle[]} obstacles
 */

/**
 * The points of a plan, each a field of its owner; `list` is what it can be removed from.
 * @param {Plan} plan
 * @returns {{key: string, kind: string, name: string, owner: any, field: string, list?: Object[]}[]}
 */
export const pointsOf = (plan) => [
  { key: "start", kind: "start", name: "Start", owner: plan, field: "start" },
  { key: "goal", kind: "goal", name: "Goal", owner: plan, field: "goal" },
  ...plan.via.map((owner, k) => ({
    ...{ key: `via ${k}`, kind: "via", name: `Point ${k + 1}` },
    ...{ owner, field: "point", list: plan.via },
  })),
  ...plan.obstacles.map((owner, k) => ({
    ...{ key: `obstacle ${k}`, kind: "obstacle", name: `Obstacle ${k + 1}` },
    ...{ owner, field: "center", list: plan.obstacles },
  })),
];

/** From start to goal. @param {{start: number[], goal: number[]}} plan */
const way = ({ start, goal }) => goal.map((value, k) => value - start[k]);

/** The way from start to goal where it was dragged to another one, else null. @param {Plan} plan */
export function draggedWay(plan) {
  const to = way(plan);
  const least = 1e-6 * extent(plan.path);
  return to.some((value, k) => Math.abs(value - plan.reach[k]) > least) ? to : null;
}

/** The movement as it was shown. @param {any} symbol @param {any} rollout @returns {Plan} */
export function asShown(symbol, rollout) {
  const usual = rollout.times[rollout.times.length - 1] - rollout.times[0];
  return {
    symbol: symbol.id,
    start: [...rollout.start],
    goal: [...rollout.goal],
    path: rollout.recorded ?? rollout.positions,
    reach: way(rollout),
    usual,
    share: 1,
    style: null,
    via: [],
    obstacles: [],
  };
}

/** The size of the movement, for distances that fit it. @param {number[][]} path */
export function extent(path) {
  const spans = path[0].map(
    (_, k) => Math.max(...path.map((point) => point[k])) - Math.min(...path.map((point) => point[k])),
  );
  return Math.hypot(...spans) || 1;
}

/** @param {number[]} a @param {number[]} b */
export const distance = (a, b) => Math.hypot(...a.map((value, k) => value - b[k]));

/** Whether a path runs through an obstacle. @param {Obstacle} obstacle @param {number[][]} path */
export const isTouched = ({ center, radius }, path) => path.some((point) => distance(center, point) < 0.999 * radius);

/**
 * A coordinate as far as it matters in a movement of a size.
 * @param {number} value @param {number} size @returns {string}
 */
export const rounded = (value, size) =>
  String(Number(value.toFixed(Math.min(Math.max(Math.ceil(2.2 - Math.log10(size)), 0), 12))));

/** What moves: the prototype, or a style of its symbol. @param {Plan} plan */
export const what = (plan) =>
  plan.style ? { style: { symbol: plan.symbol, values: plan.style } } : { symbol: plan.symbol };

/** @param {Plan} plan @param {string} formulation @returns {any} A question to the server. */
export function question(plan, formulation) {
  const body = { what: what(plan), formulation, start: plan.start, goal: plan.goal, duration: plan.usual * plan.share };
  if (plan.via.length) body.via = [...plan.via].sort((a, b) => a.at - b.at).map(({ at, point }) => [at, point]);
  if (plan.obstacles.length) body.obstacles = plan.obstacles;
  return body;
}
