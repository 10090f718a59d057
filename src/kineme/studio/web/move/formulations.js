// Formulations and how each is drawn: by its color and by its dashes. Two have plain words, all are under Advanced.
import { byId } from "../parts/elements.js";

export const FORMULATIONS = [
  { name: "bio-inspired", key: "first", look: { color: "--ink", dash: [] } },
  { name: "amplitude-scaled", key: "second", look: { color: "--predicted", dash: [9, 6] } },
  { name: "original", key: "third", look: { color: "--goal", dash: [2, 6] } },
];

export function startFormulations(changed) {
  const boxes = [...byId("formulations").querySelectorAll("input")];
  const manners = [...byId("manner").querySelectorAll("input")];
  const show = () => {
    const names = boxes.filter((box) => box.checked).map((box) => box.value);
    for (const manner of manners) manner.checked = names.join() === manner.value;
    changed(names);
  };
  byId("formulations").onchange = show;
  byId("manner").onchange = () => {
    const { value } = manners.find((manner) => manner.checked);
    for (const box of boxes) box.checked = box.value === value;
    show();
  };
}

/** A style moves in its own formulation alone. */
export function allowFormulations(on) {
  byId("formulations").disabled = byId("manner").disabled = !on;
}
