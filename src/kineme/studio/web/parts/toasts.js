// Short messages at the edge: what was done, how to take it back, what went wrong.
import { download } from "./api.js";
import { button, byId, make } from "./elements.js";

const STAYS = 7000; // [ms]

/**
 * @param {string} text @param {{act?: () => void, action?: string, failed?: boolean}} options
 * @returns {() => void} Takes the message away.
 */
export function say(text, { act, action, failed = false } = {}) {
  const toast = make(
    "div",
    { class: failed ? "toast failed" : "toast", role: failed ? "alert" : null },
    make("p", {}, text),
  );
  const close = () => toast.remove();
  const takeBack = () => {
    close();
    act();
  };
  toast.append(act ? button(action ?? "Undo", takeBack) : button("Close", close));
  byId("toasts").append(toast);
  while (byId("toasts").children.length > 3) byId("toasts").firstChild.remove();
  let timer = setTimeout(close, failed ? 2 * STAYS : STAYS);
  toast.addEventListener("pointerenter", () => clearTimeout(timer));
  toast.addEventListener("focusin", () => clearTimeout(timer));
  toast.addEventListener("pointerleave", () => {
    timer = setTimeout(close, STAYS);
  });
  return close;
}

/** Run something and show what goes wrong. @template T @param {() => Promise<T>} act @returns {Promise<T|undefined>} */
export async function tried(act) {
  try {
    return await act();
  } catch (error) {
    if (error.name !== "AbortError") say(error.message, { failed: true });
    return undefined;
  }
}

/** Ask for a file, and say under which name it is saved. @param {string} path @param {any} body @param {string} name */
export async function save(path, body, name) {
  const saved = await tried(() => download(path, body, name));
  if (saved) say(`Saved as ${saved}.`);
}
