// The page for a phone: a finger draws, or the phone itself while the button is held; the studio shows it.
import { Board, color } from "../parts/canvas.js";
import { byId, write } from "../parts/elements.js";
import { line } from "../parts/lines.js";
import { followPointer } from "../parts/stroke.js";

const REACH = 1.6; // heights of the canvas for a turn by 1 rad
const BEAT = 3000; // between messages while nothing moves [ms]
const MOST = 500; // samples in one message

const id = crypto.randomUUID();
const button = byId("wand-hold");
let ink = [];
let sent = 0; // samples of it
let over = false; // it has ended, and the studio is still to be told
let busy = false;
let lost = true;
let allowed = false; // the person was asked, where the browser wants that
let plane = null; // that is drawn on, as the button was pressed

const note = (text) => write(byId("wand-note"), text);
const board = new Board(byId("wand-canvas"), ({ context, height }) => {
  const pixels = ink.map(([, x, y]) => [x * height, (1 - y) * height]);
  line(context, pixels, { color: color("--ink"), width: 5 });
});

/** Tell the studio what it does not know yet; what comes meanwhile goes with the next message. */
async function tell() {
  if (busy) return;
  busy = true;
  do {
    const of = ink;
    const samples = ink.slice(sent, sent + MOST);
    const finish = over && sent + samples.length === ink.length;
    const body = JSON.stringify({ id, begin: sent === 0, samples, finish });
    const said = await fetch("/api/samples", { method: "POST", body, signal: AbortSignal.timeout(5000) })
      .then((response) => response.json())
      .catch(() => ({ error: "No longer connected. Open Use a phone in the studio and scan the new code" }));
    if (said.error || said.label) note(said.error ?? `${said.certainty} ${said.label}`);
    else if (said.certainty === "new") note("New. Name it in the studio");
    else if (lost || finish) note("Draw below with a finger");
    lost = Boolean(said.error);
    if (lost) await new Promise((done) => setTimeout(done, 1000));
    else if (of === ink) {
      sent += samples.length;
      over &&= !finish;
    }
  } while (sent < ink.length || over);
  busy = false;
}

/** @type {Hearer} */
const hearer = {
  begins: () => {
    [ink, sent, over, plane] = [[], 0, false, null];
    return true;
  },
  goes: (samples) => {
    ink.push(...samples);
    board.draw();
    tell();
  },
  ends: () => {
    over = true;
    tell();
  },
};

/** The upper edge of the phone points; angles are as the W3C defines them. */
function turned({ alpha, beta, timeStamp }) {
  if (alpha === null || !button.classList.contains("held")) return;
  const [a, b] = [alpha, beta].map((angle) => (angle * Math.PI) / 180);
  const [x, y, z] = [-Math.sin(a) * Math.cos(b), Math.cos(a) * Math.cos(b), Math.sin(b)]; // east, north, up
  const flat = Math.hypot(x, y);
  plane ??= { time: timeStamp, right: [y / flat, -x / flat, 0], up: [(-z * x) / flat, (-z * y) / flat, flat] };
  const along = (axis) => REACH * (axis[0] * x + axis[1] * y + axis[2] * z);
  const middle = board.width / board.height / 2;
  hearer.goes([[(timeStamp - plane.time) / 1000, middle + along(plane.right), 0.5 + along(plane.up)]]);
}

async function release() {
  button.classList.remove("held");
  if (ink.length) return hearer.ends();
  /** @type {any} */
  const asked = window.DeviceOrientationEvent; // only after a touch
  const may = !allowed && (await asked?.requestPermission?.()) === "granted";
  allowed = true;
  note(may ? "Now hold the button and move" : "This phone does not tell how it turns. Draw with a finger");
}

followPointer(byId("wand-canvas"), hearer);
window.addEventListener("deviceorientation", turned);
button.onpointerdown = (event) => {
  button.setPointerCapture(event.pointerId);
  button.classList.add("held");
  hearer.begins("wand");
};
button.onlostpointercapture = release;
button.oncontextmenu = () => false; // no menu
setInterval(tell, BEAT);
tell();
