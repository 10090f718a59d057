// Robot: an arm executes a movement, and everything that is checked before is shown.
import { get, path, post } from "../parts/api.js";
import { openArm } from "../parts/arm_frame.js";
import { byId, fill, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { save, tried } from "../parts/toasts.js";
import { onShow } from "../parts/views.js";
import { chooseToMove, draggedGoal, toMove } from "../parts/chosen.js";

const USUAL = 0.5; // size of a movement, of the distance of the tip at rest

let arms = null; // what the server answered about them
/** @type {{at?: number[], goal?: number[]}} Where the start and the goal were put, in the frame of the arm [m]. */
let place = {};
let scene = null; // what is shown
let send = null; // to the frame in which the arm is drawn
let planned = ""; // what was asked for last

/** A row of two lines: a table beside the arm has no room for one. */
function row([check, worst, limit, unit, time, result]) {
  const cell = (first, second = "") => make("td", {}, first, " ", make("span", "says soft", second));
  const cells = [cell(worst, `at\u00a0${time}\u00a0s`), cell(limit, unit.replace("^2", "²")), cell(result)];
  return make("tr", result === "FAILED" ? "failed" : "", make("th", { scope: "row" }, check), ...cells);
}

function showPreflight({ table, passed, refusal }) {
  const failed = table.filter((cells) => cells[5] === "FAILED");
  byId("robot-preflight").hidden = !table.length;
  byId("robot-preflight").open = failed.length > 0;
  fill(byId("robot-checks"), ...[...new Set([...failed, ...table])].map(row));
  const verdict = byId("robot-verdict");
  verdict.dataset.state = passed ? "passed" : "failed";
  const all = `${table.length} checks`;
  verdict.textContent =
    refusal ?? (passed ? `All ${all} passed.` : `${failed.length} of ${all} failed: it must not move.`);
}

/** An arm at rest, or a movement of it. */
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

const placeInputs = () => [...byId("robot-place").querySelectorAll("input")];

/** The start, "at", or the goal is put elsewhere. */
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

/** Plan what is asked for, unless it is what is shown. */
async function plan(again = false) {
  const body = wanted();
  const key = JSON.stringify([body, library().version]);
  if (!body.what.symbol || (key === planned && !again)) return;
  planned = key;
  byId("robot-save").disabled = byId("robot-go").disabled = true;
  byId("robot-verdict").dataset.state = "";
  byId("robot-verdict").textContent = "Planning and checking …";
  const answer = await tried(post("/api/robots/move", body));
  if (key !== planned) return; // something else is asked for since then
  byId("robot-go").disabled = false;
  if (!answer) planned = byId("robot-verdict").textContent = "";
  if (!answer) return;
  showPreflight(answer);
  byId("robot-save").disabled = !answer.passed;
  if (answer.scene) showArm(answer);
}

/** Another arm: it stands at rest until it is known how it moves. */
async function chooseArm() {
  place = {};
  const name = byId("robot-arm").value;
  const answer = await tried(get(path`/api/robots/${name}`));
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
  fill(byId("robot-arm"), ...arms.robots.map((value) => make("option", { value }, value)));
  const hear = ({ end, point }) => put(end === "start" ? "at" : "goal", point);
  send = await openArm(byId("arm"), "/arm.html", hear);
  await chooseArm();
}

async function shown() {
  const isFirst = !arms;
  arms ??= await tried(get("/api/robots"));
  const { symbols } = library(); // as it is now: answers may come in another order
  const id = toMove(symbols);
  const movable = symbols.filter((symbol) => symbol.path);
  const before = byId("robot-what").value;
  const options = movable.map(({ id: value, name }) => make("option", { value, selected: value === id }, name));
  fill(byId("robot-what"), ...options);
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
  for (const input of placeInputs())
    input.onchange = () => {
      const { end } = input.dataset;
      const point = placeInputs().flatMap(({ dataset, valueAsNumber }) => (dataset.end === end ? [valueAsNumber] : []));
      if (point.every(Number.isFinite)) put(end, point);
    };
  byId("robot-free").onclick = () => {
    place = {};
    plan();
  };
  byId("robot-form").onsubmit = (event) => {
    event.preventDefault();
    plan(true);
  };
  byId("robot-what").onchange = () => {
    chooseToMove(byId("robot-what").value);
    place = {};
    offer();
    plan();
  };
  byId("robot-arm").onchange = chooseArm;
  for (const id of ["robot-size", "robot-slow", "robot-dragged"]) byId(id).onchange = () => plan();
  byId("robot-save").onclick = saveJoints;
  onShow("robot", shown);
}
