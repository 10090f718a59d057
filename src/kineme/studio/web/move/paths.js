// The paths of the formulations: in the picture, in the plots, in the legend; and a dot that runs along each.
import { byId, fill, make, write } from "../parts/elements.js";
import { FORMULATIONS } from "./formulations.js";
import { movingFormulations } from "./session.js";

const STAYS = 0.4; // how long the dots stay at the goals [s]

/** Bring what was dragged out of the picture back into it, once the hand lets go. @param {MoveSession} session */
export function keepInSight({ dragging, picture, handles }) {
  if (dragging || !picture.losesAnything()) return;
  picture.fit();
  handles.place();
}

/** Show the newest paths. @param {MoveSession} session */
export function showPaths(session) {
  const { plan, rollouts, picture } = session;
  if (!plan) return;
  const names = movingFormulations(session);
  picture.paths = FORMULATIONS.map((formulation) => ({
    ...formulation,
    path: rollouts.get(formulation.name).path,
  })).filter(({ name, path }) => names.includes(name) && path);
  keepInSight(session);
  picture.board.draw();
  const lengths = (rows) => rows.map((row) => Math.hypot(...row));
  const curves = (rates) =>
    picture.paths.map(({ path, look }) => ({ times: path.times, values: lengths(path[rates]), look }));
  session.speed.show(curves("velocities"));
  session.acceleration.show(curves("accelerations"));
  showLegend(session);
  const all = names.map((name) => rollouts.get(name));
  const warnings = all.flatMap(({ problem, path }) => [problem, ...(path?.warnings ?? [])]).filter(Boolean);
  write(byId("move-warnings"), [...new Set(warnings)].join("; ")); // each once
}

/** Name the paths; while they follow the hand, the names are not written anew. @param {MoveSession} session */
function showLegend(session) {
  const { paths } = session.picture;
  const names = paths.map(({ name }) => name).join();
  if (session.legend === names) return;
  session.legend = names;
  const item = (key, name) => make("li", {}, make("span", `key ${key}`), name);
  const items = paths.map(({ name, key }) => item(key, paths.length > 1 ? name : "now"));
  fill(byId("move-legend"), item("recorded", "recorded"), ...items);
}

/** Let a dot run along each path, in its own time. @param {MoveSession} session */
export function play(session) {
  const { picture, speed, acceleration } = session;
  if (!picture.paths.length) return;
  picture.board.run((time) => {
    const over = picture.paths.every(({ path }) => time > path.times.at(-1) - path.times[0] + STAYS);
    picture.time = speed.cursor = acceleration.cursor = over ? null : time;
    for (const { board } of [picture, speed, acceleration]) board.now();
    return !over;
  });
}
