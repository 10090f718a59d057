// The page: draw, see live what it is, drag start and goal.

import { open } from "../javascript/runtime.js";
import { breakable, byId, make } from "../web/parts/elements.js";
import { createKnown } from "./known.js";
import { createMoving, placed } from "./movements.js";
import { boxOf, createStage } from "./stage.js";

const ROWS = 5; // bars
const STEP = 0.03; // of the stage, by an arrow key
const BEGUN = 0.1; // share of the path from which a name or unknown is said: every beginning is unlike the whole
const ERROR_RATE = 0.05;
const DRAWN = "Your drawing";

const percent = (share) => `${Math.round(100 * Math.min(Math.max(share, 0), 1))} %`;

const runtime = open(byId("snapshot").textContent);
const d = runtime.header.comparison.n_dims;
const prototypes = runtime.classes.map((name) => runtime.rollout(runtime.primitive(name)).positions);
const box = viewed();
const stage = createStage(byId("stage"), runtime.header.view, box);
const state = {
  stroke: null,
  live: null,
  answer: null,
  moving: null,
  held: null,
  pointer: null,
  played: null,
  note: "",
};
const symbols = createKnown(runtime, prototypes, choose);
let [follow, frame] = [null, 0];

/** What is in view: a typical movement fills it. */
function viewed() {
  const boxes = prototypes.map(boxOf);
  if (!runtime.header.comparison.translation) return boxOf(prototypes.flat());
  const middle = (values) => values.sort((a, b) => a - b)[Math.floor(0.8 * (values.length - 1))];
  return {
    center: boxes[0].center.map((_, k) => middle(boxes.map((bounds) => bounds.center[k]))),
    half: middle(boxes.map((bounds) => bounds.half)),
  };
}

function later() {
  if (!frame) frame = requestAnimationFrame(paint);
}

function paint() {
  frame = 0;
  const { stroke, moving, answer } = state;
  if (stroke && follow) {
    state.live = follow(stroke.times, stroke.positions) ?? state.live;
    showLive();
  }
  stage.cleared();
  if (state.drawn && moving?.name === DRAWN) stage.line(state.drawn.positions, "--line", { wide: 5 });
  if (stroke) stage.line(stroke.positions, "--ink", { wide: 4 });
  if (stroke && state.live) {
    stage.line(state.live.path, "--predicted", { dashed: true, wide: 4 });
    stage.dot(state.live.path.at(-1), "--predicted", { radius: 6 });
  }
  if (moving && !stroke) paintMoving(moving);
  byId("hint").hidden = Boolean(stroke || moving || answer);
  byId("play").disabled = !moving || Boolean(stroke);
  byId("save").disabled = byId("play").disabled;
  byId("clear").disabled = !moving && !answer;
}

function paintMoving(moving) {
  stage.line(moving.positions, "--ink", { wide: 4 });
  for (const [, x] of moving.via) stage.dot(x, "--predicted", { radius: 6 });
  stage.dot(moving.start, "--ink", { hollow: true });
  stage.dot(moving.goal, "--goal");
  stage.word("start", moving.start, "--soft", moving.positions);
  stage.word("goal", moving.goal, "--goal", moving.positions);
  if (state.played !== null) stage.dot(moving.positions[state.played], "--predicted");
}

/** Words of the answer, and how sure it is; a reader of the screen is told once for each verdict. */
function say(verdict, reason, kind = "", sure = "") {
  byId("certainty").textContent = sure && sure[0].toUpperCase() + sure.slice(1);
  const said = byId("verdict");
  if (said.textContent !== verdict) said.replaceChildren(...breakable(verdict));
  said.title = verdict;
  said.className = kind;
  byId("reason").textContent = state.note || reason;
}

function showLive() {
  const { live } = state;
  why([]);
  if (!live) return say("…", "Go on drawing.");
  const done = `${percent(live.progress)} done`;
  if (live.label === null && live.progress < BEGUN) say("…", done);
  else if (live.certainty === "new")
    say("Unknown", `${done}, most like ${live.ranked[0].label}`, "unknown", "new, so far");
  else say(live.label ?? live.ranked[0].label, done, "", `${live.certainty}, so far`);
  bars(live.ranked);
}

function showAnswer() {
  const { answer, moving } = state;
  why([]);
  if (!answer)
    return say(
      moving ? moving.name : "What is it?",
      moving
        ? "Drag its start, its goal, or the path itself."
        : "Draw a movement: with a mouse, a pen or a finger. Or choose a known one.",
    );
  const more = answer.rule === "guess" ? "More drawings of each would say how sure. " : "";
  if (answer.label === null)
    say("Unknown", `Most like ${answer.ranked[0].label}. ${more}`, "unknown", answer.certainty);
  else
    say(
      answer.label,
      `${more}Drag its start, its goal, or the path; or clear it and draw another.`,
      "",
      answer.certainty,
    );
  why([
    `${percent(answer.p_known)} of known movements differ as much.`,
    `p-values: ${answer.ranked
      .slice(0, ROWS)
      .map(({ label, p_value }) => `${label} ${p_value.toPrecision(2)}`)
      .join(", ")}`,
    `Similarity to the nearest: ${answer.nearest[0].similarity.toFixed(2)}`,
  ]);
  bars(answer.ranked);
}

/** The numbers, for who asks. */
function why(reasons) {
  byId("why").hidden = !reasons.length;
  byId("numbers").replaceChildren(...reasons.map((text) => make("p", {}, text)));
}

/** The most likely ones, if it is a known one; always as many rows; names are text. */
function bars(ranked) {
  const likely = [...ranked].sort((a, b) => b.probability - a.probability);
  [...byId("bars").children].forEach((row, i) => {
    const [name, track, value] = row.children;
    const { label, probability } = likely[i] ?? { label: "", probability: 0 };
    name.textContent = label;
    value.textContent = label && percent(probability);
    /** @type {HTMLElement} */ (track.firstElementChild).style.width = `${100 * probability}%`;
  });
}

function clear() {
  Object.assign(state, {
    stroke: null,
    live: null,
    answer: null,
    moving: null,
    drawn: null,
    note: "",
    pointer: null,
    held: null,
  });
  symbols.select(null);
  bars([]);
  showAnswer();
  later();
}

/** Put a known movement, or a drawn one, on the stage. */
function show(name, what, place) {
  try {
    state.moving = createMoving(runtime, name, what, place);
    if (byId("formulation").value) state.note = state.moving.update({ formulation: byId("formulation").value }) ?? "";
  } catch (error) {
    state.moving = null;
    state.note = error.message;
  }
}

function choose(name) {
  clear();
  show(name, name, placed(runtime, runtime.primitive(name), box));
  symbols.select(name);
  showAnswer();
  later();
  // In a narrow window what was chosen is above the list of what can be chosen.
  document.querySelector(".answer").scrollIntoView({ block: "nearest" });
}

function finish() {
  const { times, positions } = state.stroke;
  const drawn = state.stroke;
  Object.assign(state, { stroke: null, live: null, answer: null, moving: null, drawn: null, note: "" });
  try {
    state.answer = runtime.recognize(times, positions, ERROR_RATE);
    state.drawn = drawn;
    const place = { start: positions[0], goal: positions.at(-1) };
    if (runtime.header.movements.encodes) show(DRAWN, runtime.encode(times, positions), place);
    else if (state.answer.label !== null) show(state.answer.label, state.answer.label, place);
    symbols.select(state.answer.label);
  } catch {
    state.note = "That was too short: draw a longer movement.";
    bars([]);
  }
  showAnswer();
  later();
}

const placeOf = (event) => {
  const { left, top } = byId("stage").getBoundingClientRect();
  return [event.clientX - left, event.clientY - top];
};

function down(event) {
  const palm = state.kind === "touch" && event.pointerType === "pen"; // the hand came to rest before the pen
  if ((state.pointer !== null && !palm) || event.button > 0) return;
  byId("stage").setPointerCapture(event.pointerId);
  state.pointer = event.pointerId;
  state.kind = event.pointerType;
  state.played = null;
  state.held = state.moving?.held(stage, placeOf(event)) ?? null;
  if (state.held) return;
  symbols.select(null);
  Object.assign(state, {
    stroke: { times: [], positions: [] },
    answer: null,
    live: null,
    drawn: null,
    moving: null,
    note: "",
  });
  follow = runtime.follow();
  take(event);
}

function take(event) {
  const { times, positions } = state.stroke;
  const t = event.timeStamp / 1000;
  if (times.length && t <= times.at(-1)) return;
  times.push(t);
  positions.push(stage.unproject(...placeOf(event)));
}

function move(event) {
  if (event.pointerId !== state.pointer) return hover(event);
  if (!event.buttons) return up(event); // lifted where the page did not hear it
  if (state.held) {
    const like = state.held.what === "via" ? box.center : state.moving[state.held.what];
    state.note = state.moving.drag(state.held, stage.unproject(...placeOf(event), like)) ?? "";
    if (state.note) showAnswer();
  } else {
    const parts = event.getCoalescedEvents?.() ?? [];
    (parts.length ? parts : [event]).forEach(take);
  }
  later();
}

function hover(event) {
  byId("stage").classList.toggle("over", Boolean(state.moving?.held(stage, placeOf(event))));
}

function up(event) {
  if (event.pointerId !== state.pointer) return;
  state.pointer = null;
  if (state.held) {
    state.held = null;
    state.note = "";
    showAnswer();
    later();
  } else finish();
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

function key(event) {
  if (event.key === "Escape") clear();
  else if (event.key === " ") play();
  else if (event.key in ARROWS && state.moving) {
    const part = event.shiftKey ? "start" : "goal";
    const step = STEP * byId("stage").clientHeight;
    const at = stage.project(state.moving[part]);
    const [x, y] = ARROWS[event.key].map((direction, k) => at[k] + direction * step);
    state.note = state.moving.update({ [part]: stage.unproject(x, y, state.moving[part]) }) ?? "";
    showAnswer();
    later();
  } else return;
  event.preventDefault();
}

/** A dot runs along the movement in its own time; where less motion is asked for, it is shown at the goal. */
function play() {
  const { moving } = state;
  if (!moving) return;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const begun = performance.now();
  const duration = moving.times.at(-1);
  const step = (now) => {
    if (state.moving !== moving || state.pointer !== null) return;
    // A frame may be older than its wish.
    const share = still ? 1 : Math.min(Math.max(now - begun, 0) / 1000 / duration, 1);
    state.played = share < 1 || still ? Math.round(share * (moving.positions.length - 1)) : null;
    later();
    if (share < 1) requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}

function save() {
  const { moving } = state;
  const head = ["t [s]", ..."xyz".slice(0, d)].join(",");
  const rows = moving.positions.map((x, i) => [moving.times[i], ...x].map((value) => value.toPrecision(9)).join(","));
  const url = URL.createObjectURL(new Blob([[head, ...rows, ""].join("\n")], { type: "text/csv" }));
  make("a", { href: url, download: "movement.csv" }).click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

/** By how much the view is turned and tilted [degrees]. */
const turned = () => [Number(byId("turn").value), Number(byId("tilt").value)];

function start() {
  for (let i = 0; i < ROWS; i++) {
    byId("bars").append(
      make(
        "li",
        {},
        make("span", { class: "name" }),
        make("span", { class: "track" }, make("i")),
        make("span", { class: "value" }),
      ),
    );
  }
  for (const name of runtime.formulations) byId("formulation").append(make("option", { value: name }, name));
  byId("formulation").value = runtime.header.movements.formulation;
  byId("how").hidden = runtime.formulations.length < 2;
  for (const label of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll(".turn")))
    label.hidden = d === 2;
  const canvas = byId("stage");
  const listeners = { pointerdown: down, pointermove: move, pointerup: up, pointercancel: up, keydown: key };
  for (const [name, listener] of Object.entries(listeners)) canvas.addEventListener(name, listener);
  byId("clear").addEventListener("click", clear);
  byId("play").addEventListener("click", play);
  byId("save").addEventListener("click", save);
  byId("formulation").addEventListener("change", () => {
    state.note = state.moving?.update({ formulation: byId("formulation").value }) ?? "";
    showAnswer();
    later();
  });
  for (const id of ["turn", "tilt"])
    byId(id).addEventListener("input", () => {
      stage.turned(turned());
      symbols.paint(turned());
      later();
    });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    symbols.paint(turned());
    later();
  });
  new ResizeObserver(() => {
    symbols.paint(turned());
    later();
  }).observe(canvas);
  clear();
  symbols.paint(turned());
  // What is drawn first should not wait for what is made once.
  window.requestIdleCallback?.(() => runtime.follow()([0, 1, 2, 3], prototypes[0].slice(0, 4)));
}

start();
Object.assign(window, { kineme: { runtime, state, stage } });
