// What happens in the page of the studio, and when: run in it before its own modules.
(() => {
  const probe = { shown: null, answers: [], frames: [], moves: 0, drawn: 0, dragged: [] };
  window.probe = probe;
  const afterFrame = (act) =>
    requestAnimationFrame(() => {
      const channel = new MessageChannel();
      channel.port1.onmessage = () => act(performance.now());
      channel.port2.postMessage(0);
    });

  // First view: the frame in which the library's symbols are counted.
  const counted = new MutationObserver(() => {
    if (!/\d+ symbols/.test(document.getElementById("library-count")?.textContent ?? "")) return;
    counted.disconnect();
    afterFrame((now) => (probe.shown = now));
  });
  counted.observe(document, { subtree: true, childList: true, characterData: true });

  // Answers: each sample of the pointer until the state that was computed with it is in the page, and on the screen.
  let last = 0;
  const waiting = [];
  const asked = [];
  const noted = (event) => {
    const events = event.getCoalescedEvents();
    for (const { timeStamp } of events.length ? events : [event]) {
      if (timeStamp <= last || !event.buttons) continue;
      last = timeStamp;
      waiting.push(timeStamp);
    }
  };
  for (const kind of ["pointerdown", "pointermove", "pointerrawupdate"]) window.addEventListener(kind, noted, true);
  const Socket = window.WebSocket;
  window.WebSocket = class extends Socket {
    constructor(...how) {
      super(...how);
      const hear = (event) => event.data.startsWith('{"state"') && answered();
      setTimeout(() => this.addEventListener("message", hear)); // after the page
    }

    send(data) {
      if (data.startsWith('{"samples"')) asked.push(waiting.splice(0));
      super.send(data);
    }
  };
  function answered() {
    const [now, stamps] = [performance.now(), asked.shift() ?? []];
    afterFrame((shown) => probe.answers.push(...stamps.map((stamp) => [now - stamp, shown - stamp])));
  }

  // Dragging: the frames, and whether the path of each move is drawn in the frame of the move.
  let [on, moved, before, painted] = [false, false, false, false];
  const clear = CanvasRenderingContext2D.prototype.clearRect;
  CanvasRenderingContext2D.prototype.clearRect = function (...box) {
    if (this.canvas.id === "move-canvas") painted = true;
    clear.apply(this, box);
  };
  window.addEventListener(
    "pointermove",
    (event) => {
      if (!on) return;
      moved = true;
      afterFrame((now) => probe.dragged.push(now - event.timeStamp));
    },
    true,
  );
  const frame = (now) => {
    if (!on) return;
    probe.frames.push(now);
    if (before) [probe.moves, probe.drawn] = [probe.moves + 1, probe.drawn + (painted ? 1 : 0)];
    [before, moved, painted] = [moved, false, false];
    requestAnimationFrame(frame); // before the page asks for its own in the next frame
  };
  probe.dragging = (now) => {
    on = now;
    if (on) requestAnimationFrame(frame);
  };
})();
