// Robot: an arm executes a movement, and everything that is checked before is shown.
import { get, post } from "../parts/api.js";
import { byId, fill, make } from "../parts/elements.js";
import { library, onLibrary } from "../parts/library_state.js";
import { tried } from "../parts/toasts.js";
import { currentView, onShow } from "../parts/views.js";
import { chooseToMove, draggedGoal, toMove } from "../parts/chosen.js";

/** @type {any} What the server answered about arms. */
let arms = null;

/** @param {any} scene @param {any} joints Show the arm in a frame of its own: each movement gets a new one. */
function showArm(scene, joints) {
  const frame = make("iframe", { src: "/arm.html", title: "The arm moves", class: "arm-frame" });
  const ready = (/** @type {MessageEvent} */ event) => {
    if (event.source !== frame.contentWindow || event.data !== "ready") return;
    window.removeEventListener("message", ready);
    frame.contentWindow.postMessage({ scene, joints }, location.origin);
  };
  window.addEventListener("message", ready);
  fill(byId("arm"), frame);
  if (matchMedia("(max-width: 60rem)").matches) byId("arm").scrollIntoView({ block: "start" });
}

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

/** @param {Event} event */
async function move(event) {
  event.preventDefault();
  const symbol = byId("robot-what").value;
  if (!symbol) return;
  byId("robot-go").disabled = true;
  byId("robot-verdict").dataset.state = "";
  byId("robot-verdict").textContent = "Planning and checking …";
  const body = {
    what: { symbol },
    robot: byId("robot-arm").value,
    size: byId("robot-size").valueAsNumber || 0.3,
    slow_down: byId("robot-slow").checked,
    displacement: byId("robot-dragged").checked ? draggedGoal(symbol) : null,
  };
  const answer = await tried(() => post("/api/robots/move", body));
  byId("robot-go").disabled = false;
  if (!answer) byId("robot-verdict").textContent = "";
  if (!answer) return;
  showPreflight(answer);
  if (answer.scene) showArm(answer.scene, answer.joints);
}

/** Whether a goal was dragged in Move is offered where it was. */
function offer() {
  byId("robot-dragged").parentElement.hidden = draggedGoal(byId("robot-what").value) === null;
}

async function shown() {
  if (currentView() !== "robot") return;
  arms ??= await tried(() => get("/api/robots"));
  const { symbols } = library(); // as it is now: answers may come in another order
  const id = toMove(symbols);
  const movable = symbols.filter((/** @type {any} */ symbol) => symbol.path);
  fill(
    byId("robot-what"),
    ...movable.map((/** @type {any} */ symbol) =>
      make("option", { value: symbol.id, selected: symbol.id === id }, symbol.name),
    ),
  );
  offer();
  if (!arms) return;
  const ready = arms.available && movable.length > 0;
  byId("robot-empty").hidden = ready;
  byId("robot-main").hidden = !ready;
  byId("robot-empty-title").textContent = arms.available ? "Nothing to move yet" : "No arm here yet";
  byId("robot-why").textContent = arms.why ?? "Draw a movement and give it a name first; then an arm shows it.";
  byId("robot-draw").hidden = !arms.available;
  if (!byId("robot-arm").children.length)
    fill(byId("robot-arm"), ...arms.robots.map((/** @type {string} */ name) => make("option", { value: name }, name)));
}

export function startRobot() {
  byId("robot-form").addEventListener("submit", move);
  byId("robot-what").addEventListener("change", () => {
    chooseToMove(byId("robot-what").value);
    offer();
  });
  onShow("robot", shown);
  onLibrary(shown);
}
