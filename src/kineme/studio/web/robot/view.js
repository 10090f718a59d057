// Robot: an arm executes a movement, and everything that is checked before is shown.
import { get, post } from "../parts/api.js";
import { openArm } from "../parts/arm_frame.js";
import { byId, fill, make } from "../parts/elements.js";
import { library, onLibrary } from "../parts/library_state.js";
import { save, tried } from "../parts/toasts.js";
import { currentView, onShow } from "../parts/views.js";
import { chooseToMove, draggedGoal, toMove } from "../parts/chosen.js";

const USUAL = 0.5; // size of a movement, of the distance of the tip at rest

/** @type {any} What the server answered about arms. */
let arms = null;
/** @type {{at?: number[], goal?: number[]}} Where the start and the goal were put, in the frame of the arm [m]. */
let place = {};
/** @type {any} What is shown. */
let scene = null;
/** @type {((message: Object) => void)|null} To the frame in which the arm is drawn. */
let send = null;
let planned = ""; // what was asked for last

/** A row of two lines: a table beside the arm has no room for one. @param {string[]} cells */
function row([check, worst, limit, unit, time, result]) {
  const cell = (/** @type {string} */ first, second = "") =>
    make("td", {}, first, " ", make("span", { class: "says soft" }, second));
  return make(
    "tr",
    { class: result === "FAILED" ? "failed" : null },
    make("th", { scope: "row" }, check),
    ...[cell(worst, `at\u00a0${time}\u00a0s`), cell(limit, unit.replace("^2", "²")), cell(result)],
  );
}

/** @param {any} answer */
function showPreflight(answer) {
  const { table, passed, refusal } = answer;
  const failed = table.filter((/** @type {string[]} */ cells) => cells[5] === "FAILED");
  byId("robot-preflight").hidden = !table.length;
  byId("robot-preflight").open = failed.length > 0;
  fill(byId("robot-checks"), ...[...new Set([...failed, ...table])].map(row));
  const verdict = byId("robot-verdict");
  verdict.dataset.state = passed ? "passed" : "failed";
  const all = `${table.length} checks`;
  verdict.textContent =
    refusal ?? (passed ? `All ${all} passed.` : `${failed.length} of ${all} failed: it must not move.`);
}

/** @param {any} answer An arm at rest or a movement of it. */
function showArm(answer) {
  scene = answer.scene;
  send?.({ scene, joints: answer.joints });
  showPlace();
}

/** The start and the goal in numbers. */
function showPlace() {
  const values = [...(place.at ?? scene.start), ...(place.goal ?? scene.goal)];
  for (const [k, input] of placeInputs().entries()) input.value = String(Number(values[k].toFixed(3)));
  byId("robot-free").disabled = !place.at;
}

/** @returns {HTMLInputElement[]} */
const placeInputs = () => [...byId("robot-place").querySelectorAll("input")];

/** The start or the goal is put elsewhere. @param {"at"|"goal"} end @param {number[]} point */
function put(end, point) {
  const before = place.at ?? scene.start;
  if (end === "goal") place = { at: before, goal: point };
  else if (place.goal) place = { at: point, goal: place.goal.map((value, k) => value + point[k] - before[k]) };
  else place = { at: point };
  plan();
}

/** What is asked of the arm. */
const wanted = () => ({
  what: { symbol: byId("robot-what").value },
  robot: byId("robot-arm").value,
  size: byId("robot-size").valueAsNumber || 0.3,
  slow_down: byId("robot-slow").checked,
  shapes: false, // they came with the arm at rest
  displacement: byId("robot-dragged").checked && !place.goal ? draggedGoal(byId("robot-what").value) : null,
  ...place,
});

/** Plan what is asked for, unless it is what is shown. @param {boolean} [again] */
async function plan(again = false) {
  const body = wanted();
  const key = JSON.stringify([body, library().version]);
  if (!body.what.symbol || (key === planned && !again)) return;
  planned = key;
  byId("robot-save").disabled = byId("robot-go").disabled = true;
  byId("robot-verdict").dataset.state = "";
  byId("robot-verdict").textContent = "Planning and checking …";
  const answer = await tried(() => post("/api/robots/move", body));
  if (key !== planned) return; // something else is asked for since then
  byId("robot-go").disabled = false;
  if (!answer) {
    planned = byId("robot-verdict").textContent = "";
    return;
  }
  showPreflight(answer);
  byId("robot-save").disabled = !answer.passed;
  if (answer.scene) showArm(answer);
}

/** Another arm: it stands at rest until it is known how it moves. */
async function chooseArm() {
  place = {};
  const name = byId("robot-arm").value;
  const answer = await tried(() => get(`/api/robots/${name}`));
  if (!answer || name !== byId("robot-arm").value) return;
  byId("robot-size").value = (USUAL * Math.hypot(...answer.scene.goal)).toFixed(2);
  showArm(answer);
  await plan();
}

/** Save the joints as a file. */
function saveJoints() {
  const format = byId("robot-format").value;
  save("/api/robots/export", { ...wanted(), format }, `joints.${format}`);
}

/** Whether a goal was dragged in Move is offered where it was. */
function offer() {
  byId("robot-dragged").parentElement.hidden = draggedGoal(byId("robot-what").value) === null;
}

/** Once. */
async function offerArms() {
  fill(byId("robot-arm"), ...arms.robots.map((/** @type {string} */ value) => make("option", { value }, value)));
  const hear = (/** @type {any} */ { end, point }) => put(end === "start" ? "at" : "goal", point);
  send = await openArm(byId("arm"), "/arm.html", hear);
  await chooseArm();
}

async function shown() {
  if (currentView() !== "robot") return;
  const isFirst = !arms;
  arms ??= await tried(() => get("/api/robots"));
  const { symbols } = library(); // as it is now: answers may come in another order
  const id = toMove(symbols);
  const movable = symbols.filter((/** @type {any} */ symbol) => symbol.path);
  const before = byId("robot-what").value;
  fill(
    byId("robot-what"),
    ...movable.map((/** @type {any} */ symbol) =>
      make("option", { value: symbol.id, selected: symbol.id === id }, symbol.name),
    ),
  );
  if (before !== byId("robot-what").value) place = {};
  offer();
  if (!arms) return;
  const none = !movable.length;
  byId("robot-none").hidden = arms.available;
  byId("robot-why").textContent = arms.why;
  byId("robot-main").hidden = !arms.available;
  byId("robot-empty").hidden = !arms.available || !none;
  byId("robot-form").hidden = none;
  if (arms.available && isFirst && !byId("robot-arm").children.length) await offerArms();
  else if (scene) await plan();
}

export function startRobot() {
  byId("robot-place").addEventListener("change", (event) => {
    const { end } = /** @type {HTMLInputElement} */ (event.target).dataset;
    const inputs = placeInputs().filter((input) => input.dataset.end === end);
    if (inputs.every((input) => Number.isFinite(input.valueAsNumber)))
      put(
        /** @type {"at"|"goal"} */ (end),
        inputs.map((input) => input.valueAsNumber),
      );
  });
  byId("robot-free").addEventListener("click", () => {
    place = {};
    plan();
  });
  byId("robot-form").addEventListener("submit", (event) => {
    event.preventDefault();
    plan(true);
  });
  byId("robot-what").addEventListener("change", () => {
    chooseToMove(byId("robot-what").value);
    place = {};
    offer();
    plan();
  });
  byId("robot-arm").addEventListener("change", chooseArm);
  for (const id of /** @type {const} */ (["robot-size", "robot-slow", "robot-dragged"]))
    byId(id).addEventListener("change", () => plan());
  byId("robot-save").addEventListener("click", saveJoints);
  onShow("robot", shown);
  onLibrary(shown);
}
