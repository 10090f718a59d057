// From a mouse, a pen or a finger to samples with the times at which they happened.

/** @param {Hearer} hear */
export function followPointer(canvas, hear) {
  let pointer = null;
  let kind = "";
  let last = -Infinity;
  let first = 0;
  let box = canvas.getBoundingClientRect();

  const sampleOf = (event) => [
    (event.timeStamp - first) / 1000,
    (event.clientX - box.left) / box.height,
    1 - (event.clientY - box.top) / box.height,
  ];
  /** Hand on samples that are later than those before. */
  const tell = (events) => {
    const samples = events.map(sampleOf).filter(([time]) => {
      if (time <= last) return false;
      last = time;
      return true;
    });
    if (samples.length) hear.goes(samples);
  };
  const end = (event) => {
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
    tell([event]);
  });
  const goes = (event) => {
    if (event.pointerId !== pointer) return;
    if (!event.buttons) return end(event); // lifted where the page did not hear it
    const events = event.getCoalescedEvents?.() ?? [];
    tell(events.length ? events : [event]);
  };
  canvas.addEventListener("pointermove", goes);
  // The same samples, without waiting for the next frame; Chromium counts them from the corner of the outermost page.
  if (window === window.top) canvas.addEventListener("pointerrawupdate", goes);
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
}
