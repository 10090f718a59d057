// What was changed, the last change first; an earlier version can be restored.
import { get } from "../parts/api.js";
import { restore } from "../parts/changes.js";
import { ask } from "../parts/dialogs.js";
import { button, byId, fill, keepingFocus, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { tried } from "../parts/toasts.js";

const KEPT = "Nothing is lost: later versions stay in the history, and this can be undone.";

function row({ number, said, time, can_restore }, seen) {
  const again = async () => {
    const text = `${said}. The library will be as it was then. ${KEPT}`;
    if (await ask({ title: `Restore version ${number}?`, text, yes: "Restore" })) await restore(number, seen);
  };
  const look = { class: "button quiet", "data-key": `restore ${number}`, "aria-label": `Restore version ${number}` };
  return make(
    "li",
    {},
    make("span", "numbers soft", number),
    make("span", "said", said),
    make("time", "soft small", time.replace("T", " ").slice(0, 19)),
    can_restore ? button("Restore", again, look) : null,
  );
}

export async function showHistory() {
  if (!byId("history").open) return;
  const { version } = library();
  const answer = await tried(get("/api/library/history"));
  if (!answer || version !== library().version) return;
  keepingFocus(() => fill(byId("versions"), ...answer.versions.map((entry) => row(entry, version))));
}
