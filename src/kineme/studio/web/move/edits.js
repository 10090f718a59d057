// The plan is edited: its points are dragged, typed, added and removed, its duration is stretched; each step can be
// taken back.
import { dragGoal } from "../parts/chosen.js";
import { byId } from "../parts/elements.js";
import { say } from "../parts/toasts.js";
import { handlesOf } from "./handles.js";
import { keepInSight } from "./paths.js";
import { draggedWay, extent } from "./plan.js";
import { showPoints } from "./points.js";
import { movingFormulations } from "./session.js";

const VIA_TIMES = [0.5, 0.25, 0.75, 0.375, 0.625, 0.125, 0.875]; // of new via points, shares of the duration
const OBSTACLE = { time: 0.6, away: 0.08, radius: 0.07 }; // beside the path, in sizes of the movement
const SAME = 0.04; // of the duration: a place of the path so near to a via point takes hold of that one
const LONGEST = 4; // times the demonstrated duration; the shortest is as many times less

/** What hears of points that changed, or went away. @param {MoveSession} session @returns {PointsPage} */
const pageOf = (session) => ({
  changed: () => showChange(session),
  removed: (list, point) => {
    list.splice(list.indexOf(point), 1);
    showStructure(session);
  },
});

/** Points came or went. @param {MoveSession} session */
export function showStructure(session) {
  session.handles.set(handlesOf(session.plan, session.camera, pageOf(session)));
  showChange(session);
}

/** A point or the duration is another one. @param {MoveSession} session */
export function showChange(session) {
  const { plan } = session;
  keepInSight(session);
  session.handles.place();
  byId("duration-text").textContent = `${(plan.usual * plan.share).toFixed(2)} s`;
  for (const name of movingFormulations(session)) session.rollouts.get(name).follow(plan);
  session.picture.board.draw();
  dragGoal(plan.symbol, draggedWay(plan));
  if (!session.dragging) showNumbers(session);
}

/** @param {MoveSession} session */
function showNumbers(session) {
  const { steps } = session;
  const { start, goal, via, obstacles, share } = session.plan;
  steps.keep({ start, goal, via, obstacles, share });
  byId("move-undo").disabled = !steps.has(-1);
  byId("move-redo").disabled = !steps.has(1);
  byId("move-reset").disabled = steps.states.length < 2 && !session.plan.style;
  showPoints(session.plan, pageOf(session));
}

/** A point is held, or let go. @param {MoveSession} session */
export function showDragging(session, dragging) {
  session.dragging = dragging;
  byId("move-stage").classList.toggle("dragging", dragging);
  if (dragging || !session.plan) return;
  showNumbers(session);
  keepInSight(session);
}

/** Stretch the movement: from a quarter of the demonstrated duration to four times it. @param {MoveSession} session */
export function stretch(session) {
  if (!session.plan) return;
  session.plan.share = LONGEST ** (byId("duration").valueAsNumber / 100);
  showChange(session);
}

/** Go back before the last change of a point or the duration, or with 1 forth again. @param {MoveSession} session */
export function step(session, by) {
  const { plan, steps } = session;
  if (!plan || !steps.has(by)) {
    if (by < 0) say("Nothing is changed here. The arrow in the bar takes back changes of the library.");
    return;
  }
  Object.assign(plan, steps.go(by));
  byId("duration").valueAsNumber = (100 * Math.log(plan.share)) / Math.log(LONGEST);
  showStructure(session);
}

/** A point of the path that is shown, or of the recording as long as there is none; time is a share of the duration. */
function pointAt({ picture, plan }, time) {
  const points = picture.paths[0]?.path.positions ?? plan.path;
  return [...points[Math.round(time * (points.length - 1))]];
}

/** The path itself is taken hold of: where it is grabbed becomes a via point. @param {MoveSession} session */
export function grabPath(session, place, event) {
  const { plan, handles } = session;
  let k = plan.via.findIndex(({ at }) => Math.abs(at - place.at) < SAME);
  if (k < 0) {
    k = plan.via.push(place) - 1;
    session.dragging = true; // one step, with what follows
    showStructure(session);
  }
  handles.grab(handles.grips.get(`via ${k}`), event);
}

/** @param {MoveSession} session */
export function addVia(session) {
  const { plan, handles } = session;
  if (!plan) return;
  const at = VIA_TIMES[plan.via.length % VIA_TIMES.length];
  plan.via.push({ at, point: pointAt(session, at) });
  showStructure(session);
  handles.focus(`via ${plan.via.length - 1}`);
}

/** @param {MoveSession} session */
export function addObstacle(session) {
  const { plan, handles } = session;
  if (!plan) return;
  const size = extent(plan.path);
  const center = pointAt(session, OBSTACLE.time).map((value, k) => value + (k < 2 ? OBSTACLE.away * size : 0));
  plan.obstacles.push({ center, radius: OBSTACLE.radius * size });
  showStructure(session);
  handles.focus(`obstacle ${plan.obstacles.length - 1}`);
}
