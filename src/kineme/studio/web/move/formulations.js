// Formulations and how each is drawn: by its color and by its dashes.
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

/** @param {(name: string, on: boolean) => void} changed */
export function showFormulations(changed) {
  for (const formulation of FORMULATIONS) {
    const box = make("input", {
      type: "checkbox",
      checked: formulation === FORMULATIONS[0],
      on: { change: () => changed(formulation.name, box.checked) },
    });
    byId("formulations").append(
      make(
        "label",
        { class: "check" },
        box,
        make("span", { class: `key ${formulation.key}` }),
        make("span", {}, formulation.name, make("span", { class: "soft small says" }, formulation.says)),
      ),
    );
  }
}
