// A thing is held and dragged until it is let go, or is gone. A second finger on the same thing is not heard.

const ENDS = ["pointerup", "pointercancel", "lostpointercapture"];

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
