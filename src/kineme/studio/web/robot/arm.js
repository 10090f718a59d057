// Inside the frame: the viewer shows what the studio sends, and where the start or the goal was dragged to goes back.
import { byId, fill, make } from "../parts/elements.js";
import { svg } from "../parts/thumbnails.js";

/** A joint over time between its limits. */
function chart({ times, positions, begins }, { name, low, high }, k) {
  const values = positions.map((row) => row[k]);
  const limits = [low, high].filter(Number.isFinite);
  const least = Math.min(...values, ...limits);
  const room = Math.max(...values, ...limits) - least || 1;
  const x = (time) => (300 * time) / (times.at(-1) || 1);
  const y = (value) => 75 - (70 * (value - least)) / room;
  const place = (value, i) => `${x(times[i])} ${y(value)}`;
  const picture = svg(
    "svg",
    { viewBox: "0 0 300 80", preserveAspectRatio: "none", "aria-hidden": "true" },
    svg("rect", { class: "approach", width: x(begins), height: 80 }),
    ...limits.map((limit) => svg("line", { class: "limit", x2: 300, y1: y(limit), y2: y(limit) })),
    svg("path", { class: "joint", d: `M${values.map(place).join("L")}` }),
    svg("line", { class: "cursor", y2: 80 }),
  );
  const title = make("span", { class: "name", title: name }, name);
  return make("figure", "chart", make("figcaption", {}, title, make("output", { "data-unit": "rad" })), picture);
}

const viewer = window.kineme;
const tell = (message) => parent.postMessage(message, location.origin);
const { classList } = document.body;
classList.toggle("mini", location.search === "?mini");
if (location.search !== "?mini") viewer.moved = (end, point) => tell({ end, point });

window.addEventListener("message", ({ origin, source, data: { scene, joints, posture } }) => {
  if (origin !== location.origin || source !== parent) return;
  if (posture) viewer.pose(posture);
  if (!scene) return;
  fill(byId("charts"), ...joints.map((joint, k) => chart(scene, joint, k)));
  viewer.load(scene);
  classList.toggle("rests", scene.times.length < 2);
  if (scene.times.length > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches) viewer.play();
});
byId("save-picture").onclick = () => make("a", { href: viewer.picture(), download: "arm.png" }).click();
new ResizeObserver(() => tell({ height: document.body.offsetHeight })).observe(document.body);
tell("ready");
