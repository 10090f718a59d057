// The same points as numbers: every coordinate can be typed.
import { byId, fill, keepingFocus, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { extent, rounded } from "./plan.js";

const AXES = ["x", "y", "z"];

/**
 * @param {string} label
 * @param {string} key
 * @param {string} value
 * @param {(value: number) => void} set
 * @param {Record<string, string>} more
 */
function number(label, key, value, set, more = {}) {
  const field = make("input", {
    type: "number",
    step: "any",
    "aria-label": label,
    "data-key": `number ${key}`,
    ...more,
  });
  field.value = value;
  field.addEventListener("change", () => Number.isFinite(field.valueAsNumber) && set(field.valueAsNumber));
  return field;
}

/**
 * @param {string} name
 * @param {number[]} point
 * @param {(value: number) => string} short
 * @param {() => void} changed
 * @param {(() => void)|null} remove
 * @param {...HTMLElement} more
 */
function row(name, point, short, changed, remove, ...more) {
  const fields = point.map((value, k) =>
    number(`${name} ${AXES[k] ?? k}`, `${name} ${k}`, short(value), (typed) => {
      point[k] = typed;
      changed();
    }),
  );
  const away =
    remove &&
    make(
      "button",
      { class: "button quiet square", type: "button", "aria-label": `Remove ${name}`, on: { click: remove } },
      "×",
    );
  return make(
    "li",
    { class: "point" },
    make("span", { class: "point-name" }, name),
    make("span", { class: "point-fields" }, ...fields, ...more),
    away ?? make("span", {}),
  );
}

/** The unit of positions, where the library says one. */
export const unit = () => library().channels?.find((/** @type {any} */ { kind }) => kind === "position")?.unit ?? "";

/**
 * @param {import("./plan.js").Plan} plan
 * @param {() => void} changed After a number.
 * @param {() => void} removed After a point went away.
 */
export function showPoints(plan, changed, removed) {
  const size = extent(plan.path);
  const short = (/** @type {number} */ value) => rounded(value, size);
  const drop = (/** @type {Object[]} */ points, /** @type {number} */ k) => () => {
    points.splice(k, 1);
    removed();
  };
  const via = plan.via.map((via, k) => {
    const when = (/** @type {number} */ at) => {
      via.at = Math.min(Math.max(at / 100, 0.01), 0.99);
      changed();
    };
    const title = "When, percent of the duration";
    const time = rounded(100 * via.at, 100);
    return row(
      `Via ${k + 1}`,
      via.point,
      short,
      changed,
      drop(plan.via, k),
      number(`Via ${k + 1} when, percent of the duration`, `via ${k} when`, time, when, { min: "1", max: "99", title }),
    );
  });
  const obstacles = plan.obstacles.map((obstacle, k) => {
    const widen = (/** @type {number} */ radius) => {
      obstacle.radius = Math.abs(radius) || obstacle.radius;
      changed();
    };
    const [label, key, title] = [`Obstacle ${k + 1} radius`, `obstacle ${k} radius`, "Radius"];
    return row(
      `Obstacle ${k + 1}`,
      obstacle.center,
      short,
      changed,
      drop(plan.obstacles, k),
      number(label, key, short(obstacle.radius), widen, { min: "0", title }),
    );
  });
  const extra = via.length || obstacles.length ? 1 : 0;
  const last = via.length ? (obstacles.length ? "%, radius" : "when %") : "radius";
  const heads = plan.start.map((_, k) => AXES[k] ?? String(k + 1));
  if (unit()) heads[0] += ` [${unit()}]`;
  if (extra) heads.push(last);
  const head = make(
    "li",
    { class: "point head", "aria-hidden": "true" },
    make("span", {}),
    make("span", { class: "point-fields" }, ...heads.map((text) => make("span", {}, text))),
  );
  byId("points").classList.toggle("deep", plan.start.length + extra > 3);
  byId("points").style.setProperty("--columns", String(plan.start.length + extra));
  keepingFocus(() =>
    fill(
      byId("points"),
      head,
      row("Start", plan.start, short, changed, null),
      row("Goal", plan.goal, short, changed, null),
      ...via,
      ...obstacles,
    ),
  );
}
