// A view in space is turned by dragging its background, and by the arrow keys.
import { drag } from "./dragging.js";

const STEPS = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] };

/**
 * @param {HTMLCanvasElement} canvas
 * @param {() => boolean} turns Whether it can be turned now.
 * @param {(dx: number, dy: number) => void} turn By pixels.
 */
export function followTurns(canvas, turns, turn) {
  canvas.addEventListener("pointerdown", (event) => {
    if (turns()) drag(canvas, event, (now) => turn(now.movementX, now.movementY));
  });
  canvas.addEventListener("keydown", (event) => {
    const step = STEPS[event.key];
    if (!step || !turns()) return;
    event.preventDefault();
    turn(step[0], step[1]);
  });
}
