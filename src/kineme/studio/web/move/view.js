// Move: one symbol, its start, goal, via points, obstacles and duration; the path follows the hand.
import { toMove } from "../parts/chosen.js";
import { byId } from "../parts/elements.js";
import { startFinding } from "../parts/find.js";
import { library } from "../parts/library_state.js";
import { isRedo, isUndo } from "../parts/shortcuts.js";
import { currentView, onShow } from "../parts/views.js";
import { addObstacle, addVia, grabPath, showDragging, step, stretch } from "./edits.js";
import { startFormulations } from "./formulations.js";
import { play, showPaths } from "./paths.js";
import { showPick } from "./pick.js";
import { chooseSymbol, saveMovement, tickFormulations } from "./requests.js";
import { Session } from "./session.js";

/** The view is shown, or the library changed. @param {MoveSession} session */
function showView(session) {
  const { symbols, version } = library();
  const id = toMove(symbols);
  byId("move-empty").hidden = id !== null;
  for (const part of ["pick-part", "move-hint", "move-tools", "move-plots", "move-panel"])
    byId(part).hidden = id === null;
  showPick(id, (chosen) => chooseSymbol(session, chosen));
  if (id === null) session.plan = session.picture.plan = session.chosen = null;
  else if (session.chosen?.symbol !== id || session.version !== version) chooseSymbol(session, id);
}

/** @param {MoveSession} session */
function hearKey(session, event) {
  if (currentView() !== "move") return;
  if (event.key === " " && !event.target.closest("button, input, select, summary, textarea, dialog")) {
    event.preventDefault();
    play(session);
  } else if (isUndo(event)) step(session, -1);
  else if (isRedo(event)) {
    event.preventDefault();
    step(session, 1);
  }
}

export function startMove() {
  const session = new Session({ moved: showPaths, dragged: showDragging, grabbed: grabPath });
  startFormulations((names) => tickFormulations(session, names));
  byId("move-play").onclick = () => play(session);
  byId("add-via").onclick = () => addVia(session);
  byId("add-obstacle").onclick = () => addObstacle(session);
  byId("move-undo").onclick = () => step(session, -1);
  byId("move-redo").onclick = () => step(session, 1);
  byId("move-reset").onclick = () => chooseSymbol(session, session.plan?.symbol);
  byId("export").onclick = () => saveMovement(session);
  byId("duration").oninput = () => stretch(session);
  document.addEventListener("keydown", (event) => hearKey(session, event));
  const pick = () => showPick(session.plan?.symbol ?? null, (chosen) => chooseSymbol(session, chosen));
  startFinding(byId("find-pick"), pick, () => byId("move-pick").querySelector("input"));
  onShow("move", () => showView(session));
}
