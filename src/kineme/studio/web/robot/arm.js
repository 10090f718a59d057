// Inside the frame: the viewer shows what the studio sends, and where the start or the goal was dragged to goes back.
const viewer = /** @type {any} */ (window).kineme;
const { classList } = document.body;
classList.toggle("mini", location.search === "?mini");
if (location.search !== "?mini")
  viewer.moved = (/** @type {string} */ end, /** @type {number[]} */ point) =>
    parent.postMessage({ end, point }, location.origin);

window.addEventListener("message", ({ origin, source, data: { scene, posture } }) => {
  if (origin !== location.origin || source !== parent) return;
  if (posture) viewer.pose(posture);
  if (!scene) return;
  viewer.load(scene);
  classList.toggle("rests", scene.times.length < 2);
  if (scene.times.length > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches) viewer.play();
});
parent.postMessage("ready", location.origin);
