// A movement as a small picture that scales: its path and where it starts.
import { Camera } from "./camera.js";

/** @param {...any} children */
export function svg(tag, attributes, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

const SIDE = 100;

/** A path as it is seen in a square of 100. */
export function flattened(path) {
  const camera = new Camera();
  if (path.length) camera.face([path]);
  camera.fit(path, SIDE, SIDE);
  return path.map((point) => camera.toScreen(point));
}

export function thumbnail(path) {
  const picture = svg("svg", { class: "thumb", viewBox: `0 0 ${SIDE} ${SIDE}`, "aria-hidden": "true" });
  const drawn = flattened(path ?? []).map((point) => point.map((value) => value.toFixed(1)));
  if (!drawn.length) return picture;
  const [[cx, cy]] = drawn;
  picture.append(
    svg("path", { d: `M${drawn.map((pair) => pair.join(" ")).join("L")}` }),
    svg("circle", { cx, cy, r: 4 }),
  );
  return picture;
}
