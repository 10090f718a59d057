// The movement that is on the canvas: under way, over, named; and the parts of the view that show it.
import { AnswerPanel } from "../parts/answer_panel.js";
import { byId } from "../parts/elements.js";
import { isLoaded, symbolNamed } from "../parts/library_state.js";
import { server } from "../parts/server.js";
import { showInvitation } from "./invitation.js";
import { Picture } from "./picture.js";

export const FEWEST_SAMPLES = 4; // that make a movement

const NOTHING = { source: null, movement: null, learned: null, label: null, pending: false, drawing: false };

/** @returns {DrawSession} */
export const createSession = (send) => ({
  picture: new Picture(byId("draw-canvas")),
  panel: new AnswerPanel({ picture: (name) => symbolNamed(name)?.path ?? null }),
  sending: server.follow(send),
  naming: null,
  ...{ pointer: "", height: 1, dismissed: "" },
  ...NOTHING,
});

/** A key of the movement that a program sends. */
export const keyOf = (source) => `${source.id} ${source.movement}`;

/** Samples, each a time and coordinates, as a movement. @returns {Movement} */
export const movementOf = (samples) => ({
  times: samples.map(([time]) => time),
  positions: samples.map(([, ...point]) => point),
});

/** Empty the canvas; the movement of a program that was on it does not come back. @param {DrawSession} session */
export function clear(session) {
  const { picture } = session;
  if (session.source) session.dismissed = keyOf(session.source);
  byId("sources").classList.remove("waits");
  Object.assign(picture, { ink: [], rest: [], height: null, replayed: null, frame: null });
  picture.board.draw();
  Object.assign(session, NOTHING);
  session.panel.idle();
  session.naming.allow(false);
  session.naming.empty();
  byId("draw-clear").disabled = byId("draw-replay").disabled = byId("draw-move").disabled = true;
  if (isLoaded()) showInvitation(false);
}
