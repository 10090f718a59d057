// A gamepad as a pen: its sticks move it, a held button draws.
import { clamp } from "../parts/geometry.js";
import { currentView } from "../parts/views.js";

const SPEED = 1.2; // heights of the canvas a second
const DEAD = 0.15; // of a stick's way, within which it rests
const SOURCE = { id: -1, name: "gamepad (hold a button to draw)", movement: 0, samples: [], state: null, ended: null };

/** The sources have it while it is connected. @param {Hearer} hear @param {Sources} sources */
export function followGamepad(canvas, hear, sources) {
  let at = [0.5, 0.5];
  let before = 0;
  let since = 0;
  let held = false;
  let down = false;

  const step = (now) => {
    const pad = navigator.getGamepads().find(Boolean);
    const on = pad && !sources.ignored.has(SOURCE.name) && currentView() === "draw";
    const presses = Boolean(on && pad.buttons.slice(0, 8).some((button) => button.pressed));
    if (presses && !held) [down, since] = [hear.begins("gamepad"), 0];
    if (!presses && down) hear.ends();
    held = presses;
    down &&= presses;
    hear.pen(on ? at : null);
    if (!pad) return sources.hear({ ...SOURCE, gone: true });
    const [x, y, more = 0, up = 0] = pad.axes;
    const way = [x + more, -y - up];
    const length = Math.hypot(...way);
    const passed = Math.min(now - before, 50) / 1000;
    before = now;
    if (on && length > DEAD) {
      const size = [canvas.clientWidth / canvas.clientHeight, 1];
      const to = at.map((value, k) => value + (SPEED * passed * way[k]) / Math.max(length, 1));
      at = to.map((value, k) => clamp(value, 0, size[k]));
      since ||= now - 1000 * passed;
      if (down) hear.goes([[(now - since) / 1000, ...at]]);
    }
    requestAnimationFrame(step);
  };
  window.addEventListener("gamepadconnected", () => {
    if (sources.connected.has(SOURCE.id)) return;
    sources.hear(SOURCE);
    requestAnimationFrame(step);
  });
}
