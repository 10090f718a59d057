// Distances and extents of points, each a row of coordinates.

export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

export const distance = (a, b) => Math.hypot(...a.map((value, k) => value - b[k]));

/** The least and the largest of each coordinate. @param {number[][]} points */
export const bounds = (points) =>
  [Math.min, Math.max].map((most) => points[0].map((_, k) => most(...points.map((point) => point[k]))));

/** How far points reach in each coordinate. @param {number[][]} points */
export function spans(points) {
  const [low, high] = bounds(points);
  return high.map((value, k) => value - low[k]);
}
