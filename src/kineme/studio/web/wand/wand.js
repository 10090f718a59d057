// The page for a phone: a finger draws, or the phone itself while the button is held; the studio shows it.
import { Board, color } from "../parts/canvas.js";
import { byId, write } from "../parts/elements.js";
import { line } from "../parts/lines.js";
import { followPointer } from "../parts/stroke.js";

const REACH = 1.6; // heights of the canvas for a turn by 1 rad
const BEAT = 3000; // between messages while nothing moves [ms]
const MOST = 500; // samples in one message
const INVITATION = "Draw below with a finger";
const GONE = "No longer connected. Open Use a phone in the studio and scan the new code.";

const id = crypto.randomUUID();
const button = byId("wand-hold");
/** @type {{begin?: boolean, samples?: number[][], finish?: boolean}[]} What the studio is still to be told. */
const waiting = [];
/** @type {number[][]} */
let ink = [];
let sending = false;
let lost = true;
const note = (/** @type {string} */ text) => write(byId("wand-note"), text);
const board = new Board(byId("wand-canvas"), ({ context, height }) =>
  line(
    context,
    ink.map(([, x, y]) => [x * height, (1 - y) * height]),
    { color: color("--ink"), width: 5 },
  ),
);

/** @param {{begin?: boolean, samples?: number[][], finish?: boolean}} message */
async function tell(message) {
  const last = waiting[waiting.length - 1];
  if (last && !last.finish && message.samples && last.samples?.length < MOST) last.samples.push(...message.samples);
  else waiting.push(message);
  if (sending) return;
  sending = true;
  while (waiting.length) {
    const next = waiting.shift();
    if (await isHeard(next)) continue;
    waiting.unshift(next); // once more, when the network is back
    await new Promise((done) => setTimeout(done, 1000));
  }
  sending = false;
}

/** @param {Object} message @returns {Promise<boolean>} */
async function isHeard(message) {
  const headers = { "Content-Type": "application/json" };
  const body = JSON.stringify({ id, ...message });
  const options = { method: "POST", headers, body, signal: AbortSignal.timeout(5000) };
  const said = await fetch("/api/samples", options).then(
    (response) => response.json(),
    () => null,
  );
  if (said?.error) note(said.error);
  else if (said?.label) note(`${said.certainty} ${said.label}`);
  else if (said?.certainty === "new") note("New. Name it in the studio");
  else if (!said || lost || "finish" in message) note(said ? INVITATION : GONE);
  lost = !said;
  return !lost;
}

/** @type {import("../parts/stroke.js").Hearer} */
const hearer = {
  begins: () => {
    ink = [];
    tell({ begin: true, samples: [] });
    return true;
  },
  goes: (samples) => {
    ink.push(...samples);
    board.draw();
    tell({ samples: [...samples] });
  },
  ends: () => tell({ finish: true }),
};

/**
 * Where the upper edge of the phone points, in space: x to the east, y to the north, z up.
 * @param {DeviceOrientationEvent} event Angles as the W3C defines them [degrees].
 */
function pointing({ alpha, beta }) {
  const [a, b] = [alpha, beta].map((angle) => (angle * Math.PI) / 180);
  return [-Math.sin(a) * Math.cos(b), Math.cos(a) * Math.cos(b), Math.sin(b)];
}

/** @type {{time: number, right: number[], up: number[]}|null} As the button was pressed: the plane that is drawn on. */
let start = null;

/** @param {DeviceOrientationEvent} event */
function turned(event) {
  if (event.alpha === null || !button.classList.contains("held")) return;
  const [x, y, z] = pointing(event);
  if (!start) {
    const flat = Math.hypot(x, y) || 1;
    const right = [y / flat, -x / flat, 0];
    start = { time: event.timeStamp, right, up: [(-z * x) / flat, (-z * y) / flat, flat] };
  }
  const along = (/** @type {number[]} */ axis) => REACH * (axis[0] * x + axis[1] * y + axis[2] * z);
  const middle = board.width / board.height / 2;
  const time = (event.timeStamp - start.time) / 1000;
  if (!ink.length || time > ink[ink.length - 1][0])
    hearer.goes([[time, middle + along(start.right), 0.5 + along(start.up)]]);
}

/** @param {PointerEvent} event */
function hold(event) {
  button.setPointerCapture(event.pointerId);
  start = null;
  button.classList.add("held");
  hearer.begins("wand");
}

async function release() {
  if (!button.classList.contains("held")) return;
  button.classList.remove("held");
  if (ink.length) return hearer.ends();
  const ask = /** @type {any} */ (window.DeviceOrientationEvent)?.requestPermission; // of iPhones, and only after a touch
  const may = ask && (await ask()) === "granted";
  note(may ? "Now hold the button and move" : "This phone does not tell how it turns. Draw with a finger");
}

followPointer(byId("wand-canvas"), hearer);
window.addEventListener("deviceorientation", turned);
button.addEventListener("pointerdown", hold);
button.addEventListener("pointerup", release);
button.addEventListener("pointercancel", release);
button.addEventListener("contextmenu", (event) => event.preventDefault());
setInterval(() => sending || tell({}), BEAT);
tell({});
