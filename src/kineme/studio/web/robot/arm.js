// Inside the frame: what the studio sends becomes the data of the viewer, and the viewer starts.
import { byId, make } from "../parts/elements.js";
import { chart } from "./charts.js";

window.addEventListener("message", (event) => {
  if (event.origin !== location.origin || event.source !== parent || !event.data?.scene || byId("data")) return;
  const { scene, joints } = event.data;
  document.body.append(make("script", { type: "application/json", id: "data" }, JSON.stringify(scene)));
  byId("charts").append(
    ...scene.joints.map((/** @type {string} */ name, /** @type {number} */ k) =>
      chart(scene, joints?.[k] ?? { name, low: null, high: null }, k),
    ),
  );
  const viewer = make("script", { src: "/vendor/viewer.js" });
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches)
    viewer.addEventListener("load", () => byId("play").click());
  document.body.append(viewer);
});
parent.postMessage("ready", location.origin);
