// What moves on the stage: a known movement or one that was drawn, with its start, goal and via points.

import { distance } from "../web/parts/geometry.js";
import { boxOf } from "./stage.js";

const NEAR = 26; // CSS pixels within which a point is taken hold of
const NEAR_PATH = 14;
const ENDS = 0.06; // share of the time next to start and goal where there are no via points
const APART = 0.08; // least time between two via points
const MOST_VIA = 3;

/** Start and goal of a symbol where it was learned, moved to the middle of a box. @param {OpenedSnapshot} backend */
export function placed({ runtime, generate }, name, box) {
  const { positions } = generate({ what: { symbol: name } });
  const primitive = runtime.primitive(name);
  const shift = runtime.header.comparison.translation
    ? boxOf(positions).center.map((c, k) => box.center[k] - c)
    : box.center.map(() => 0);
  const moved = (x) => x.map((value, k) => value + shift[k]);
  return { start: moved(primitive.start), goal: moved(primitive.goal) };
}

/** A movement that can be changed. @param {OpenedSnapshot} backend */
export function createMoving({ runtime, generate }, name, what, place) {
  let { start, goal } = place;
  let [via, formulation] = [[], runtime.header.movements.formulation];
  let rollout = null;

  function update(change) {
    const before = { start, goal, via, formulation };
    ({ start = start, goal = goal, via = via, formulation = formulation } = change);
    try {
      rollout = generate({ what, formulation, start, goal, via });
      return null;
    } catch (error) {
      // as a closed movement that cannot be scaled, or via points too close together
      ({ start, goal, via, formulation } = before);
      return error.message;
    }
  }
  const problem = update({});
  if (problem) throw new Error(problem);

  /** What is under a point of the screen: start, goal, a via point, a place on the path; null for nothing. */
  function held(stage, at) {
    const gap = (x) => distance(stage.project(x), at);
    const [toStart, toGoal] = [gap(start), gap(goal)];
    if (Math.min(toStart, toGoal) < NEAR) return { what: toStart < toGoal ? "start" : "goal" };
    const point = via.find(([, x]) => gap(x) < NEAR);
    if (point) return { what: "via", time: point[0] };
    const away = rollout.positions.map(gap);
    const nearest = away.indexOf(Math.min(...away));
    const time = nearest / (away.length - 1);
    const free = time > ENDS && time < 1 - ENDS && via.every(([other]) => Math.abs(other - time) > APART);
    return away[nearest] < NEAR_PATH && free && via.length < MOST_VIA ? { what: "via", time } : null;
  }

  /** Move what is held to a place; an error in words, or null. */
  function drag({ what: part, time }, x) {
    if (part !== "via") return update({ [part]: x });
    const others = via.filter(([other]) => other !== time);
    return update({ via: [...others, [time, x]].sort((a, b) => a[0] - b[0]) });
  }

  return {
    name,
    update,
    held,
    drag,
    get start() {
      return start;
    },
    get goal() {
      return goal;
    },
    get via() {
      return via;
    },
    get positions() {
      return rollout.positions;
    },
    get times() {
      return rollout.times;
    },
  };
}
