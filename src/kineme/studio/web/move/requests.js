// What Move asks the server for: the movement of a symbol, its primitives, a file of it.
import { chooseToMove } from "../parts/chosen.js";
import { byId } from "../parts/elements.js";
import { library, symbolOf } from "../parts/library_state.js";
import { server } from "../parts/server.js";
import { save, tried } from "../parts/toasts.js";
import { showChange, showStructure } from "./edits.js";
import { allowFormulations, FORMULATIONS } from "./formulations.js";
import { showPaths } from "./paths.js";
import { asShown, question } from "./plan.js";
import { unit } from "./points.js";
import { movingFormulations } from "./session.js";
import { Steps } from "../parts/steps.js";
import { showStyles } from "./styles.js";

const RESTS = 400; // how long a style slider rests before the primitive is asked for [ms]

/** Start anew with a symbol. @param {MoveSession} session */
export async function chooseSymbol(session, id) {
  const { picture, rollouts } = session;
  const symbol = id && symbolOf(id);
  if (!symbol) return;
  const chosen = { symbol: symbol.id };
  chooseToMove(symbol.id);
  Object.assign(session, { chosen, version: library().version, plan: null, steps: new Steps() });
  session.handles.set([]);
  session.camera.face([symbol.path]);
  picture.sketch(symbol.path);
  byId("move-name").textContent = symbol.name;
  for (const [k, per] of document.querySelectorAll(".per").entries())
    per.textContent = unit() && ` [${unit()}/s${k ? "²" : ""}]`;
  const rollout = await tried(server.generate({ what: chosen, formulation: FORMULATIONS[0].name }));
  if (session.chosen !== chosen) return; // another symbol since then, or this one anew
  if (!rollout) session.chosen = null; // so that it is asked for again
  if (!rollout) return;
  const plan = asShown(symbol, rollout);
  session.plan = picture.plan = plan;
  for (const each of rollouts.values()) each.reset();
  byId("duration").value = "0";
  allowFormulations(true);
  byId("move-reset").disabled = true;
  picture.paths = [];
  picture.fit();
  showStructure(session);
  showStyles(
    symbol,
    (values, formulation) => chooseStyle(session, values, formulation),
    () => session.plan === plan,
  );
  await prepare(session);
}

/** Ask for the primitives of what moves. @param {MoveSession} session */
async function prepare(session) {
  const { plan, rollouts } = session;
  if (plan) await Promise.all(movingFormulations(session).map((name) => rollouts.get(name).prepare(plan)));
}

/** Let another style move; its primitive is asked for once the slider rests. @param {MoveSession} session */
function chooseStyle(session, values, formulation) {
  Object.assign(session.plan, { style: values, styled: formulation });
  allowFormulations(values === null);
  for (const rollouts of session.rollouts.values()) rollouts.primitive = null;
  showChange(session);
  clearTimeout(session.resting);
  session.resting = setTimeout(() => prepare(session), RESTS);
}

/** Let the formulations of these names move. @param {MoveSession} session */
export async function tickFormulations(session, names) {
  const added = names.filter((name) => !session.ticked.has(name));
  session.ticked = new Set(names);
  if (!session.plan) return;
  showPaths(session);
  for (const name of added) {
    const rollouts = session.rollouts.get(name);
    await rollouts.prepare(session.plan);
    if (session.plan && movingFormulations(session).includes(name)) rollouts.follow(session.plan);
  }
}

/** Save the movement as a file. @param {MoveSession} session */
export function saveMovement(session) {
  if (!session.plan) return;
  const format = byId("export-format").value;
  const body = question(session.plan, movingFormulations(session)[0] ?? FORMULATIONS[0].name);
  save("/api/export", { ...body, format }, `movement.${format}`);
}
