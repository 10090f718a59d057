// Keys that work everywhere, and the list of all keys under "?".
import { undo } from "./changes.js";
import { byId } from "./elements.js";
import { currentView, show, VIEWS } from "./views.js";

/** Whether a key is for a field in which one writes. @param {any} target */
const writes = (target) =>
  target.closest?.("input:not([type=range],[type=checkbox],[type=radio]), textarea, select, [contenteditable]");

function list() {
  byId("keys").showModal();
  byId("keys").scrollTop = 0; // the focus went to the button at its end
}

/** With Ctrl, other than in a field in which one writes. @param {KeyboardEvent} event @param {string} keys */
const commands = (event, keys) =>
  (event.ctrlKey || event.metaKey) &&
  keys.split(" ").includes((event.shiftKey ? "Shift+" : "") + event.key.toLowerCase()) &&
  !writes(event.target) &&
  !document.querySelector("dialog[open]");

/** Whether a key takes back. @param {KeyboardEvent} event */
export const isUndo = (event) => commands(event, "z");

/** Whether a key does again. @param {KeyboardEvent} event */
export const isRedo = (event) => commands(event, "Shift+z y");

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
