// What was changed, the last change first; an earlier version can be restored.
import { get } from "../parts/api.js";
import { restore } from "../parts/changes.js";
import { ask } from "../parts/dialogs.js";
import { button, byId, fill, keepingFocus, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { tried } from "../parts/toasts.js";

/** @param {any} entry A version. */
async function again(entry, seen) {
  const text =
    `${entry.said}. The library will be as it was then. Nothing is lost: later versions stay in the history, ` +
    "and this can be undone.";
  if (await ask({ title: `Restore version ${entry.number}?`, text, yes: "Restore" })) await restore(entry.number, seen);
}

const of = ({ number }) => ({
  ...{ class: "button quiet", "data-key": `restore ${number}`, "aria-label": `Restore version ${number}` },
});

const row = (entry, seen) =>
  make(
    "li",
    {},
    make("span", "numbers soft", `${entry.number}`),
    make("span", "said", entry.said),
    make("time", "soft small", String(entry.time).replace("T", " ").slice(0, 19)),
    entry.can_restore ? button("Restore", () => again(entry, seen), of(entry)) : null,
  );

export async function showHistory() {
  if (!byId("history").open) return;
  const { version } = library();
  const answer = await tried(get("/api/library/history"));
  if (!answer || version !== library().version) return;
  keepingFocus(() => fill(byId("versions"), ...answer.versions.map((entry) => row(entry, version))));
}
