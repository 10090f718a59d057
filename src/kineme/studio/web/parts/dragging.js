// A thing is held and dragged until it is let go, or is gone. A second finger on the same thing is not heard.

const ENDS = ["pointerup", "pointercancel", "lostpointercapture"];
const TURN = 12; // by an arrow key [px]

/** Where arrow keys go on the screen. */
export const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

const held = new WeakSet();

/** Hold an element from an event on. @param {(now: PointerEvent) => void} go @returns Whether it is held. */
export function drag(element, event, go, end = () => {}) {
  if (event.button !== 0 || held.has(element)) return false;
  const ours = (now) => now.pointerId === event.pointerId && go(now);
  const lost = (now) => {
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

/** Turn a view in space, while it `turns`, by dragging its background, and by the arrow keys: by pixels. */
export function followTurns(canvas, view) {
  canvas.addEventListener("pointerdown", (event) => {
    if (view.turns) drag(canvas, event, (now) => view.turn(now.movementX, now.movementY));
  });
  canvas.addEventListener("keydown", (event) => {
    const [dx, dy] = ARROWS[event.key] ?? [];
    if (dx === undefined || !view.turns) return;
    event.preventDefault();
    view.turn(TURN * dx, TURN * dy);
  });
}
