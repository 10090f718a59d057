// Sliders between the recordings of a symbol: in which ways its members differ.
import { get, path } from "../parts/api.js";
import { byId, fill, make } from "../parts/elements.js";

const SHOWN = 3; // directions, those that explain most

/**
 * Offer the styles of a symbol while it is the `current` one. What has `changed` is told the values of the directions,
 * null for the prototype as it was recorded, and the only formulation in which they move.
 */
export async function showStyles(symbol, changed, current) {
  byId("styles").hidden = true;
  if (symbol.n_members < 3) return;
  const styles = await get(path`/api/library/symbols/${symbol.id}/styles`).catch(() => null);
  if (!styles?.lowest.length || !current()) return;
  const values = styles.lowest.map(() => 0);
  const box = byId("style-mix");
  const tell = () => changed(box.checked ? [...values] : null, styles.formulation);
  const rows = styles.lowest.slice(0, SHOWN).map((low, k) => {
    const name = `Style ${k + 1}`;
    const oninput = ({ target }) => {
      const at = target.valueAsNumber / 100;
      values[k] = at < 0 ? -at * low : at * styles.highest[k];
      tell();
    };
    const range = { type: "range", min: "-100", max: "100", value: "0" };
    const slider = make("input", { ...range, "aria-label": name, disabled: true, oninput });
    const share = make("span", "soft says", `${Math.round(100 * styles.explained[k])} % of differences`);
    return make("label", "style-row", make("span", "small", name, share), slider);
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
