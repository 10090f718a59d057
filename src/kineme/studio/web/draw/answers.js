// What the server says of the movement on the canvas: while it is drawn, and once it is over.
import { byId } from "../parts/elements.js";
import { library, symbolNamed } from "../parts/library_state.js";
import { server } from "../parts/server.js";
import { currentView } from "../parts/views.js";

const SUGGESTED = 2; // names that it may have

/** Show what the movement is so far. @param {DrawSession} session */
export function showState(session, state) {
  const { picture, panel, sending, height } = session;
  if (!sending.heard() || !session.drawing) return;
  panel.drawing(state, picture.ink.at(-1)?.[0] ?? 0);
  picture.rest = state.path?.map((point) => point.map((value) => value / height)) ?? picture.rest;
  picture.board.draw();
}

/** Show the answer that the websocket brings to a movement that is over. @param {DrawSession} session */
export function hearAnswer(session, answer) {
  if (session.sending.answered() && session.pending) showAnswer(session, answer);
}

/** Ask for the answer without the websocket. @param {DrawSession} session */
export async function requestAnswer(session) {
  const { movement, panel } = session;
  const answer = await server.recognize(movement).catch((error) => ({ error }));
  if (movement !== session.movement) return;
  if (!answer.error) showAnswer(session, answer);
  else if (answer.error.status) showRefusal(session, answer.error.message);
  else panel.words("No answer yet", "…", "It is asked for again when the server is there.", "open");
}

/** Show the answer to a movement; null where nothing is known to compare it with. @param {DrawSession} session */
export function showAnswer(session, answer) {
  const { movement, panel, naming } = session;
  session.pending = false;
  naming.allow(true);
  if (answer === null) {
    panel.words("New", "?", "Give it a name.", "unknown");
    panel.progress(1);
    panel.speak("Give it a name.");
  } else {
    panel.final(answer, () => server.explain(movement));
    session.label = answer.label;
    byId("draw-move").disabled = answer.label === null;
    const names = answer.ranked.map(({ label }) => label);
    naming.allow(true, [...new Set([answer.label ?? names[0], ...names])].slice(0, SUGGESTED));
  }
  focusName(session);
}

/** Show what the server could not do. @param {DrawSession} session @returns Whether it was about this drawing. */
export function showError(session, text) {
  const { drawing, pending, sending } = session;
  if (drawing) sending.heard();
  if (pending) {
    sending.answered();
    showRefusal(session, text);
  }
  return drawing || pending;
}

/** How many movements have a name. */
export const membersOf = (name) => (name === null ? library().unlabeled : (symbolNamed(name)?.n_members ?? 0));

/** Ask again once the name is taken back. @param {DrawSession} session */
export function reopen(session) {
  const { label, learned, movement } = session;
  if (learned ? membersOf(learned.name) >= learned.members : !movement || !label || symbolNamed(label)) return;
  Object.assign(session, { movement: movement ?? learned.movement, learned: null, pointer: "" });
  if (library().symbols.length) requestAnswer(session);
  else showAnswer(session, null);
}

/** Say why there is no answer. @param {DrawSession} session */
function showRefusal(session, text) {
  session.pending = false;
  session.panel.words("No answer", "?", text, "unknown");
  focusName(session);
}

/** Focus the name: not for a finger, whose keyboard covers the drawing, nor for programs. */
function focusName({ pointer, naming }) {
  if (!["", "touch", "program"].includes(pointer) && currentView() === "draw") naming.focus();
}
