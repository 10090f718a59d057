// What the server says of the movement on the canvas: while it is drawn, and once it is over.
import { byId } from "../parts/elements.js";
import { library, symbolNamed } from "../parts/library_state.js";
import { server } from "../parts/server.js";
import { currentView } from "../parts/views.js";

const SUGGESTED = 2; // names that the movement may have

/** @typedef {import("./session.js").Session} Session */

/** Show what the movement is so far. @param {Session} session @param {any} state Of the server. */
export function showState(session, state) {
  if (!session.sending.heard() || !session.drawing) return;
  const { ink, rest, board } = session.picture;
  session.panel.drawing(state, ink[ink.length - 1]?.[0] ?? 0);
  session.picture.rest =
    state.path?.map((/** @type {number[]} */ point) => point.map((value) => value / session.height)) ?? rest;
  board.draw();
}

/**
 * Show the answer that the websocket brings to a movement that is over.
 * @param {Session} session
 * @param {any} answer
 */
export function hearAnswer(session, answer) {
  if (session.sending.answered() && session.pending) showAnswer(session, answer);
}

/** Ask for the answer without the websocket. @param {Session} session */
export async function requestAnswer(session) {
  const { movement } = session;
  const answer = await server.recognize(movement).catch((/** @type {any} */ error) => ({ error }));
  if (movement !== session.movement) return;
  if (!answer.error) showAnswer(session, answer);
  else if (!answer.error.status)
    session.panel.words("No answer yet", "…", "It is asked for again when the server is there.", "open");
  else showRefusal(session, answer.error.message);
}

/**
 * Show what the movement is, now that it is over.
 * @param {Session} session
 * @param {any} answer Null where there is too little to compare with.
 */
export function showAnswer(session, answer) {
  session.pending = false;
  session.naming.allow(true);
  if (answer !== null) showRecognized(session, answer);
  else showNew(session);
}

/** @param {Session} session @param {any} answer */
function showRecognized(session, answer) {
  const { movement } = session;
  session.panel.final(answer, () => server.explain(movement));
  session.label = answer.label;
  byId("draw-move").disabled = answer.label === null;
  const names = answer.ranked.map((/** @type {any} */ candidate) => candidate.label);
  session.naming.allow(true, [...new Set([answer.label ?? names[0], ...names])].slice(0, SUGGESTED));
  focusName(session);
}

/** Nothing is known that it could be like. @param {Session} session */
function showNew(session) {
  session.panel.words("New", "?", "Give it a name.", "unknown");
  session.panel.progress(1);
  session.panel.speak("Give it a name.");
  focusName(session);
}

/**
 * Show what the server could not do.
 * @param {Session} session
 * @param {string} text
 * @returns {boolean} Whether it was about this drawing.
 */
export function showError(session, text) {
  const { drawing, pending, sending } = session;
  if (drawing) sending.heard();
  if (pending) {
    sending.answered();
    showRefusal(session, text);
  }
  return drawing || pending;
}

/** How many movements have a name. @param {string|null} name */
export const membersOf = (name) => (name === null ? library().unlabeled : (symbolNamed(name)?.n_members ?? 0));

/** Ask again about a drawing that was learned, once that is taken back. @param {Session} session */
export function reopen(session) {
  const { learned } = session;
  if (!learned || membersOf(learned.name) >= learned.members) return;
  Object.assign(session, { movement: learned.movement, learned: null, pointer: "" });
  if (library().symbols.length) requestAnswer(session);
  else showAnswer(session, null);
}

/** @param {Session} session @param {string} text Why there is no answer. */
function showRefusal(session, text) {
  session.pending = false;
  session.panel.words("No answer", "?", text, "unknown");
  focusName(session);
}

/**
 * Put the focus on the field of the name. With a finger it waits to be touched, as a keyboard of glass would cover the
 * drawing, and while programs move, too.
 * @param {Session} session
 */
function focusName({ pointer, naming }) {
  if (!["", "touch", "program"].includes(pointer) && currentView() === "draw") naming.focus();
}
