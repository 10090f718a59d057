// The points one can take hold of: buttons over the picture, for the hand and for arrow keys.
import { ARROWS, drag } from "../parts/dragging.js";
import { byId, make } from "../parts/elements.js";
import { distance } from "../parts/geometry.js";
import { extent, pointsOf } from "./plan.js";

const STEP = 6; // of an arrow key [px]; ten times with Shift
const SMALLEST = 0.01; // radius of an obstacle, in sizes of the movement

/** The handles of a plan. @param {Plan} plan @param {Camera} camera @param {PointsPage} page @returns {Handle[]} */
export function handlesOf(plan, camera, page) {
  const smallest = SMALLEST * extent(plan.path);
  return pointsOf(plan).flatMap(({ key, kind, name, owner, field, list }) => {
    const remove = list && (() => page.removed(list, owner));
    const point = {
      ...{ key, kind, name, remove },
      at: () => owner[field],
      move: (to) => {
        owner[field] = to;
        page.changed();
      },
    };
    if (kind !== "obstacle") return [point];
    const rim = {
      ...{ key: `${key} rim`, kind: "rim", name: `Rim of ${name.toLowerCase()}`, remove },
      at: () => camera.moved(owner.center, owner.radius * camera.scale, 0),
      move: (to) => {
        owner.radius = Math.max(distance(to, owner.center), smallest);
        page.changed();
      },
    };
    return [point, rim];
  });
}

export class Handles {
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
    const { key, kind } = handle;
    const button = make("button", {
      ...{ class: `handle ${kind}`, type: "button", "data-key": `handle ${key}` },
      onpointerdown: (event) => this.grab(grip, event),
      onkeydown: (event) => this.key(grip, event),
      ondblclick: () => grip.handle.remove?.(),
    });
    const grip = { handle, button };
    byId("handles").append(button);
    return grip;
  }

  /** @param {Grip} grip */
  grab(grip, event) {
    let [x, y] = [event.clientX, event.clientY];
    const go = (now) => {
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

  /** @param {Grip} grip */
  key({ handle }, event) {
    if (event.key in ARROWS) {
      const far = STEP * (event.shiftKey ? 10 : 1);
      const [x, y] = ARROWS[event.key];
      handle.move(this.camera.moved(handle.at(), far * x, far * y));
    } else if (event.key === "Delete" && handle.remove) handle.remove();
    else return;
    event.preventDefault();
  }

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
