// The page: draw, see live what it is, drag start and goal.

import { AnswerPanel } from "../web/parts/answer_panel.js";
import { ARROWS, drag } from "../web/parts/dragging.js";
import { byId, fill, handOver, make, write } from "../web/parts/elements.js";
import { followPointer } from "../web/parts/stroke.js";
import { createMoving, placed } from "./movements.js";
import { openSnapshot } from "./snapshot.js";
import { boxOf, Stage } from "./stage.js";
import { createSymbols } from "./symbols.js";
import { hearNotebook, tell, tellDrawn } from "./telling.js";

const STEP = 0.03; // of the stage, by an arrow key
const DRAWN = "Your drawing";
const NOTHING = { stroke: null, live: null, answer: null, moving: null, drawn: null, played: null, note: "" };

const backend = openSnapshot(byId("snapshot").textContent);
const { runtime } = backend;
const { header } = runtime;
const d = header.comparison.n_dims;
const prototypes = backend.symbols().map((symbol) => symbol.path);
const box = viewed();
const canvas = byId("stage");
const stage = new Stage(canvas, header.view, box, paint);
const panel = new AnswerPanel({
  picture: (name) => backend.symbols().find((symbol) => symbol.name === name)?.path ?? null,
  advice: () =>
    state.drags ? "Drag its start, its goal, or the path; or draw another." : "Draw another, or drag this one.",
});
const state = { ...NOTHING, drags: false, held: null }; // drags: another press does not draw
const symbols = createSymbols(backend.symbols(), header.view, chosen);
const following = backend.follow((message) => {
  state.live = message.state ?? state.live;
  show();
});

/** What is in view: a typical movement fills it. */
function viewed() {
  const boxes = prototypes.map(boxOf);
  if (!header.comparison.translation) return boxOf(prototypes.flat());
  const middle = (values) => values.sort((a, b) => a - b)[Math.floor(0.8 * (values.length - 1))];
  return {
    center: boxes[0].center.map((_, k) => middle(boxes.map((bounds) => bounds.center[k]))),
    half: middle(boxes.map((bounds) => bounds.half)),
  };
}

function paint() {
  const { stroke, live, drawn, moving } = state;
  if (drawn && moving?.name === DRAWN) stage.line(drawn.positions, "--line", { width: 5 });
  if (stroke) stage.line(stroke.positions, "--ink");
  if (stroke && live) {
    stage.line(live.path, "--predicted", { dash: [2, 8] });
    stage.dot(live.path.at(-1), "--predicted", { radius: 6 });
  }
  if (!moving || stroke) return;
  stage.line(moving.positions, "--ink");
  for (const [, x] of moving.via) stage.dot(x, "--predicted", { radius: 6 });
  if (state.drags) {
    stage.dot(moving.start, "--ink", { hollow: true });
    stage.dot(moving.goal, "--goal");
    stage.word("start", moving.start, "--soft", moving.positions);
    stage.word("goal", moving.goal, "--goal", moving.positions);
  }
  if (state.played !== null) stage.dot(moving.positions[state.played], "--predicted");
}

/** Show the state: in the drawing area at the next frame, in words at once. */
function show() {
  const { stroke, live, answer, moving, note, drags } = state;
  stage.board.draw();
  byId("hint").hidden = Boolean(stroke || moving || answer);
  byId("play").disabled = byId("save").disabled = !moving || Boolean(stroke);
  byId("clear").disabled = !moving && !answer;
  byId("drag").hidden = drags || !moving;
  byId("ranking").hidden = !stroke && !answer;
  if (stroke && live) panel.drawing(live, stroke.times.at(-1));
  else if (answer) panel.final(answer, () => backend.explain(state.drawn, answer));
  else {
    if (stroke) panel.words("", "…", "Go on drawing.", "open");
    else if (moving)
      panel.words("", moving.name, "Drag its start, its goal, or the path itself.", "known", moving.name);
    else {
      const invitation = "Draw a movement: with a mouse, a pen or a finger. Or choose a known one.";
      panel.words("", "What is it?", invitation, "open");
    }
    panel.list([]);
    panel.why([]);
  }
  if (note) write(byId("verdict-note"), note);
}

/** Another state, of which the rest is empty. */
function become(change) {
  following.reset();
  Object.assign(state, NOTHING, change);
  symbols.select(state.answer?.label ?? null);
  tellMoved();
  show();
}

function tellMoved() {
  if (!state.moving) return;
  const { name, start, goal, via, times, positions } = state.moving;
  tell({ moved: { name, start, goal, via, times: [...times], positions } });
}

/** A known movement, or a drawn one, that can be moved; the note says why there is none. */
function movable(name, what, { via = [], ...place }) {
  try {
    const moving = createMoving(backend, name, what, place);
    const formulation = byId("formulation").value || header.movements.formulation;
    return { moving, note: moving.update({ formulation, via }) ?? "" };
  } catch (error) {
    return { moving: null, note: error.message };
  }
}

function choose(name, place = placed(backend, name, box)) {
  become({ drags: true, ...movable(name, { symbol: name }, place) });
  symbols.select(name);
}

function chosen(name) {
  choose(name);
  // In a narrow window what was chosen is above the list of what can be chosen.
  document.querySelector(".answer").scrollIntoView({ block: "nearest" });
}

function finish() {
  const drawn = state.stroke;
  const place = { start: drawn.positions[0], goal: drawn.positions.at(-1) };
  following.finish();
  tellDrawn([null, drawn.times.map((time, i) => [time, ...drawn.positions[i]])]);
  try {
    const answer = backend.recognize(drawn);
    const { encodes } = header.movements;
    const name = encodes ? DRAWN : answer.label;
    const what = encodes ? { primitive: runtime.encode(drawn.times, drawn.positions) } : { symbol: name };
    become({ answer, drawn, drags: false, ...(name === null ? {} : movable(name, what, place)) });
  } catch {
    become({ note: "That was too short: draw a longer movement." });
  }
}

const placeOf = (event) => {
  const { left, top } = canvas.getBoundingClientRect();
  return [event.clientX - left, event.clientY - top];
};

/** What moves is another; the note says why it cannot be so. */
function moved(note = "") {
  stage.board.draw();
  if (!state.held) tellMoved();
  if (note === state.note) return; // words stay while a hand moves
  state.note = note;
  show();
}

const update = (change) => moved(state.moving?.update(change) ?? "");

function startDragging() {
  state.drags = true;
  show();
  canvas.focus({ preventScroll: true });
}

/** Take hold of a point of what moves. */
function hold(event) {
  if (state.held || state.stroke || !state.drags) return;
  state.played = null;
  const held = state.moving?.held(stage, placeOf(event)) ?? null;
  const go = (now) => {
    const like = held.what === "via" ? box.center : state.moving[held.what];
    moved(state.moving.drag(held, stage.unproject(...placeOf(now), like)) ?? "");
  };
  const end = () => {
    state.held = null;
    moved();
  };
  if (held && drag(canvas, event, (now) => state.moving && go(now), end)) state.held = held;
}

/** @type {Hearer} */
const hearer = {
  begins: () => {
    if (state.held || !header.early) return false;
    become({ stroke: { times: [], positions: [] } });
    return true;
  },
  // Escape ends a drawing while the pen is down.
  goes: (samples) => {
    if (!state.stroke) return;
    const { height } = stage.board;
    for (const [time, x, y] of samples) {
      const point = stage.unproject(x * height, (1 - y) * height);
      state.stroke.times.push(time);
      state.stroke.positions.push(point);
      following.push([[time, ...point]]);
    }
    stage.board.draw();
  },
  ends: () => state.stroke && finish(),
};

function key(event) {
  if (event.key === "Escape") become({});
  else if (event.key === " ") play();
  else if (event.key in ARROWS && state.moving) {
    startDragging();
    const part = event.shiftKey ? "start" : "goal";
    const step = STEP * canvas.clientHeight;
    const at = stage.project(state.moving[part]);
    const [x, y] = ARROWS[event.key].map((direction, k) => at[k] + direction * step);
    update({ [part]: stage.unproject(x, y, state.moving[part]) });
  } else return;
  event.preventDefault();
}

/** A dot runs along the movement in its own time; where less motion is asked for, it is shown at the goal. */
function play() {
  const { moving } = state;
  if (!moving) return;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const duration = moving.times.at(-1);
  stage.board.run((time) => {
    if (state.moving !== moving || state.held || state.stroke) return false;
    const share = still ? 1 : Math.min(time / duration, 1);
    state.played = share < 1 || still ? Math.round(share * (moving.positions.length - 1)) : null;
    stage.board.draw();
    return share < 1;
  });
}

function save() {
  const { moving } = state;
  const columns = header.columns?.map(({ head }) => head) ?? [..."xyz"].slice(0, d);
  const head = ["t [s]", ...columns].map((text) => `"${text.replaceAll('"', '""')}"`).join(",");
  const rows = moving.positions.map((x, i) => [moving.times[i], ...x].map((value) => value.toPrecision(9)).join(","));
  handOver(new Blob([[head, ...rows, ""].join("\n")], { type: "text/csv" }), "movement.csv");
}

function start() {
  const options = runtime.formulations.map((value) => make("option", { value }, value));
  fill(byId("formulation"), ...options);
  byId("formulation").value = header.movements.formulation;
  byId("how").hidden = runtime.formulations.length < 2;
  for (const label of document.querySelectorAll(".turn")) label.hidden = d === 2;
  canvas.addEventListener("pointerdown", hold);
  followPointer(canvas, hearer);
  canvas.addEventListener("pointermove", (event) => {
    if (!state.held && !state.stroke && state.drags)
      canvas.classList.toggle("over", Boolean(state.moving?.held(stage, placeOf(event))));
  });
  canvas.onkeydown = key;
  byId("clear").onclick = () => become({});
  byId("play").onclick = play;
  byId("drag").onclick = startDragging;
  byId("save").onclick = save;
  byId("formulation").onchange = () => update({ formulation: byId("formulation").value });
  for (const id of ["turn", "tilt"])
    byId(id).oninput = () => {
      const angles = [byId("turn").valueAsNumber, byId("tilt").valueAsNumber]; // [degrees]
      for (const picture of [stage, symbols]) picture.turn(angles);
    };
  become({});
  // Primitives alone recognize nothing; what moves there is where Python or the cell put it last.
  hearNotebook(({ moved }) => {
    const place = (moving) => JSON.stringify(["name", "start", "goal", "via"].map((part) => moving?.[part]));
    if (!header.early && !state.held && place(state.moving) !== place(moved)) choose(moved.name, moved);
  });
  // What is drawn first should not wait for what is made once.
  if (header.early) window.requestIdleCallback?.(() => runtime.follow()([0, 1, 2, 3], prototypes[0].slice(0, 4)));
}

start();
Object.assign(window, { kineme: { runtime, state, stage } });
