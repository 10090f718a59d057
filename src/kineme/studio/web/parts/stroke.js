// From a mouse, a pen or a finger to samples with the times at which they happened.

/** @typedef {number[]} Sample [time in s, x, y]; the canvas is 1 high, y points up. */

/**
 * @typedef {Object} Hearer
 * @property {(kind: string) => boolean} begins Tells whether one may draw.
 * @property {(samples: Sample[]) => void} goes
 * @property {() => void} ends
 * @property {(at: number[]|null) => void} [pen] Where the pen of the keyboard is.
 */

/**
 * @param {HTMLCanvasElement} canvas
 * @param {Hearer} hear
 */
export function followPointer(canvas, hear) {
  let pointer = null;
  let kind = "";
  let last = -Infinity;
  let first = 0;
  let box = canvas.getBoundingClientRect();

  /** @param {PointerEvent} event @returns {Sample[]} */
  const samplesOf = (event) => {
    const events = event.getCoalescedEvents?.() ?? [];
    return (events.length ? events : [event]).map((part) => sampleOf(part)).filter(later);
  };
  /** @param {PointerEvent} event @returns {Sample} */
  const sampleOf = (event) => [
    (event.timeStamp - first) / 1000,
    (event.clientX - box.left) / box.height,
    1 - (event.clientY - box.top) / box.height,
  ];
  /** @param {Sample} sample */
  const later = (sample) => {
    if (sample[0] <= last) return false;
    last = sample[0];
    return true;
  };
  const end = (/** @type {PointerEvent} */ event) => {
    if (event.pointerId !== pointer) return;
    pointer = null;
    hear.ends();
  };

  canvas.addEventListener("pointerdown", (event) => {
    const palm = kind === "touch" && event.pointerType === "pen"; // the hand came to rest before the pen
    if ((pointer !== null && !palm) || event.button !== 0 || !hear.begins(event.pointerType)) return;
    pointer = event.pointerId;
    kind = event.pointerType;
    canvas.setPointerCapture(pointer);
    first = event.timeStamp;
    box = canvas.getBoundingClientRect(); // where it is now: the hand does not jump when the window does
    last = -Infinity;
    hear.goes([sampleOf(event)].filter(later));
  });
  const goes = (/** @type {PointerEvent} */ event) => {
    if (event.pointerId !== pointer) return;
    if (!event.buttons) return end(event); // lifted where the page did not hear it
    const samples = samplesOf(event);
    if (samples.length) hear.goes(samples);
  };
  canvas.addEventListener("pointermove", goes);
  // The same samples, without waiting for the next frame; Chromium counts them from the corner of the outermost page.
  if (window === window.top) canvas.addEventListener("pointerrawupdate", goes);
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
}
