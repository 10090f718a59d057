// "Name it": a name in the field, or one that it may have, and the drawing is learned.
import { learn } from "../parts/changes.js";
import { button, byId, fill } from "../parts/elements.js";
import { library } from "../parts/library_state.js";

/** @param {{movement: () => Movement|null, learned: (name: string|null) => void}} page @returns {Naming} */
export function startNaming(page) {
  const field = byId("naming-name");

  const keep = async (name) => {
    const movement = page.movement();
    if (!movement || name === "") return;
    byId("naming-learn").disabled = true;
    const answer = await learn(movement, name);
    byId("naming-learn").disabled = !page.movement();
    if (answer && page.movement() === movement) page.learned(name); // not where another is drawn by now
  };

  byId("naming").onsubmit = (event) => {
    event.preventDefault();
    keep(field.value.trim());
  };
  byId("draw-save").onclick = () => keep(null);

  return {
    allow: (may, names = []) => {
      const open = may && !library().read_only;
      field.disabled = byId("naming-learn").disabled = byId("draw-save").disabled = !open;
      const chip = (name, k) =>
        button(k ? `No, ${name}` : `Yes, it is ${name}`, () => keep(name), {
          class: k ? "button chip" : "button chip main",
        });
      fill(byId("chips"), ...(open ? names.map(chip) : []));
    },
    empty: () => (field.value = ""),
    focus: () => field.focus({ preventScroll: true }),
  };
}
