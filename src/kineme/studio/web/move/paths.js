// The paths of the formulations: in the picture, in the plots, in the legend; and a dot that runs along each.
import { byId, fill, make, write } from "../parts/elements.js";
import { lengths } from "../parts/plots.js";
import { FORMULATIONS } from "./formulations.js";
import { movingFormulations } from "./session.js";

const STAYS = 0.4; // how long the dots stay at the goals [s]

/** @typedef {import("./session.js").Session} Session */

/** Bring what was dragged out of the picture back into it, once the hand lets go. @param {Session} session */
export function keepInSight({ dragging, picture, handles }) {
  if (dragging || !picture.losesAnything()) return;
  picture.fit();
  handles.place();
}

/** Show the newest paths. @param {Session} session */
export function showPaths(session) {
  const { plan, rollouts, picture } = session;
  if (!plan) return;
  const names = movingFormulations(session);
  picture.paths = FORMULATIONS.filter(({ name }) => names.includes(name) && rollouts.get(name).path).map(
    (formulation) => ({ ...formulation, path: rollouts.get(formulation.name).path }),
  );
  keepInSight(session);
  picture.board.draw();
  const curves = (/** @type {"velocities"|"accelerations"} */ rates) =>
    picture.paths.map(({ path, look }) => ({ times: path.times, values: lengths(path[rates]), look }));
  session.speed.show(curves("velocities"));
  session.acceleration.show(curves("accelerations"));
  showLegend(session);
  showWarnings(names.map((name) => rollouts.get(name)));
}

/** Say what is wrong with paths, each once. @param {import("./rollouts.js").Rollouts[]} rollouts */
function showWarnings(rollouts) {
  const warnings = rollouts.flatMap(({ problem, path }) => [problem, ...(path?.warnings ?? [])]).filter(Boolean);
  write(byId("move-warnings"), [...new Set(warnings)].join("; "));
}

/**
 * Name the paths. While they follow the hand the names stay the same, and are not written anew.
 * @param {Session} session
 */
function showLegend(session) {
  const { paths } = session.picture;
  const names = paths.map(({ name }) => name).join();
  if (session.legend === names) return;
  session.legend = names;
  fill(
    byId("move-legend"),
    make("li", {}, make("span", { class: "key recorded" }), "recorded"),
    ...paths.map(({ name, key }) =>
      make("li", {}, make("span", { class: `key ${key}` }), paths.length > 1 ? name : "now"),
    ),
  );
}

/** Let a dot run along each path, in its own time. @param {Session} session */
export function play(session) {
  const { picture, speed, acceleration } = session;
  if (!picture.paths.length) return;
  const start = performance.now();
  const playback = {};
  session.playback = playback;
  const step = (/** @type {number} */ now) => {
    if (session.playback !== playback) return;
    const time = Math.max(now - start, 0) / 1000;
    const over = picture.paths.every(({ path }) => time > path.times[path.times.length - 1] - path.times[0] + STAYS);
    picture.time = speed.cursor = acceleration.cursor = over ? null : time;
    for (const { board } of [picture, speed, acceleration]) board.now();
    if (!over) requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}
