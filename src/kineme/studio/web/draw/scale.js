// How large a drawing is: the canvas is as high as a movement of the library, in round numbers.
import { server } from "../parts/server.js";

const USUAL = 0.55; // of the canvas's height, what people draw

/** The larger side of a path. @param {number[][]} path */
const side = (path) =>
  Math.max(
    ...[0, 1].map(
      (k) => Math.max(...path.map((point) => point[k] ?? 0)) - Math.min(...path.map((point) => point[k] ?? 0)),
    ),
  );

/** @returns {number|null} Larger side of a movement of the library, a usual one. */
export function usualSide() {
  const sides = server
    .symbols()
    .filter((/** @type {any} */ symbol) => symbol.path?.length)
    .map((/** @type {any} */ symbol) => side(symbol.path))
    .filter((/** @type {number} */ size) => size > 0);
  return sides.sort((/** @type {number} */ a, /** @type {number} */ b) => a - b)[sides.length >> 1] ?? null;
}

/**
 * Height of the canvas in the units of the library: a power of ten, so that it stays as the library grows.
 * @returns {number}
 */
export function canvasHeight() {
  const middle = usualSide();
  return middle === null ? 1 : 10 ** Math.round(Math.log10(middle / USUAL));
}
