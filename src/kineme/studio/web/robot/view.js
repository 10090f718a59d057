// Robot: an arm executes a movement, and everything that is checked before is shown.
import { download, get, post } from "../parts/api.js";
import { openArm } from "../parts/arm_frame.js";
import { byId, fill, make } from "../parts/elements.js";
import { library, onLibrary } from "../parts/library_state.js";
import { say, tried } from "../parts/toasts.js";
import { currentView, onShow } from "../parts/views.js";
import { chooseToMove, draggedGoal, toMove } from "../parts/chosen.js";

const FILES = { yaml: "ROS 2 action goal", mcap: "ROS 2 bag", bag: "ROS 1 bag" };
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

const TINY = 1e-4; // written with an exponent: no zeros to count
const written = (/** @type {number} */ value) =>
  value && Math.abs(value) < TINY ? value.toExponential(1) : String(Number(value.toPrecision(4)));
const number = (/** @type {number|null|undefined} */ value) =>
  value === null || value === undefined ? "–" : written(Number(value));

/**
 * A cell of two lines: a table beside the arm has no room for one.
 * @param {"th"|"td"} tag @param {string} first @param {string} second
 */
const cell = (tag, first, second) =>
  make(tag, tag === "th" ? { scope: "row" } : {}, first, " ", make("span", { class: "says soft" }, second));

/** @param {any} check */
function row(check) {
  const at = check.time === null || check.time === undefined ? "" : `at\u00a0${Number(check.time).toFixed(2)}\u00a0s`;
  const cells = [
    cell("th", check.what, check.where ?? ""),
    cell("td", number(check.worst), at),
    cell("td", number(check.limit), (check.unit ?? "").replace("^2", "²")),
  ];
  return make(
    "tr",
    { class: check.passed ? null : "failed" },
    ...cells,
    make("td", {}, check.passed ? "passed" : "FAILED"),
  );
}

/** @param {any} answer */
function showPreflight(answer) {
  const checks = [...(answer.checks ?? [])].sort((a, b) => Number(a.passed) - Number(b.passed));
  const failed = checks.filter((check) => !check.passed).length;
  byId("robot-preflight").hidden = !checks.length;
  byId("robot-preflight").open = failed > 0;
  fill(byId("robot-checks"), ...checks.map(row));
  byId("robot-verdict").dataset.state = answer.passed ? "passed" : "failed";
  byId("robot-verdict").textContent =
    answer.refusal ??
    (answer.passed
      ? `All ${checks.length} checks passed.`
      : `${failed} of ${checks.length} checks failed: the arm must not execute this.`);
}

/** @param {any} answer An arm at rest or a movement of it. */
function showArm(answer) {
  scene = answer.scene;
  send?.({ scene, joints: answer.joints });
  showPlace();
}

/** The start and the goal in numbers. */
function showPlace() {
  for (const input of placeInputs()) {
    const [end, k] = /** @type {["at"|"goal", number]} */ ([input.dataset.end, Number(input.dataset.axis)]);
    const point = place[end] ?? (end === "at" ? scene.start : scene.goal);
    input.value = String(Number(point[k].toFixed(3)));
  }
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
async function save() {
  const format = byId("robot-format").value;
  const name = await tried(() => download("/api/robots/export", { ...wanted(), format }, `joints.${format}`));
  if (name) say(`Saved as ${name}.`);
}

/** Whether a goal was dragged in Move is offered where it was. */
function offer() {
  byId("robot-dragged").parentElement.hidden = draggedGoal(byId("robot-what").value) === null;
}

/** Arms and formats of files, once. */
async function offerArms() {
  const option = (/** @type {string} */ value, text = value) => make("option", { value }, text);
  fill(byId("robot-arm"), ...arms.robots.map((/** @type {string} */ name) => option(name)));
  const formats = arms.formats.map((/** @type {string} */ ending) => ending.slice(1));
  const says = (/** @type {string} */ format) => [format.toUpperCase(), FILES[format]].filter(Boolean).join(", ");
  fill(byId("robot-format"), ...formats.map((/** @type {string} */ format) => option(format, says(format))));
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
  byId("robot-empty").hidden = arms.available && movable.length > 0;
  byId("robot-main").hidden = !arms.available;
  byId("robot-form").hidden = !movable.length;
  byId("robot-empty-title").textContent = arms.available ? "Nothing to move yet" : "No arm here yet";
  byId("robot-why").textContent = arms.why ?? "Draw a movement and give it a name first; then an arm shows it.";
  byId("robot-draw").hidden = !arms.available;
  if (arms.available && isFirst && !byId("robot-arm").children.length) await offerArms();
  else if (scene) await plan();
}

export function startRobot() {
  for (const end of ["at", "goal"])
    byId("robot-place").append(
      make("span", { class: "point-name" }, end === "at" ? "Start" : "Goal"),
      ...["x", "y", "z"].map((axis, k) =>
        make("input", {
          type: "number",
          step: "any",
          "aria-label": `${end === "at" ? "Start" : "Goal"} ${axis} in meters`,
          "data-end": end,
          "data-axis": String(k),
        }),
      ),
    );
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
  byId("robot-save").addEventListener("click", save);
  onShow("robot", shown);
  onLibrary(shown);
}
