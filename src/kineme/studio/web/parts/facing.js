// From where movements in space are seen at first: obliquely, or where they are flat, as writing is, from the front.

export const OBLIQUE = { around: -0.6, above: 0.5 };
const FLATTER = 1.5; // how much larger their area must be from the front than obliquely
const STEPS = [0, 6, -6, 3, -3, 1, -1, 2, -2, 4, -4, 5, -5]; // of 15 degrees, those that are preferred first
const BETTER = 1.1; // how much larger the area must be from a view that is less preferred
// Share of the area that counts for nothing where letters, seen from above, would stand on their side.
const ASKEW = 0.4;
const STEP = Math.PI / 12;

/** Directions on the screen: right and up. */
export function axesOf({ around, above }) {
  const [c, s] = [Math.cos(around), Math.sin(around)];
  return { right: [c, s, 0], up: [-s * Math.sin(above), c * Math.sin(above), Math.cos(above)] };
}

/** How coordinates of paths vary together, each path about its middle. */
function variances(paths) {
  const sums = [0, 1, 2].map(() => [0, 0, 0]);
  for (const path of paths) {
    const middle = [0, 1, 2].map((k) => path.reduce((sum, point) => sum + point[k], 0) / path.length);
    for (const point of path)
      for (const j of [0, 1, 2])
        for (const k of [0, 1, 2]) sums[j][k] += (point[j] - middle[j]) * (point[k] - middle[k]);
  }
  return sums;
}

/** The view from where paths in space are seen best. */
export function facing(paths) {
  const varied = variances(paths);
  const along = (a, b) =>
    a.reduce((sum, value, j) => sum + value * b.reduce((more, other, k) => more + varied[j][k] * other, 0), 0);
  const area = (view) => {
    const { right, up } = axesOf(view);
    const askew = Math.sin(view.above) * Math.abs(Math.sin(view.around));
    return (1 - ASKEW * askew) * (along(right, right) * along(up, up) - along(right, up) ** 2);
  };
  let [best, largest] = [OBLIQUE, FLATTER * area(OBLIQUE)];
  for (const above of STEPS.filter((step) => step >= 0)) {
    for (const around of STEPS) {
      const view = { around: STEP * around, above: STEP * above };
      if (area(view) > BETTER * largest) [best, largest] = [view, area(view)];
    }
  }
  return best;
}
