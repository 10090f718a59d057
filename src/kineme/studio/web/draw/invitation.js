// What the empty canvas says, and whether one may draw on it.
import { byId } from "../parts/elements.js";
import { library } from "../parts/library_state.js";

const SAME_HEIGHT = 1e-9; // of points of a plane movement

/** Whether drawings fit the library: in the plane, or in space where all movements are plane. */
export function takesDrawings() {
  const { n_dims: dims, symbols } = library();
  if (dims === null || dims === 2) return true;
  const isPlane = (/** @type {number[][]} */ path) =>
    path.every((point) => Math.abs(point[2] - path[0][2]) < SAME_HEIGHT);
  return dims === 3 && symbols.every((symbol) => !symbol.path || isPlane(symbol.path));
}

/** @returns {{title: string, text: string}} */
function invitation() {
  const { symbols, read_only: readOnly } = library();
  if (!takesDrawings())
    return {
      title: "Movements in space",
      text:
        "This library holds movements that a mouse cannot draw. Send samples from a program and see them here, or " +
        "drop a recording in Recordings.",
    };
  return {
    title: symbols.length ? "Draw a movement here" : "Nothing is known yet",
    text:
      symbols.length || readOnly
        ? "In one stroke, with mouse, pen or finger. What it is appears while you draw."
        : "Draw a movement in one stroke, then give it a name. One drawing is enough to be recognized again.",
  };
}

/** @param {boolean} filled Whether there is a movement on the canvas. */
export function showInvitation(filled) {
  const { title, text } = invitation();
  showLegend(filled);
  byId("draw-empty-title").textContent = title;
  byId("draw-empty-text").textContent = text;
  byId("draw-how").hidden = takesDrawings();
  if (!takesDrawings()) byId("live-source").open = true;
}

/** @param {boolean} filled Whether there is a movement: the invitation goes, and what its colors mean is said. */
export function showLegend(filled) {
  byId("draw-empty").hidden = filled;
  byId("draw-legend").hidden = !filled || !library().symbols.length;
}
