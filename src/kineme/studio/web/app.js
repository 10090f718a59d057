// The start: what is heard from the server goes to the views.
import { startDraw } from "./draw/view.js";
import { startLibrary } from "./library/view.js";
import { startMove } from "./move/view.js";
import { get } from "./parts/api.js";
import { byId, counted, fill, make } from "./parts/elements.js";
import { library, onLibrary, refresh } from "./parts/library_state.js";
import { Live } from "./parts/live.js";
import { startMirror } from "./parts/mirror.js";
import { startSaving } from "./parts/saving.js";
import { startShortcuts } from "./parts/shortcuts.js";
import { say, tried } from "./parts/toasts.js";
import { startViews } from "./parts/views.js";
import { Recordings } from "./recordings/view.js";
import { startRobot } from "./robot/view.js";

const AWAY = "The server does not answer. What you draw stays here; trying again.";
const ANEW =
  "The studio was started anew, with another token. Open the address that it printed; " +
  "what you drew here stays until then.";

onLibrary(({ folder, symbols, n_movements: n, read_only: isReadOnly, can_undo: canUndo }) => {
  byId("library-name").textContent = folder.split(/[/\\]/).findLast(Boolean) ?? folder;
  byId("library-name").title = folder;
  byId("library-count").textContent = `${counted(symbols.length, "symbol")}, ${counted(n, "movement")}`;
  byId("library-mode").hidden = !isReadOnly;
  byId("undo").disabled = !canUndo || isReadOnly;
  document.body.classList.toggle("read-only", isReadOnly);
  fill(byId("names"), ...symbols.map(({ name: value }) => make("option", { value })));
});

function connected(here) {
  byId("status").dataset.state = here ? "here" : "away";
  byId("away-note").hidden = here;
  if (!here) get("/api/library").catch((error) => (byId("away-note").textContent = error.status === 401 ? ANEW : AWAY));
}

const draw = startDraw((message) => live.send(message));
const live = new Live({
  state: draw.state,
  answer: draw.answer,
  source: draw.source,
  error: (text) => draw.error(text) || say(text, { failed: true }),
  changed: (version) => version !== library().version && tried(refresh()),
  here: () => {
    connected(true);
    draw.renewed();
    tried(refresh());
  },
  away: () => {
    connected(false);
    draw.lost();
  },
});
tried(refresh()); // without waiting for the websocket
startLibrary();
startMove();
new Recordings();
startRobot();
startMirror();
startShortcuts();
startViews();
startSaving();
