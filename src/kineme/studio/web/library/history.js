// What was changed, the last change first; an earlier version can be restored.
import { get } from "../parts/api.js";
import { restore } from "../parts/changes.js";
import { ask } from "../parts/dialogs.js";
import { byId, fill, keepingFocus, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { tried } from "../parts/toasts.js";

/** @param {any} one A version. @param {number} seen */
async function again(one, seen) {
  const text =
    `${one.said}. The library will be as it was then. Nothing is lost: later versions stay in the history, ` +
    "and this can be undone.";
  if (await ask({ title: `Restore version ${one.number}?`, text, yes: "Restore" })) await restore(one.number, seen);
}

/** @param {any} one @param {number} seen */
const row = (one, seen) =>
  make(
    "li",
    {},
    make("span", { class: "numbers soft" }, `${one.number}`),
    make("span", { class: "said" }, one.said),
    make("time", { class: "soft small" }, String(one.time).replace("T", " ").slice(0, 19)),
    one.can_restore
      ? make(
          "button",
          {
            class: "button quiet",
            type: "button",
            "data-key": `restore ${one.number}`,
            "aria-label": `Restore version ${one.number}`,
            on: { click: () => again(one, seen) },
          },
          "Restore",
        )
      : null,
  );

export async function showHistory() {
  if (!byId("history").open) return;
  const { version } = library();
  const answer = await tried(() => get("/api/library/history"));
  if (!answer || version !== library().version) return;
  keepingFocus(() => fill(byId("versions"), ...answer.versions.map((/** @type {any} */ one) => row(one, version))));
}
