// Keys that work everywhere, and the list of all keys under "?".
import { undo } from "./changes.js";
import { byId, fill, make } from "./elements.js";
import { currentView, show, VIEWS } from "./views.js";

const KEYS = [
  ["1 … 5", "Draw, Library, Move, Recordings, Robot"],
  ["← →", "from view to view, where a view's name has the focus"],
  ["Ctrl Z", "undo the last change of the library; in Move and Recordings, the last change there"],
  ["Esc", "clear the drawing"],
  ["Enter", "learn the drawing under the name in the field; on the map, open the symbol"],
  ["Space", "in the drawing area: pen down, pen up; in Move: play; in Recordings and Robot: play and pause"],
  ["← ↑ → ↓", "move the pen, the point, the boundary or the playhead in focus; turn a view in space"],
  ["Shift ← ↑ → ↓", "the same, ten times as far"],
  ["+ −", "in a recording, show less of the time or more"],
  ["↑ ↓", "in a recording, from span to span, and Enter names one; in a list of episodes, from one to the next"],
  ["Insert", "add an annotation of a recording at the playhead"],
  ["Delete", "remove the via point or obstacle in focus, or the annotation that is chosen"],
  ["?", "this list"],
];

/** Whether a key is for a field in which one writes. @param {any} target */
const writes = (target) =>
  target.closest?.("input:not([type=range],[type=checkbox],[type=radio]), textarea, select, [contenteditable]");

function list() {
  fill(
    byId("keys-list"),
    ...KEYS.flatMap(([keys, text]) => [
      make("dt", {}, ...keys.split(" ").map((key) => make("kbd", {}, key))),
      make("dd", {}, text),
    ]),
  );
  byId("keys").showModal();
  byId("keys").scrollTop = 0; // the focus went to the button at its end
}

/** Whether a key takes back, other than in a field in which one writes. @param {KeyboardEvent} event */
export const isUndo = (event) =>
  (event.ctrlKey || event.metaKey) &&
  !event.shiftKey &&
  event.key.toLowerCase() === "z" &&
  !writes(event.target) &&
  !document.querySelector("dialog[open]");

/** @param {KeyboardEvent} event */
function pressed(event) {
  if (writes(event.target) || document.querySelector("dialog[open]")) return;
  if (isUndo(event)) {
    event.preventDefault();
    if (!["move", "recordings"].includes(currentView())) undo();
  }
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "?") list();
  const view = VIEWS[Number(event.key) - 1];
  if (view && event.key.trim()) show(view, true);
}

export function startShortcuts() {
  document.addEventListener("keydown", pressed);
  byId("help").addEventListener("click", list);
  byId("undo").addEventListener("click", () => undo());
}
