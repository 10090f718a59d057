// Questions to the person: a name, or yes.
import { byId } from "./elements.js";

/**
 * @param {{title: string, text?: string, yes?: string, name?: string|null, danger?: boolean}} question
 *   `name` is what the field holds at first; without it there is no field.
 * @returns {Promise<string|null>} The name, or "yes"; null if it was cancelled.
 */
export function ask({ title, text = "", yes = "OK", name = null, danger = false }) {
  const dialog = byId("ask");
  byId("ask-title").textContent = title;
  byId("ask-text").textContent = text;
  byId("ask-text").hidden = !text;
  byId("ask-field").hidden = name === null;
  byId("ask-name").required = name !== null;
  byId("ask-name").value = name ?? "";
  byId("ask-yes").textContent = yes;
  byId("ask-yes").classList.toggle("danger-main", danger);
  dialog.returnValue = "no";
  dialog.showModal();
  (name === null ? byId("ask-yes") : byId("ask-name")).focus();
  byId("ask-name").select();
  return new Promise((done) => {
    dialog.addEventListener(
      "close",
      () => done(dialog.returnValue === "yes" ? (name === null ? "yes" : byId("ask-name").value.trim() || null) : null),
      { once: true },
    );
  });
}

// Enter in the field means yes, not the first button.
byId("ask-name").addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => {
  if (event.key !== "Enter" || event.isComposing) return;
  event.preventDefault();
  if (byId("ask-name").value.trim()) byId("ask").close("yes");
});
