// Distances and extents of points, each a row of coordinates.

export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

export const distance = (a, b) => Math.hypot(...a.map((value, k) => value - b[k]));

/** The least and the largest of each coordinate. */
export const bounds = (points) =>
  [Math.min, Math.max].map((most) =>
    points.reduce((extreme, point) => extreme.map((value, k) => most(value, point[k]))),
  );

/** How far points reach in each coordinate. */
export function spans(points) {
  const [low, high] = bounds(points);
  return high.map((value, k) => value - low[k]);
}
