// The points one can take hold of: buttons over the picture, for the hand and for arrow keys.
import { drag } from "../parts/dragging.js";
import { byId, make } from "../parts/elements.js";

const STEP = 6; // of an arrow key [px]; ten times with Shift
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/**
 * @typedef {Object} Handle
 * @property {string} key
 * @property {string} kind
 * @property {string} name
 * @property {() => number[]} at
 * @property {(point: number[]) => void} move
 * @property {() => void} [remove]
 */

export class Handles {
  /**
   * @param {import("../parts/camera.js").Camera} camera
   * @param {{moving: (on: boolean) => void, said: (value: number) => string}} page
   */
  constructor(camera, page) {
    this.camera = camera;
    this.page = page;
    /** @type {Map<string, {handle: Handle, button: HTMLElement}>} */
    this.made = new Map();
    this.held = 0; // one by each finger
  }

  /** @param {Handle[]} handles Those that there are now. */
  set(handles) {
    const keys = new Set(handles.map((one) => one.key));
    for (const [key, { button }] of this.made) {
      if (keys.has(key)) continue;
      button.remove();
      this.made.delete(key);
    }
    for (const handle of handles) {
      const there = this.made.get(handle.key);
      if (there) there.handle = handle;
      else this.made.set(handle.key, this.add(handle));
    }
    this.place();
  }

  /** @param {Handle} handle */
  add(handle) {
    const made = {
      handle,
      button: make("button", { class: `handle ${handle.kind}`, type: "button", "data-key": `handle ${handle.key}` }),
    };
    made.button.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => this.grab(made, event));
    made.button.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => this.key(made, event));
    byId("handles").append(made.button);
    return made;
  }

  /** @param {{handle: Handle, button: HTMLElement}} made @param {PointerEvent} event */
  grab(made, event) {
    let [x, y] = [event.clientX, event.clientY];
    const go = (/** @type {PointerEvent} */ now) => {
      made.handle.move(this.camera.moved(made.handle.at(), now.clientX - x, now.clientY - y));
      [x, y] = [now.clientX, now.clientY];
    };
    const end = () => {
      this.held -= 1;
      this.page.moving(this.held > 0);
    };
    if (!drag(made.button, event, go, end)) return;
    event.preventDefault();
    made.button.focus({ preventScroll: true });
    this.held += 1;
    this.page.moving(true);
  }

  /** @param {{handle: Handle, button: HTMLElement}} made @param {KeyboardEvent} event */
  key(made, event) {
    if (event.key in KEYS) {
      const far = STEP * (event.shiftKey ? 10 : 1);
      const [x, y] = KEYS[event.key];
      made.handle.move(this.camera.moved(made.handle.at(), far * x, far * y));
    } else if (event.key === "Delete" && made.handle.remove) made.handle.remove();
    else return;
    event.preventDefault();
  }

  /** Put every button where its point is. */
  place() {
    for (const { handle, button } of this.made.values()) {
      const [x, y] = this.camera.toScreen(handle.at());
      button.style.setProperty("--x", `${x.toFixed(1)}px`);
      button.style.setProperty("--y", `${y.toFixed(1)}px`);
      button.setAttribute(
        "aria-label",
        `${handle.name} at ${handle
          .at()
          .map((value) => this.page.said(value))
          .join(", ")}`,
      );
      button.title = handle.name;
    }
  }
}
