// A movement is drawn on the canvas: its samples go to the picture and to the server.
import { byId, write } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { mirror } from "../parts/mirror.js";
import { requestAnswer, showAnswer } from "./answers.js";
import { showLegend, takesDrawings } from "./invitation.js";
import { canvasHeight } from "./scale.js";
import { clear, FEWEST_SAMPLES, movementOf } from "./session.js";

const PATIENCE = 1500; // [ms]
const LATE = "The server takes long. Nothing is lost.";

/** Samples of a canvas of a height in the units and dimensions of the library. */
function inLibrary(samples, height) {
  const z = library().n_dims === 3 ? [0] : [];
  return samples.map(([time, x, y]) => [time, x * height, y * height, ...z]);
}

/** @param {DrawSession} session @returns Whether one may draw. */
function begin(session, pointer) {
  const { picture } = session;
  if (!takesDrawings() || picture.turns) return false;
  clear(session);
  picture.height = picture.board.height;
  session.sending.reset();
  Object.assign(session, { drawing: true, pointer, height: canvasHeight() });
  showLegend(true);
  session.panel.words("Drawing", "…", "", "open");
  const late = () => byId("verdict-kind").textContent === "Drawing" && write(byId("verdict-note"), LATE);
  if (library().symbols.length) setTimeout(late, PATIENCE);
  return true;
}

/** @param {DrawSession} session */
function extend(session, samples) {
  session.picture.ink.push(...samples);
  mirror(samples.at(-1));
  session.picture.board.draw();
  if (library().symbols.length) session.sending.push(inLibrary(samples, session.height));
}

/** @param {DrawSession} session */
function end(session) {
  const { picture, panel } = session;
  session.drawing = false;
  Object.assign(picture, { height: null, rest: [] });
  picture.board.draw();
  byId("draw-clear").disabled = byId("draw-replay").disabled = picture.ink.length === 0;
  if (picture.ink.length < FEWEST_SAMPLES)
    return panel.words("Too short", "–", "Press, draw, and let go at the end.", "open");
  session.movement = movementOf(inLibrary(picture.ink, session.height));
  session.naming.allow(true);
  if (!library().symbols.length) return showAnswer(session, null);
  session.pending = true;
  if (!session.sending.finish()) requestAnswer(session);
}

/** What hears the pointer and the pen of the keyboard. @param {DrawSession} session @returns {Hearer} */
export const hearerOf = (session) => ({
  begins: (pointer) => begin(session, pointer),
  // Escape ends a drawing while the pen is down.
  goes: (samples) => session.drawing && extend(session, samples),
  ends: () => session.drawing && end(session),
  pen: (at) => {
    session.picture.pen = at;
    session.picture.board.draw();
  },
});
