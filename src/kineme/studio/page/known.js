// The known movements: small pictures as buttons, one of them chosen; many are found by words of their names.

import { breakable } from "../web/parts/breakable.js";
import { element, make } from "./elements.js";
import { boxOf, createStage } from "./stage.js";

const MANY = 12; // that can be looked through

/**
 * The list of known movements.
 * @param {Object} runtime
 * @param {number[][][]} prototypes a path of each class
 * @param {function(string): void} choose
 */
export function createKnown(runtime, prototypes, choose) {
  const buttons = runtime.classes.map((name) => {
    const picture = make("canvas", { className: "picture" });
    picture.setAttribute("aria-hidden", "true");
    const button = make("button", { type: "button", title: name }, picture, make("span", {}, ...breakable(name)));
    button.addEventListener("click", () => choose(name));
    element("symbols").append(make("li", {}, button));
    return button;
  });
  element("find").hidden = buttons.length <= MANY;
  element("find").addEventListener("input", () => {
    const words = element("find").value.toLowerCase().split(/\s+/);
    for (const item of element("symbols").children)
      item.hidden = !words.every((word) => item.textContent.toLowerCase().includes(word));
  });

  /** Mark the one of that name; none for null. */
  function select(name) {
    buttons.forEach((button, c) => button.setAttribute("aria-pressed", String(runtime.classes[c] === name)));
  }

  /** The pictures, in a view that is turned and tilted. */
  function paint([turn, tilt]) {
    buttons.forEach((button, c) => {
      const small = createStage(button.firstChild, runtime.header.view, boxOf(prototypes[c]));
      small.turned(turn, tilt);
      small.cleared();
      small.line(prototypes[c], "--ink", { wide: 2 });
      small.dot(prototypes[c].at(-1), "--goal", { radius: 3.5, edge: 1 });
    });
  }

  return { select, paint };
}
