// The movement that is on the canvas: under way, over, named; and the parts of the view that show it.
import { AnswerPanel } from "../parts/answer_panel.js";
import { byId } from "../parts/elements.js";
import { isLoaded, symbolNamed } from "../parts/library_state.js";
import { server } from "../parts/server.js";
import { showInvitation } from "./invitation.js";
import { Picture } from "./picture.js";

export const FEWEST_SAMPLES = 4; // that make a movement

/**
 * @typedef {import("../parts/server.js").Movement} Movement
 *
 * @typedef {Object} Session
 * @property {Picture} picture
 * @property {AnswerPanel} panel
 * @property {import("../parts/sending.js").Sending} sending
 * @property {import("./naming.js").Naming|null} naming
 * @property {boolean} drawing The pen is down.
 * @property {boolean} pending The movement is over, and its answer is still to come.
 * @property {Movement|null} movement That is over: it can be learned.
 * @property {{movement: Movement, name: string|null, members: number}|null} learned From this drawing; so many had the name
 *   then.
 * @property {string} pointer What draws: mouse, pen, touch, keyboard or program.
 * @property {number} height Of the canvas, in the units of the library.
 * @property {string|null} label
 * @property {import("./sources.js").Source|null} source The program whose movement is shown.
 * @property {string} dismissed The movement of a program that is not shown again.
 */

/** @param {(message: Object) => boolean} send @returns {Session} */
export const createSession = (send) => ({
  picture: new Picture(byId("draw-canvas")),
  panel: new AnswerPanel({ picture: (name) => symbolNamed(name)?.path ?? null }),
  sending: server.follow(send),
  naming: null,
  drawing: false,
  pending: false,
  movement: null,
  learned: null,
  pointer: "",
  height: 1,
  label: null,
  source: null,
  dismissed: "",
});

/** A key of the movement that a program sends. @param {import("./sources.js").Source} source */
export const keyOf = (source) => `${source.id} ${source.movement}`;

/** Samples, each a time and coordinates, as a movement. @param {number[][]} samples @returns {Movement} */
export const movementOf = (samples) => ({
  times: samples.map(([time]) => time),
  positions: samples.map(([, ...point]) => point),
});

/** Empty the canvas; the movement of a program that was on it does not come back. @param {Session} session */
export function clear(session) {
  const { picture } = session;
  if (session.source) session.dismissed = keyOf(session.source);
  byId("sources").classList.remove("waits");
  Object.assign(picture, { ink: [], rest: [], height: null, replayed: null, frame: null });
  picture.board.draw();
  Object.assign(session, { source: null, movement: null, learned: null, label: null });
  Object.assign(session, { pending: false, drawing: false });
  session.panel.idle();
  session.naming.allow(false);
  session.naming.empty();
  byId("draw-clear").disabled = byId("draw-replay").disabled = byId("draw-move").disabled = true;
  if (isLoaded()) showInvitation(false);
}
