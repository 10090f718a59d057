// The movement that Move shows: its plan, how it moves in each formulation, and the parts of the view that show it.
import { Camera } from "../parts/camera.js";
import { byId } from "../parts/elements.js";
import { Plot } from "../parts/plots.js";
import { FORMULATIONS } from "./formulations.js";
import { Handles } from "./handles.js";
import { MovePicture } from "./picture.js";
import { extent, rounded } from "./plan.js";
import { Rollouts } from "./rollouts.js";
import { Steps } from "./steps.js";

/**
 * @typedef {Object} Session
 * @property {import("./plan.js").Plan|null} plan
 * @property {{id: string}|null} chosen The symbol that moves; another object whenever it starts anew.
 * @property {number} version Of the library when the symbol was chosen.
 * @property {boolean} dragging A point is held.
 * @property {Steps} steps
 * @property {Camera} camera
 * @property {Handles} handles
 * @property {MovePicture} picture
 * @property {Plot} speed
 * @property {Plot} acceleration
 * @property {Set<string>} ticked Formulations.
 * @property {Map<string, Rollouts>} rollouts Of each formulation.
 * @property {string|null} legend Formulations in it.
 * @property {Object} playback That is under way.
 * @property {number} resting Timer that waits until a style slider rests.
 */

/**
 * @param {Object} page
 * @param {(session: Session) => void} page.moved A path is another one.
 * @param {(session: Session, dragging: boolean) => void} page.dragged A point is held, or let go.
 * @param {(session: Session, place: import("./plan.js").ViaPoint, event: PointerEvent) => void} page.grabbed
 * @returns {Session}
 */
export function createSession(page) {
  const camera = new Camera();
  const handles = new Handles(camera, {
    moving: (dragging) => page.dragged(session, dragging),
    text: (value) => rounded(value, extent(session.plan.path)),
  });
  /** @type {Session} */
  const session = {
    plan: null,
    chosen: null,
    version: -1,
    dragging: false,
    steps: new Steps(),
    camera,
    handles,
    picture: new MovePicture(
      camera,
      () => handles.place(),
      (place, event) => session.plan && page.grabbed(session, place, event),
    ),
    speed: new Plot(byId("plot-speed")),
    acceleration: new Plot(byId("plot-acceleration")),
    ticked: new Set([FORMULATIONS[0].name]),
    rollouts: new Map(FORMULATIONS.map(({ name }) => [name, new Rollouts(name, () => page.moved(session))])),
    legend: null,
    playback: {},
    resting: 0,
  };
  return session;
}

/** Formulations that move: those that are ticked; a style moves in its own alone. @param {Session} session */
export const movingFormulations = ({ plan, ticked }) => (plan?.style ? [plan.styled] : [...ticked]);
