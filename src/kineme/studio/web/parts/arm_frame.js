// The frame in which an arm is drawn: the scene of three.js and its ids stay in there; it may be as high as it says.
import { fill, make } from "./elements.js";

/**
 * Open the frame; `hear` is told where the start or the goal was dragged to.
 * @returns {Promise<(message: Object) => void>} Tells the frame what to show, once it listens.
 */
export const openArm = (host, address, hear) =>
  new Promise((done) => {
    const frame = make("iframe", { src: address, title: "The arm", class: "arm-frame" });
    window.addEventListener("message", ({ source, data }) => {
      if (source !== frame.contentWindow) return;
      if (data === "ready") done((message) => frame.contentWindow.postMessage(message, location.origin));
      else if ("height" in data) frame.style.setProperty("--height", `${data.height}px`);
      else hear(data);
    });
    fill(host, frame);
  });
