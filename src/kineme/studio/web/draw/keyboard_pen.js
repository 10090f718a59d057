// A pen for the keyboard: space puts it down and lifts it, arrow keys steer it.
import { ARROWS } from "../parts/dragging.js";
import { clamp } from "../parts/geometry.js";

const SPEED = 0.6; // heights of the canvas a second
const SMOOTH = 0.18; // share of the way to the wanted velocity, each frame

/** @param {Hearer} hear */
export function followKeys(canvas, hear) {
  const held = new Set();
  let at = [0, 0];
  let velocity = [0, 0];
  let since = 0;
  let before = 0;
  let down = false;

  const wanted = () => {
    const sum = [...held].reduce(([x, y], key) => [x + ARROWS[key][0], y - ARROWS[key][1]], [0, 0]);
    const length = Math.hypot(...sum) || 1;
    return sum.map((value) => (SPEED * value) / length);
  };
  const step = (now) => {
    if (!down) return;
    const passed = Math.min((now - before) / 1000, 0.05);
    before = now;
    velocity = velocity.map((value, k) => value + SMOOTH * (wanted()[k] - value));
    const size = [canvas.clientWidth / canvas.clientHeight, 1];
    at = at.map((value, k) => clamp(value + passed * velocity[k], 0, size[k]));
    const moved = Math.hypot(...velocity) > 0.002;
    if (moved && !since) since = now - 1000 * passed;
    if (moved) hear.goes([[(now - since) / 1000, ...at]]);
    hear.pen(at);
    requestAnimationFrame(step);
  };
  const lift = () => {
    if (!down) return;
    down = false;
    hear.pen(null);
    hear.ends();
  };
  const put = () => {
    if (!hear.begins("keyboard")) return;
    [down, since, velocity] = [true, 0, [0, 0]];
    at = [canvas.clientWidth / canvas.clientHeight / 2, 0.5];
    before = performance.now();
    hear.pen(at);
    requestAnimationFrame(step);
  };

  canvas.addEventListener("keydown", (event) => {
    if (event.key === " ") down ? lift() : put();
    else if (event.key in ARROWS) held.add(event.key);
    else return;
    event.preventDefault();
  });
  canvas.addEventListener("keyup", (event) => held.delete(event.key));
  canvas.addEventListener("blur", () => {
    held.clear();
    lift();
  });
}
