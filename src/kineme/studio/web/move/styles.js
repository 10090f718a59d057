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
  const box = make("input", { type: "checkbox", "data-key": "mix" });
  const sliders = styles.lowest.slice(0, SHOWN).map((/** @type {number} */ low, /** @type {number} */ k) => {
    const high = styles.highest[k];
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
      values[k] = at < 0 ? -at * low : at * high;
      changed([...values], styles.formulation);
    });
    return {
      slider,
      row: make(
        "label",
        { class: "style-row" },
        make(
          "span",
          { class: "small" },
          `Style ${k + 1}`,
          make("span", { class: "soft says" }, `${Math.round(100 * styles.explained[k])} % of differences`),
        ),
        slider,
      ),
    };
  });
  box.addEventListener("change", () => {
    for (const { slider } of sliders) slider.disabled = !box.checked;
    changed(box.checked ? [...values] : null, styles.formulation);
  });
  fill(
    byId("style-rows"),
    make(
      "label",
      { class: "check" },
      box,
      make(
        "span",
        {},
        "Between its recordings",
        make(
          "span",
          { class: "soft small says" },
          `from their average in the ways they differ; moves as ${styles.formulation}`,
        ),
      ),
    ),
    ...sliders.map(({ row }) => row),
  );
  byId("styles").hidden = false;
}
