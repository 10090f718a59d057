// A program's movement on the canvas, while it happens: as if it were drawn there.
import { byId } from "../parts/elements.js";
import { server } from "../parts/server.js";
import { requestAnswer, showAnswer } from "./answers.js";
import { showLegend } from "./invitation.js";
import { Frame } from "./frame.js";
import { usualSide } from "./scale.js";
import { clear, FEWEST_SAMPLES, keyOf, movementOf } from "./session.js";
import { Sources } from "./sources.js";

/** @param {DrawSession} session */
export function startFollowing(session) {
  /** @type {Sources} */
  const sources = new Sources(
    (source) => follow(session, source),
    () => release(session, sources),
  );
  return sources;
}

/** Whether a program's movement may take the canvas: nothing is lost that was drawn or is being named. */
function isFree(session, source) {
  if (session.drawing || session.pending || byId("naming-name").value.trim()) return false;
  const shown = session.source;
  return shown ? shown.id === source.id || shown.ended !== null : session.movement === null;
}

/** @param {DrawSession} session @param {Source} source */
function follow(session, source) {
  const key = keyOf(source);
  if (key === session.dismissed || !source.samples.length) return;
  if (!session.source || keyOf(session.source) !== key) {
    const free = isFree(session, source);
    byId("sources").classList.toggle("waits", !free);
    if (!free) return;
    begin(session);
  }
  const { samples: painted, ended } = session.source ?? { samples: [], ended: null };
  session.source = source;
  paint(session, painted.length);
  if (source.ended === null) showProgress(session);
  else if (ended === null) end(session, source.ended);
}

/** @param {DrawSession} session */
function begin(session) {
  clear(session);
  session.pointer = "program";
  const paths = server.symbols().map((symbol) => symbol.path);
  session.picture.frame = new Frame(usualSide() ?? 0.5, paths.filter(Boolean));
  showLegend(true);
}

/** @param {DrawSession} session */
function paint({ picture, source: { samples, state, ended } }, painted) {
  const width = samples[0].length - 1;
  const path = ended === null ? (state?.path ?? []) : [];
  picture.ink = samples.map(([time, ...point]) => [time - samples[0][0], ...point]);
  picture.rest = path.filter((point) => point.length === width);
  const added = samples.slice(Math.min(painted, samples.length - 1)).map(([, ...point]) => point);
  picture.frame.include([...added, ...picture.rest], picture.board);
  picture.board.draw();
  byId("draw-clear").disabled = false;
}

/** @param {DrawSession} session */
function showProgress({ panel, source: { samples, state } }) {
  if (!state) return;
  panel.drawing(state, samples.at(-1)[0]);
  if (state.skipped && !state.ranked.length) panel.words("Cannot be compared", "?", state.status[0] ?? "", "unknown");
}

/** The program said that its movement is over, or has gone. @param {DrawSession} session */
function end(session, ending) {
  const { samples } = session.source;
  byId("draw-replay").disabled = false;
  if (ending.error || samples.length < FEWEST_SAMPLES)
    return session.panel.words("No answer", "?", ending.error ?? "too short", "unknown");
  session.movement = movementOf(samples);
  showAnswer(session, ending.answer);
}

/** A program is gone or ignored: a movement that it has not ended is asked for. @param {DrawSession} session */
function release(session, sources) {
  const { source } = session;
  if (!source || source.ended !== null) return;
  if (sources.connected.has(source.id)) {
    if (sources.ignored.has(source.name)) clear(session);
    return;
  }
  session.source = { ...source, ended: { error: "" } };
  session.picture.rest = [];
  if (source.samples.length < FEWEST_SAMPLES) return end(session, {});
  session.movement = movementOf(source.samples);
  session.naming.allow(true);
  requestAnswer(session);
}
