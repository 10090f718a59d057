// Each joint over time, between the limits that the URDF states.
import { make, svg } from "../parts/elements.js";

const [WIDTH, HEIGHT] = [300, 80];

/** @param {string} urdf @param {string} joint @returns {{low: number, high: number}|null} */
function limitsOf(urdf, joint) {
  const parsed = new DOMParser().parseFromString(urdf, "application/xml");
  const found = [...parsed.querySelectorAll("robot > joint")].find((one) => one.getAttribute("name") === joint);
  const limit = found?.getAttribute("type") === "continuous" ? null : found?.querySelector("limit");
  const [low, high] = ["lower", "upper"].map((name) => Number(limit?.getAttribute(name) ?? "0"));
  return limit && high > low ? { low, high } : null;
}

/** @param {any} scene @param {string} joint @param {number} k */
export function chart(scene, joint, k) {
  const values = scene.positions.map((/** @type {number[]} */ row) => row[k]);
  const limits = limitsOf(scene.urdf, joint);
  const low = Math.min(...values, limits?.low ?? Infinity);
  const high = Math.max(...values, limits?.high ?? -Infinity);
  const room = 0.08 * (high - low || 1);
  const end = scene.times[scene.times.length - 1] || 1;
  const x = (/** @type {number} */ time) => (WIDTH * time) / end;
  const y = (/** @type {number} */ value) => HEIGHT * (1 - (value - low + room) / (high - low + 2 * room));
  const level = (/** @type {number} */ value) => svg("line", { class: "limit", x1: 0, x2: WIDTH, y1: y(value), y2: y(value) });
  const path = values.map((/** @type {number} */ value, /** @type {number} */ i) => `${x(scene.times[i]).toFixed(1)} ${y(value).toFixed(1)}`).join("L");
  const picture = svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", "aria-hidden": "true" },
    svg("rect", { class: "approach", x: 0, y: 0, width: x(scene.begins), height: HEIGHT }),
    ...(limits ? [level(limits.low), level(limits.high)] : []),
    svg("path", { class: "joint", d: `M${path}` }),
    svg("line", { class: "cursor", x1: 0, x2: 0, y1: 0, y2: HEIGHT }),
  );
  return make("figure", { class: "chart" }, make("figcaption", {}, make("span", { class: "name" }, joint), make("output", { "data-unit": "rad" })), picture);
}
