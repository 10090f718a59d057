// Formulations and how each is drawn: by its color and by its dashes. Two have plain words, all are under Advanced.
import { byId, make } from "../parts/elements.js";

export const FORMULATIONS = [
  {
    name: "bio-inspired",
    says: "keeps the shape, bent towards the goal",
    key: "first",
    look: { color: "--ink", dash: [] },
  },
  {
    name: "amplitude-scaled",
    says: "scales the whole movement",
    key: "second",
    look: { color: "--predicted", dash: [9, 6] },
  },
  { name: "original", says: "stretches each axis by its own", key: "third", look: { color: "--goal", dash: [2, 6] } },
];

/** @param {(names: string[]) => void} changed */
export function showFormulations(changed) {
  const boxes = FORMULATIONS.map(({ name, key, says }, k) => {
    const box = make("input", { type: "checkbox", value: name, checked: k === 0 });
    const words = make("span", {}, name, make("span", { class: "soft small says" }, says));
    byId("formulations").append(make("label", { class: "check" }, box, make("span", { class: `key ${key}` }), words));
    return box;
  });
  const manners = /** @type {NodeListOf<HTMLInputElement>} */ (document.getElementsByName("manner"));
  const show = () => {
    const names = boxes.filter((box) => box.checked).map((box) => box.value);
    for (const manner of manners) manner.checked = names.join() === manner.value;
    changed(names);
  };
  byId("formulations").addEventListener("change", show);
  byId("manner").addEventListener("change", (event) => {
    for (const box of boxes) box.checked = box.value === /** @type {HTMLInputElement} */ (event.target).value;
    show();
  });
}
