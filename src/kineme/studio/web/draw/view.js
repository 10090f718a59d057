// Draw: a movement is recognized while it is drawn, and learned from one drawing.
import { learnExample } from "../parts/changes.js";
import { chooseToMove } from "../parts/chosen.js";
import { followTurns } from "../parts/dragging.js";
import { byId } from "../parts/elements.js";
import { onLibrary, symbolNamed } from "../parts/library_state.js";
import { followPointer } from "../parts/stroke.js";
import { currentView, show } from "../parts/views.js";
import { hearAnswer, membersOf, reopen, requestAnswer, showError, showState } from "./answers.js";
import { hearerOf } from "./drawing.js";
import { startFollowing } from "./follow.js";
import { followGamepad } from "./gamepad.js";
import { handPen } from "./hand.js";
import { showInvitation } from "./invitation.js";
import { followKeys } from "./keyboard_pen.js";
import { startNaming } from "./naming.js";
import { offerPhone } from "./phone.js";
import { clear, createSession } from "./session.js";

/** @param {DrawSession} session */
function showLearned(session, name) {
  const learned = { movement: session.movement, name, members: membersOf(name) };
  Object.assign(session, { label: name, movement: null, learned });
  session.naming.empty();
  session.naming.allow(false);
  byId("draw-move").disabled = name === null;
  if (name !== null) session.panel.words("Learned", name, "Draw it again, anywhere and in any size.", "known", name);
  byId("sources").classList.remove("waits");
  byId("draw-canvas").focus({ preventScroll: true });
  byId("draw-canvas").scrollIntoView({ block: "nearest" }); // where it is drawn again
}

/** Go to Move, with the symbol that was recognized. @param {DrawSession} session */
function move({ label }) {
  const symbol = label === null ? null : symbolNamed(label);
  if (symbol) chooseToMove(symbol.id);
  show("move", true);
}

/** Start the view. @returns What hears the server. */
export function startDraw(send) {
  const session = createSession(send);
  const sources = startFollowing(session);
  session.naming = startNaming({
    movement: () => session.movement,
    learned: (name) => showLearned(session, name),
  });
  const { picture } = session;
  const canvas = byId("draw-canvas");
  for (const follow of [followPointer, followKeys]) follow(canvas, hearerOf(session));
  followTurns(canvas, picture);
  byId("draw-clear").onclick = () => clear(session);
  byId("draw-replay").onclick = () => picture.replay();
  byId("draw-move").onclick = () => move(session);
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && currentView() === "draw" && !document.querySelector("dialog[open]")) clear(session);
  });
  onLibrary(() => {
    showInvitation(picture.ink.length > 0);
    reopen(session);
  });
  for (const button of document.querySelectorAll("[data-example]"))
    button.onclick = async () => {
      const { example } = button.dataset;
      if ((await learnExample(example)) && example === "arm") show("robot", true);
    };
  for (const host of document.querySelectorAll("[data-host]")) host.textContent = location.host;
  followGamepad(canvas, hearerOf(session), sources);
  offerPhone();
  sources.hand = handPen(picture, hearerOf(session));
  window.addEventListener("kineme-hand", (event) => sources.hand(/** @type {CustomEvent} */ (event).detail));
  return {
    state: (state) => showState(session, state),
    answer: (answer) => hearAnswer(session, answer),
    error: (text) => showError(session, text),
    source: (message) => sources.hear(message),
    lost: () => session.sending.lost(),
    renewed: () => {
      session.sending.renewed();
      sources.renewed();
      if (session.pending) requestAnswer(session);
    },
  };
}
