// How large a drawing is: the canvas is as high as a movement of the library, in round numbers.
import { spans } from "../parts/geometry.js";
import { server } from "../parts/server.js";

const USUAL = 0.55; // of the canvas's height, what people draw

/** The larger side of a movement of the library, a usual one. */
export function usualSide() {
  const paths = server.symbols().flatMap(({ path }) => (path?.length ? [path] : []));
  const sides = paths.map((path) => Math.max(...spans(path).slice(0, 2))).filter((side) => side > 0);
  return sides.sort((a, b) => a - b)[sides.length >> 1] ?? null;
}

/** Height of the canvas in the units of the library: a power of ten, so that it stays as the library grows. */
export function canvasHeight() {
  const middle = usualSide();
  return middle === null ? 1 : 10 ** Math.round(Math.log10(middle / USUAL));
}
