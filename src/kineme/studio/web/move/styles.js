// Sliders between the recordings of a symbol: in which ways its members differ.
import { get } from "../parts/api.js";
import { byId, fill, make } from "../parts/elements.js";

const SHOWN = 3; // directions, those that explain most

/** @param {any} symbol @returns {Promise<any>} Ranges of its styles, or null where its members do not differ. */
async function stylesOf(symbol) {
  if (symbol.n_members < 3) return null;
  return get(`/api/library/symbols/${encodeURIComponent(symbol.id)}/styles`).catch(() => null);
}

/**
 * @param {any} symbol
 * @param {(values: number[]|null, formulation: string) => void} changed Values of the directions and the only
 *   formulation in which they move; null is the prototype as it was recorded.
 * @param {() => boolean} current Whether the symbol is still the one that moves.
 */
export async function showStyles(symbol, changed, current) {
  byId("styles").hidden = true;
  const styles = await stylesOf(symbol);
  if (!styles?.lowest.length || !current()) return;
  const values = styles.lowest.map(() => 0);
  const box = byId("style-mix");
  const tell = () => changed(box.checked ? [...values] : null, styles.formulation);
  const rows = styles.lowest.slice(0, SHOWN).map((/** @type {number} */ low, /** @type {number} */ k) => {
    const slider = make("input", {
      type: "range",
      min: "-100",
      max: "100",
      "aria-label": `Style ${k + 1}`,
      disabled: true,
    });
    slider.value = "0";
    slider.addEventListener("input", () => {
      const at = Number(slider.value) / 100;
      values[k] = at < 0 ? -at * low : at * styles.highest[k];
      tell();
    });
    const share = make("span", { class: "soft says" }, `${Math.round(100 * styles.explained[k])} % of differences`);
    return make("label", { class: "style-row" }, make("span", { class: "small" }, `Style ${k + 1}`, share), slider);
  });
  box.checked = false;
  box.onchange = () => {
    for (const row of rows) row.querySelector("input").disabled = !box.checked;
    tell();
  };
  byId("style-says").textContent = `from their average in the ways they differ; moves as ${styles.formulation}`;
  fill(byId("style-rows"), ...rows);
  byId("styles").hidden = false;
}
