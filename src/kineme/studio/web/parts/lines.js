// Lines and marks on a canvas.

const CELLS = 6; // of the ground

/** Black or white, whichever reads better on a color. @param {string} hex As #rrggbb. */
export function readableOn(hex) {
  const [r, g, b] = [1, 3, 5].map((at) => (parseInt(hex.slice(at, at + 2), 16) / 255) ** 2.2);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.18 ? "#000" : "#fff";
}

/**
 * @param {CanvasRenderingContext2D} context @param {number[][]} points In pixels.
 * @param {{color: string, width?: number, dash?: number[], alpha?: number}} options
 */
export function line(context, points, { color, width = 3, dash = [], alpha = 1 }) {
  if (points.length < 2) return;
  context.save();
  Object.assign(context, {
    strokeStyle: color,
    lineWidth: width,
    lineCap: "round",
    lineJoin: "round",
    globalAlpha: alpha,
  });
  context.setLineDash(dash);
  context.beginPath();
  context.moveTo(points[0][0], points[0][1]);
  for (let i = 1; i < points.length; i += 1) context.lineTo(points[i][0], points[i][1]);
  context.stroke();
  context.restore();
}

/** @type {Record<string, (context: CanvasRenderingContext2D, r: number) => void>} */
const MARKS = {
  dot: (context, r) => context.arc(0, 0, r, 0, 2 * Math.PI),
  ring: (context, r) => context.arc(0, 0, r, 0, 2 * Math.PI),
  square: (context, r) => context.rect(-r, -r, 2 * r, 2 * r),
  diamond: (context, r) =>
    corners(context, [
      [0, -1.3 * r],
      [1.3 * r, 0],
      [0, 1.3 * r],
      [-1.3 * r, 0],
    ]),
  triangle: (context, r) =>
    corners(context, [
      [0, -1.3 * r],
      [1.2 * r, r],
      [-1.2 * r, r],
    ]),
};

function corners(/** @type {CanvasRenderingContext2D} */ context, /** @type {number[][]} */ points) {
  context.moveTo(points[0][0], points[0][1]);
  for (const [x, y] of points.slice(1)) context.lineTo(x, y);
  context.closePath();
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number[]} at
 * @param {string} kind
 * @param {number} r
 * @param {string} color
 */
export function mark(context, [x, y], kind, r, color) {
  context.save();
  context.translate(x, y);
  context.beginPath();
  MARKS[kind](context, r);
  if (kind === "ring") Object.assign(context, { strokeStyle: color, lineWidth: 2 }).stroke();
  else Object.assign(context, { fillStyle: color }).fill();
  context.restore();
}

/**
 * A grid below a movement in space, so that one sees how it lies.
 * @param {CanvasRenderingContext2D} context
 * @param {import("./camera.js").Camera} camera
 * @param {number[]} low Corner.
 * @param {number[]} high
 * @param {string} color
 */
export function ground(context, camera, low, high, color) {
  for (let k = 0; k <= CELLS; k += 1) {
    const [x, y] = [0, 1].map((axis) => low[axis] + ((high[axis] - low[axis]) * k) / CELLS);
    for (const ends of [
      [
        [x, low[1]],
        [x, high[1]],
      ],
      [
        [low[0], y],
        [high[0], y],
      ],
    ])
      line(
        context,
        ends.map(([a, b]) => camera.toScreen([a, b, low[2]])),
        { color, width: 1 },
      );
  }
}
