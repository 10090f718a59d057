// Short messages at the edge: what was done, how to take it back, what went wrong.
import { download } from "./api.js";
import { button, byId, make } from "./elements.js";

const STAYS = 7000; // [ms]

/** Say something, with a button that takes it back or closes it. @returns What takes the message away. */
export function say(text, { undo = null, failed = false } = {}) {
  const close = () => toast.remove();
  const act = () => {
    close();
    undo?.();
  };
  const look = failed ? { class: "toast failed", role: "alert" } : "toast";
  const toast = make("div", look, make("p", {}, text), button(undo ? "Undo" : "Close", act));
  const shown = byId("toasts").children;
  for (const old of shown) if (old.textContent === toast.textContent) old.remove();
  byId("toasts").append(toast);
  if (shown.length > 3) shown[0].remove();
  let timer = setTimeout(close, failed ? 2 * STAYS : STAYS);
  for (const event of ["pointerenter", "focusin"]) toast.addEventListener(event, () => clearTimeout(timer));
  toast.onpointerleave = () => (timer = setTimeout(close, STAYS));
  return close;
}

/** Show what goes wrong. @template T @param {Promise<T>} answer @returns {Promise<T|undefined>} */
export async function tried(answer) {
  try {
    return await answer;
  } catch (error) {
    if (error.name !== "AbortError") say(error.message, { failed: true });
  }
}

/** Ask for a file, and say under which name it is saved. */
export async function save(path, body, name) {
  const saved = await tried(download(path, body, name));
  if (saved) say(`Saved as ${saved}.`);
}
