// Keys that work everywhere, and the list of all keys under "?".
import { undo } from "./changes.js";
import { byId } from "./elements.js";
import { currentView, show, VIEWS } from "./views.js";

function list() {
  byId("keys").showModal();
  byId("keys").scrollTop = 0; // the focus went to the button at its end
}

const FIELDS = "input:not([type=range],[type=checkbox],[type=radio]), textarea, select, [contenteditable]";

/** Whether a key is for something else: a field in which one writes, or a dialog. */
const isTaken = ({ target }, fields = FIELDS) => target.closest?.(fields) || document.querySelector("dialog[open]");

const commands = (event, keys) =>
  (event.ctrlKey || event.metaKey) &&
  keys.split(" ").includes((event.shiftKey ? "Shift+" : "") + event.key.toLowerCase()) &&
  !isTaken(event, `:is(${FIELDS}):not(:placeholder-shown)`); // but an empty one

/** Whether a key takes back. */
export const isUndo = (event) => commands(event, "z");

/** Whether a key does again. */
export const isRedo = (event) => commands(event, "Shift+z y");

function pressed(event) {
  if (isUndo(event)) {
    event.preventDefault();
    if (!["move", "recordings"].includes(currentView())) undo();
  }
  if (isTaken(event) || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "?") list();
  const view = VIEWS[Number(event.key) - 1];
  if (view && event.key.trim()) show(view, true);
}

export function startShortcuts() {
  document.addEventListener("keydown", pressed);
  byId("help").onclick = list;
  byId("undo").onclick = () => undo();
}
