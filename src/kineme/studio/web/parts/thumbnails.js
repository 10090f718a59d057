// A movement as a small picture that scales: its path and where it starts.
import { Camera } from "./camera.js";

/** @param {string} tag @param {Record<string, any>} attributes @param {...Node} children @returns {SVGElement} */
export function svg(tag, attributes, ...children) {
  const element = /** @type {SVGElement} */ (document.createElementNS("http://www.w3.org/2000/svg", tag));
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  element.append(...children);
  return element;
}

const SIDE = 100;

/** A path as it is seen in a square of 100. @param {number[][]} path */
export function flattened(path) {
  const camera = new Camera();
  if (path.length) camera.face([path]);
  camera.fit(path, SIDE, SIDE);
  return path.map((point) => camera.toScreen(point));
}

/** @param {number[][]|null} path @returns {SVGElement} */
export function thumbnail(path) {
  const drawn = flattened(path ?? []).map((point) => point.map((value) => value.toFixed(1)));
  const parts = drawn.length
    ? [
        svg("path", { d: `M${drawn.map((pair) => pair.join(" ")).join("L")}` }),
        svg("circle", { cx: drawn[0][0], cy: drawn[0][1], r: 4 }),
      ]
    : [];
  return svg("svg", { class: "thumb", viewBox: `0 0 ${SIDE} ${SIDE}`, "aria-hidden": "true" }, ...parts);
}
