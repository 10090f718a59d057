// The same points as numbers: every coordinate can be typed.
import { byId, fill, keepingFocus, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { extent, pointsOf, rounded } from "./plan.js";

const AXES = ["x", "y", "z"];

/**
 * @param {string} label
 * @param {string} value
 * @param {(value: number) => void} set
 * @param {Record<string, string>} more
 */
function number(label, value, set, more = {}) {
  const field = make("input", { type: "number", step: "any", "aria-label": label, "data-key": label, ...more });
  field.value = value;
  field.addEventListener("change", () => Number.isFinite(field.valueAsNumber) && set(field.valueAsNumber));
  return field;
}

/** The unit of positions, where the library says one. */
export const unit = () => library().channels?.find((/** @type {any} */ { kind }) => kind === "position")?.unit ?? "";

/** @param {import("./plan.js").Plan} plan @param {import("./edits.js").Page} page */
export function showPoints(plan, page) {
  const size = extent(plan.path);
  const rows = pointsOf(plan).map(({ kind, name, owner, field, list }) => {
    const short = (/** @type {number} */ value) => rounded(value, size);
    const write = (/** @type {(value: number) => void} */ set) => (/** @type {number} */ value) => {
      set(value);
      page.changed();
    };
    const fields = owner[field].map((/** @type {number} */ value, /** @type {number} */ k) =>
      number(
        `${name} ${AXES[k] ?? k}`,
        short(value),
        write((typed) => {
          owner[field][k] = typed;
        }),
      ),
    );
    const when = (/** @type {number} */ at) => {
      owner.at = Math.min(Math.max(at / 100, 0.01), 0.99);
    };
    const widen = (/** @type {number} */ radius) => {
      owner.radius = Math.abs(radius) || owner.radius;
    };
    if (kind === "via")
      fields.push(
        number(`${name} when, percent of the duration`, rounded(100 * owner.at, 100), write(when), {
          min: "1",
          max: "99",
        }),
      );
    if (kind === "obstacle") fields.push(number(`${name} radius`, short(owner.radius), write(widen), { min: "0" }));
    const on = { click: () => page.removed(list, owner) };
    const remove = { class: "button quiet square", type: "button", "aria-label": `Remove ${name}`, on };
    return make(
      "li",
      { class: "point" },
      make("span", { class: "point-name" }, name),
      make("span", { class: "point-fields" }, ...fields),
      list ? make("button", remove, "×") : make("span", {}),
    );
  });
  const heads = plan.start.map((_, k) => AXES[k] ?? String(k + 1));
  if (unit()) heads[0] += ` [${unit()}]`;
  const { via, obstacles } = plan;
  if (via.length || obstacles.length) heads.push(via.length ? (obstacles.length ? "%, radius" : "when %") : "radius");
  const cells = heads.map((text) => make("span", {}, text));
  const head = make("span", { class: "point-fields" }, ...cells);
  byId("points").classList.toggle("deep", heads.length > 3);
  byId("points").style.setProperty("--columns", String(heads.length));
  keepingFocus(() =>
    fill(byId("points"), make("li", { class: "point head", "aria-hidden": "true" }, make("span", {}), head), ...rows),
  );
}
