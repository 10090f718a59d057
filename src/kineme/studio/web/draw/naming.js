// "Name it": a name in the field, or one that it may have, and the drawing is learned.
import { learn } from "../parts/changes.js";
import { byId, fill, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";

/** @param {{drawn: () => any, learned: (name: string|null) => void}} page `drawn` is what would be learned, or null. */
export function startNaming(page) {
  const field = byId("naming-name");

  /** @param {string|null} name */
  const keep = async (name) => {
    const drawn = page.drawn();
    if (!drawn || name === "") return;
    byId("naming-learn").disabled = true;
    const done = await learn(drawn, name);
    byId("naming-learn").disabled = !page.drawn();
    if (done && page.drawn() === drawn) page.learned(name); // not where another is drawn by now
  };

  byId("naming").addEventListener("submit", (/** @type {Event} */ event) => {
    event.preventDefault();
    keep(field.value.trim());
  });
  byId("draw-save").addEventListener("click", () => keep(null));

  /** @param {boolean} may @param {string[]} names That it may have. */
  const allow = (may, names = []) => {
    const open = may && !library().read_only;
    field.disabled = !open;
    byId("naming-learn").disabled = !open;
    byId("draw-save").disabled = !open;
    const chip = (/** @type {string} */ name) =>
      make(
        "button",
        { class: "button chip", type: "button", "aria-label": `Learn as ${name}`, on: { click: () => keep(name) } },
        `+ ${name}`,
      );
    fill(byId("chips"), ...(open ? names.map(chip) : []));
  };
  return { allow, empty: () => (field.value = ""), focus: () => field.focus({ preventScroll: true }) };
}
