// "Name it": a name in the field, or one that it may have, and the drawing is learned.
import { learn } from "../parts/changes.js";
import { byId, fill, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";

/**
 * @typedef {Object} Naming
 * @property {(may: boolean, names?: string[]) => void} allow Names that the movement may have are offered.
 * @property {() => void} empty
 * @property {() => void} focus
 */

/**
 * @param {Object} page
 * @param {() => import("./session.js").Movement|null} page.movement That would be learned.
 * @param {(name: string|null) => void} page.learned
 * @returns {Naming}
 */
export function startNaming(page) {
  const field = byId("naming-name");

  /** @param {string|null} name */
  const keep = async (name) => {
    const movement = page.movement();
    if (!movement || name === "") return;
    byId("naming-learn").disabled = true;
    const answer = await learn(movement, name);
    byId("naming-learn").disabled = !page.movement();
    if (answer && page.movement() === movement) page.learned(name); // not where another is drawn by now
  };

  byId("naming").addEventListener("submit", (event) => {
    event.preventDefault();
    keep(field.value.trim());
  });
  byId("draw-save").addEventListener("click", () => keep(null));

  return {
    allow: (may, names = []) => {
      const open = may && !library().read_only;
      field.disabled = !open;
      byId("naming-learn").disabled = !open;
      byId("draw-save").disabled = !open;
      const chip = (/** @type {string} */ name, /** @type {number} */ k) =>
        make(
          "button",
          { class: k ? "button chip" : "button chip main", type: "button", on: { click: () => keep(name) } },
          k ? `No, ${name}` : `Yes, it is ${name}`,
        );
      fill(byId("chips"), ...(open ? names.map(chip) : []));
    },
    empty: () => {
      field.value = "";
    },
    focus: () => field.focus({ preventScroll: true }),
  };
}
