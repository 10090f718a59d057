// Lines, marks and words on a canvas.

const CELLS = 6; // of the ground

/** Black or white, whichever reads better on a color. @param {string} hex As #rrggbb. */
export function readableOn(hex) {
  const [r, g, b] = [1, 3, 5].map((at) => (parseInt(hex.slice(at, at + 2), 16) / 255) ** 2.2);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b > 0.18 ? "#000" : "#fff";
}

/**
 * @param {CanvasRenderingContext2D} context
 * @param {number[][]} points In pixels.
 * @param {{color: string, width?: number, dash?: number[], alpha?: number}} look
 */
export function line(context, points, { color, width = 3, dash = [], alpha = 1 }) {
  if (points.length < 2) return;
  context.save();
  Object.assign(context, { strokeStyle: color, lineWidth: width, globalAlpha: alpha });
  Object.assign(context, { lineCap: "round", lineJoin: "round" });
  context.setLineDash(dash);
  context.beginPath();
  for (const [x, y] of points) context.lineTo(x, y);
  context.stroke();
  context.restore();
}

/** Words that stand out from what they are on. */
export function words(context, text, x, y, color, surface) {
  Object.assign(context, { lineWidth: 4, lineJoin: "round", strokeStyle: surface, fillStyle: color });
  context.strokeText(text, x, y);
  context.fillText(text, x, y);
}

/** x and y of the corners of a mark, in radii; a mark without corners is round. */
const CORNERS = {
  square: [-1, -1, 1, -1, 1, 1, -1, 1],
  diamond: [0, -1.3, 1.3, 0, 0, 1.3, -1.3, 0],
  triangle: [0, -1.3, 1.2, 1, -1.2, 1],
};

/** @param {CanvasRenderingContext2D} context @param {number[]} at */
export function mark(context, [x, y], kind, r, color) {
  const corners = CORNERS[kind] ?? [];
  context.save();
  context.translate(x, y);
  context.beginPath();
  if (!corners.length) context.arc(0, 0, r, 0, 2 * Math.PI);
  for (let k = 0; k < corners.length; k += 2) context.lineTo(r * corners[k], r * corners[k + 1]);
  context.closePath();
  if (kind === "ring") Object.assign(context, { strokeStyle: color, lineWidth: 2 }).stroke();
  else Object.assign(context, { fillStyle: color }).fill();
  context.restore();
}

/**
 * A grid below a movement in space, so that one sees how it lies.
 * @param {CanvasRenderingContext2D} context
 * @param {Camera} camera
 * @param {number[][]} corners The lowest and the highest.
 */
export function ground(context, camera, [low, high], color) {
  const edge = (...ends) =>
    line(
      context,
      ends.map(([x, y]) => camera.toScreen([x, y, low[2]])),
      { color, width: 1 },
    );
  for (let k = 0; k <= CELLS; k += 1) {
    const [x, y] = [0, 1].map((axis) => low[axis] + ((high[axis] - low[axis]) * k) / CELLS);
    edge([x, low[1]], [x, high[1]]);
    edge([low[0], y], [high[0], y]);
  }
}
