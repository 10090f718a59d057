// The same points as numbers: every coordinate can be typed.
import { button, byId, fill, keepingFocus, make } from "../parts/elements.js";
import { clamp } from "../parts/geometry.js";
import { library } from "../parts/library_state.js";
import { extent, pointsOf, rounded } from "./plan.js";

const AXES = ["x", "y", "z"];

/** The unit of positions, where the library says one. */
export const unit = () => library().channels?.find(({ kind }) => kind === "position")?.unit ?? "";

/** @param {Plan} plan @param {PointsPage} page */
export function showPoints(plan, page) {
  const size = extent(plan.path);
  const number = (label, value, set, limits = {}) => {
    const onchange = ({ target: { valueAsNumber: typed } }) => {
      if (!Number.isFinite(typed)) return;
      set(typed);
      page.changed();
    };
    const what = { type: "number", step: "any", "aria-label": label, "data-key": label };
    return make("input", { ...what, ...limits, value, onchange });
  };
  const rows = pointsOf(plan).map(({ kind, name, owner, field, list }) => {
    const fields = owner[field].map((value, k) =>
      number(`${name} ${AXES[k] ?? k}`, rounded(value, size), (typed) => (owner[field][k] = typed)),
    );
    const when = (at) => (owner.at = clamp(at / 100, 0.01, 0.99));
    const widen = (radius) => (owner.radius = Math.abs(radius) || owner.radius);
    const [share, percent] = [rounded(100 * owner.at, 100), { min: "1", max: "99" }];
    if (kind === "via") fields.push(number(`${name} when, percent of the duration`, share, when, percent));
    if (kind === "obstacle") fields.push(number(`${name} radius`, rounded(owner.radius, size), widen, { min: "0" }));
    const look = { class: "button quiet square", "aria-label": `Remove ${name}` };
    const parts = [make("span", "point-name", name), make("span", "point-fields", ...fields)];
    return make("li", "point", ...parts, list ? button("×", () => page.removed(list, owner), look) : make("span"));
  });
  const heads = plan.start.map((_, k) => AXES[k] ?? String(k + 1));
  if (unit()) heads[0] += ` [${unit()}]`;
  const { via, obstacles } = plan;
  if (via.length || obstacles.length) heads.push(via.length ? (obstacles.length ? "%, radius" : "when %") : "radius");
  const cells = make("span", "point-fields", ...heads.map((text) => make("span", {}, text)));
  const head = make("li", { class: "point head", "aria-hidden": "true" }, make("span"), cells);
  byId("points").classList.toggle("deep", heads.length > 3);
  byId("points").style.setProperty("--columns", String(heads.length));
  keepingFocus(() => fill(byId("points"), head, ...rows));
}
