// A thing is held and dragged until it is let go, or is gone. A second finger on the same thing is not heard.

const ENDS = ["pointerup", "pointercancel", "lostpointercapture"];
const TURNS = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] };

/** @type {WeakSet<HTMLElement>} */
const held = new WeakSet();

/**
 * @param {HTMLElement} element
 * @param {PointerEvent} event That takes hold of it.
 * @param {(now: PointerEvent) => void} go
 * @param {() => void} end
 * @returns {boolean} Whether it is held from now on.
 */
export function drag(element, event, go, end = () => {}) {
  if (event.button !== 0 || held.has(element)) return false;
  const ours = (/** @type {PointerEvent} */ now) => now.pointerId === event.pointerId && go(now);
  const lost = (/** @type {PointerEvent} */ now) => {
    if (now.pointerId !== event.pointerId) return;
    held.delete(element);
    element.removeEventListener("pointermove", ours);
    for (const kind of ENDS) document.removeEventListener(kind, lost);
    end();
  };
  element.setPointerCapture(event.pointerId);
  held.add(element);
  element.addEventListener("pointermove", ours);
  // The document hears them also where the element is gone.
  for (const kind of ENDS) document.addEventListener(kind, lost);
  return true;
}

/**
 * Turn a view in space by dragging its background, and by the arrow keys.
 * @param {HTMLCanvasElement} canvas
 * @param {() => boolean} turns Whether it can be turned now.
 * @param {(dx: number, dy: number) => void} turn By pixels.
 */
export function followTurns(canvas, turns, turn) {
  canvas.addEventListener("pointerdown", (event) => {
    if (turns()) drag(canvas, event, (now) => turn(now.movementX, now.movementY));
  });
  canvas.addEventListener("keydown", (event) => {
    const step = TURNS[event.key];
    if (!step || !turns()) return;
    event.preventDefault();
    turn(step[0], step[1]);
  });
}
