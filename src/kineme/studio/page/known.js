// The known movements: small pictures as buttons, one of them chosen; many are found by words of their names.

import { breakable, byId, make } from "../web/parts/elements.js";
import { boxOf, createStage } from "./stage.js";

const MANY = 12; // that can be looked through

/**
 * The list of known movements.
 * @param {Object} runtime
 * @param {number[][][]} prototypes a path of each class
 * @param {(name: string) => void} choose
 */
export function createKnown(runtime, prototypes, choose) {
  const buttons = runtime.classes.map((name) => {
    const picture = make("canvas", { class: "picture", "aria-hidden": "true" });
    const button = make("button", { type: "button", title: name }, picture, make("span", {}, ...breakable(name)));
    button.addEventListener("click", () => choose(name));
    byId("symbols").append(make("li", {}, button));
    return button;
  });
  byId("find").hidden = buttons.length <= MANY;
  byId("find").addEventListener("input", () => {
    const words = byId("find").value.toLowerCase().split(/\s+/);
    for (const item of /** @type {HTMLCollectionOf<HTMLElement>} */ (byId("symbols").children))
      item.hidden = !words.every((word) => item.textContent.toLowerCase().includes(word));
  });

  /** Mark the one of that name; none for null. */
  function select(name) {
    for (const [c, button] of buttons.entries())
      button.setAttribute("aria-pressed", String(runtime.classes[c] === name));
  }

  /** The pictures, in a view that is turned and tilted. */
  function paint(angles) {
    buttons.forEach((button, c) => {
      const canvas = /** @type {HTMLCanvasElement} */ (button.firstChild);
      const small = createStage(canvas, runtime.header.view, boxOf(prototypes[c]));
      small.turned(angles);
      small.cleared();
      small.line(prototypes[c], "--ink", { wide: 2 });
      small.dot(prototypes[c].at(-1), "--goal", { radius: 3.5, edge: 1 });
    });
  }

  return { select, paint };
}
