// Questions to the person: a name, or yes.
import { byId } from "./elements.js";

/**
 * Ask for a name, which the field holds at first, or without it for yes.
 * @returns {Promise<string|null>} The name, or "yes"; null if it was cancelled.
 */
export function ask({ title, yes, text = "", name = null, danger = false }) {
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
    dialog.onclose = () => {
      const answer = name === null ? "yes" : byId("ask-name").value.trim();
      done((dialog.returnValue === "yes" && answer) || null);
    };
  });
}

// Enter in the field means yes, not the first button.
byId("ask-name").onkeydown = (event) => {
  if (event.key !== "Enter" || event.isComposing) return;
  event.preventDefault();
  if (byId("ask-name").value.trim()) byId("ask").close("yes");
};
