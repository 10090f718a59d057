// Inside the frame: the viewer shows what the studio sends, with a chart of each joint. Dragged ends go back.
import { byId, fill, make } from "../parts/elements.js";
import { svg } from "../parts/svg.js";

const [WIDTH, HEIGHT] = [300, 80];

/**
 * @param {any} scene
 * @param {{name: string, low: number|null, high: number|null}} joint
 * @param {number} k Its column.
 */
function chart(scene, joint, k) {
  const values = scene.positions.map((/** @type {number[]} */ row) => row[k]);
  const limits = [joint.low, joint.high].filter((limit) => Number.isFinite(limit));
  const low = Math.min(...values, ...limits);
  const high = Math.max(...values, ...limits);
  const room = 0.08 * (high - low || 1);
  const end = scene.times[scene.times.length - 1] || 1;
  const x = (/** @type {number} */ time) => (WIDTH * time) / end;
  const y = (/** @type {number} */ value) => HEIGHT * (1 - (value - low + room) / (high - low + 2 * room));
  const level = (/** @type {number} */ value) =>
    svg("line", { class: "limit", x1: 0, x2: WIDTH, y1: y(value), y2: y(value) });
  const path = values
    .map(
      (/** @type {number} */ value, /** @type {number} */ i) =>
        `${x(scene.times[i]).toFixed(1)} ${y(value).toFixed(1)}`,
    )
    .join("L");
  const picture = svg(
    "svg",
    { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none", "aria-hidden": "true" },
    svg("rect", { class: "approach", x: 0, y: 0, width: x(scene.begins), height: HEIGHT }),
    ...limits.map(level),
    svg("path", { class: "joint", d: `M${path}` }),
    svg("line", { class: "cursor", x1: 0, x2: 0, y1: 0, y2: HEIGHT }),
  );
  return make(
    "figure",
    { class: "chart" },
    make(
      "figcaption",
      {},
      make("span", { class: "name", title: joint.name }, joint.name),
      make("output", { "data-unit": "rad" }),
    ),
    picture,
  );
}

const viewer = /** @type {any} */ (window).kineme;
document.body.classList.toggle("mini", location.search === "?mini");
if (location.search !== "?mini")
  viewer.moved = (/** @type {string} */ end, /** @type {number[]} */ point) =>
    parent.postMessage({ end, point }, location.origin);

window.addEventListener("message", (event) => {
  if (event.origin !== location.origin || event.source !== parent) return;
  const { scene, joints, posture } = event.data;
  if (posture) viewer.pose(posture);
  if (!scene) return;
  fill(
    byId("charts"),
    ...scene.joints.map((/** @type {string} */ name, /** @type {number} */ k) =>
      chart(scene, joints?.[k] ?? { name, low: null, high: null }, k),
    ),
  );
  viewer.load(scene);
  const moves = scene.times.length > 1;
  document.body.classList.toggle("rests", !moves);
  if (moves && !matchMedia("(prefers-reduced-motion: reduce)").matches) byId("play").click();
});
parent.postMessage("ready", location.origin);
