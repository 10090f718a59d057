// The points one can take hold of: buttons over the picture, for the hand and for arrow keys.
import { drag } from "../parts/dragging.js";
import { byId, make } from "../parts/elements.js";
import { extent } from "./plan.js";

const STEP = 6; // of an arrow key [px]; ten times with Shift
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const SMALLEST = 0.01; // radius of an obstacle, in sizes of the movement

/**
 * @typedef {Object} Handle
 * @property {string} key
 * @property {string} kind
 * @property {string} name
 * @property {() => number[]} at
 * @property {(point: number[]) => void} move
 * @property {() => void} [remove]
 *
 * @typedef {{handle: Handle, button: HTMLButtonElement}} Grip
 */

/**
 * The handles of a plan.
 * @param {import("./plan.js").Plan} plan
 * @param {import("../parts/camera.js").Camera} camera
 * @param {{changed: () => void, removed: () => void}} page
 * @returns {Handle[]}
 */
export function handlesOf(plan, camera, page) {
  const smallest = SMALLEST * extent(plan.path);
  /** @type {(owner: any, field: string) => Pick<Handle, "at"|"move">} */
  const point = (owner, field) => ({
    at: () => owner[field],
    move: (to) => {
      owner[field] = to;
      page.changed();
    },
  });
  /** @type {(obstacle: import("./plan.js").Obstacle) => Pick<Handle, "at"|"move">} */
  const rim = (obstacle) => ({
    at: () => camera.moved(obstacle.center, obstacle.radius * camera.scale, 0),
    move: (to) => {
      obstacle.radius = Math.max(Math.hypot(...to.map((value, k) => value - obstacle.center[k])), smallest);
      page.changed();
    },
  });
  const remove = (/** @type {Object[]} */ points, /** @type {number} */ k) => () => {
    points.splice(k, 1);
    page.removed();
  };
  return [
    { key: "start", kind: "start", name: "Start", ...point(plan, "start") },
    { key: "goal", kind: "goal", name: "Goal", ...point(plan, "goal") },
    ...plan.via.map((via, k) => ({
      key: `via ${k}`,
      kind: "via",
      name: `Via point ${k + 1}`,
      remove: remove(plan.via, k),
      ...point(via, "point"),
    })),
    ...plan.obstacles.map((obstacle, k) => ({
      key: `obstacle ${k}`,
      kind: "obstacle",
      name: `Obstacle ${k + 1}`,
      remove: remove(plan.obstacles, k),
      ...point(obstacle, "center"),
    })),
    ...plan.obstacles.map((obstacle, k) => ({
      key: `rim ${k}`,
      kind: "rim",
      name: `Rim of obstacle ${k + 1}`,
      remove: remove(plan.obstacles, k),
      ...rim(obstacle),
    })),
  ];
}

export class Handles {
  /**
   * @param {import("../parts/camera.js").Camera} camera
   * @param {{moving: (on: boolean) => void, text: (value: number) => string}} page
   */
  constructor(camera, page) {
    this.camera = camera;
    this.page = page;
    /** @type {Map<string, Grip>} */
    this.grips = new Map();
    this.held = 0; // by as many fingers
  }

  /** @param {Handle[]} handles Those that there are now. */
  set(handles) {
    const keys = new Set(handles.map((handle) => handle.key));
    for (const [key, { button }] of this.grips) {
      if (keys.has(key)) continue;
      button.remove();
      this.grips.delete(key);
    }
    for (const handle of handles) {
      const grip = this.grips.get(handle.key);
      if (grip) grip.handle = handle;
      else this.grips.set(handle.key, this.add(handle));
    }
    this.place();
  }

  /** @param {Handle} handle @returns {Grip} */
  add(handle) {
    const button = make("button", {
      class: `handle ${handle.kind}`,
      type: "button",
      "data-key": `handle ${handle.key}`,
    });
    const grip = { handle, button };
    button.addEventListener("pointerdown", (event) => this.grab(grip, event));
    button.addEventListener("keydown", (event) => this.key(grip, event));
    button.addEventListener("dblclick", () => grip.handle.remove?.());
    byId("handles").append(button);
    return grip;
  }

  /** @param {Grip} grip @param {PointerEvent} event */
  grab(grip, event) {
    let [x, y] = [event.clientX, event.clientY];
    const go = (/** @type {PointerEvent} */ now) => {
      grip.handle.move(this.camera.moved(grip.handle.at(), now.clientX - x, now.clientY - y));
      [x, y] = [now.clientX, now.clientY];
    };
    const end = () => {
      this.held -= 1;
      this.page.moving(this.held > 0);
    };
    if (!drag(grip.button, event, go, end)) return;
    event.preventDefault();
    grip.button.focus({ preventScroll: true });
    this.held += 1;
    this.page.moving(true);
  }

  /** @param {Grip} grip @param {KeyboardEvent} event */
  key({ handle }, event) {
    if (event.key in KEYS) {
      const far = STEP * (event.shiftKey ? 10 : 1);
      const [x, y] = KEYS[event.key];
      handle.move(this.camera.moved(handle.at(), far * x, far * y));
    } else if (event.key === "Delete" && handle.remove) handle.remove();
    else return;
    event.preventDefault();
  }

  /** @param {string} key */
  focus(key) {
    this.grips.get(key)?.button.focus({ preventScroll: true });
  }

  /** Put every button where its point is. */
  place() {
    for (const { handle, button } of this.grips.values()) {
      const point = handle.at();
      const [x, y] = this.camera.toScreen(point);
      button.style.setProperty("--x", `${x.toFixed(1)}px`);
      button.style.setProperty("--y", `${y.toFixed(1)}px`);
      const text = point.map((value) => this.page.text(value)).join(", ");
      button.setAttribute("aria-label", `${handle.name} at ${text}`);
      button.title = handle.remove ? `${handle.name}; a double click removes it` : handle.name;
    }
  }
}
