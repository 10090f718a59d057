// The drawing area: where a movement is on the screen, and how it is painted.

const RADIUS = 9; // of start and goal [CSS pixels]
const FILLED = 0.4; // of the shorter side, by half of a typical movement

/**
 * Rotation matrix of a view: a first one, turned about what is up on the screen, then tilted.
 * @param {number[]} first
 * @param {number[]} angles [degrees]
 */
function viewOf(first, angles) {
  if (first.length === 4) return first;
  const [a, b] = angles.map((angle) => (angle * Math.PI) / 180);
  const [right, up, near] = [0, 1, 2].map((k) => first.slice(3 * k, 3 * k + 3));
  const mix = (u, x, v, y) => u.map((value, k) => x * value + y * v[k]);
  const behind = mix(near, Math.cos(a), right, -Math.sin(a));
  return [
    ...mix(right, Math.cos(a), near, Math.sin(a)),
    ...mix(up, Math.cos(b), behind, -Math.sin(b)),
    ...mix(up, Math.sin(b), behind, Math.cos(b)),
  ];
}

/**
 * @param {HTMLCanvasElement} canvas
 * @param {number[]} view rotation matrix, row by row: what is right, up and near on the screen
 * @param {{center: number[], half: number}} box what is in view, in the unit of the movements
 */
export function createStage(canvas, view, box) {
  const d = box.center.length;
  const context = canvas.getContext("2d");
  let [width, height, R] = [1, 1, viewOf(view, [0, 0])];
  let style = getComputedStyle(canvas);
  const scale = () => (FILLED * Math.min(width, height)) / box.half;
  const rotated = (x) =>
    Array.from({ length: d }, (_, k) => x.reduce((sum, value, h) => sum + R[k * d + h] * (value - box.center[h]), 0));

  function project(x) {
    const v = rotated(x);
    return [width / 2 + v[0] * scale(), height / 2 - v[1] * scale()];
  }

  /** The place under a point of the screen, as deep in the view as another place. */
  function unproject(px, py, like = box.center) {
    const v = [(px - width / 2) / scale(), (height / 2 - py) / scale(), ...rotated(like).slice(2)];
    return box.center.map((c, h) => c + v.reduce((sum, value, k) => sum + R[k * d + h] * value, 0));
  }

  /** A line through places; from a share of it on it is faded. */
  function line(points, color, { wide = 3, dashed = false } = {}) {
    if (points.length < 2) return;
    context.beginPath();
    for (const x of points) {
      const [px, py] = project(x);
      context.lineTo(px, py);
    }
    context.strokeStyle = style.getPropertyValue(color);
    context.lineWidth = wide;
    context.lineJoin = context.lineCap = "round";
    context.setLineDash(dashed ? [2, 8] : []);
    context.stroke();
    context.setLineDash([]);
  }

  function dot(x, color, { radius = RADIUS, hollow = false, edge = 3 } = {}) {
    context.beginPath();
    const [px, py] = project(x);
    context.arc(px, py, radius, 0, 2 * Math.PI);
    context.fillStyle = style.getPropertyValue(hollow ? "--surface" : color);
    context.fill();
    context.lineWidth = edge;
    context.strokeStyle = style.getPropertyValue(hollow ? color : "--surface");
    context.stroke();
  }

  /** A word beside a place: on the side where a path does not go on. */
  function word(text, x, color, path = []) {
    const [px, py] = project(x);
    const near = path.map(project).filter(([u, v]) => Math.abs(v - py) < 14 && Math.abs(u - px) < 60);
    const right = near.filter(([u]) => u > px).length;
    const left = px > width - 80 || (px > 80 && right > near.length - right);
    context.font = `600 ${style.fontSize} ${style.fontFamily}`;
    context.textAlign = left ? "right" : "left";
    context.lineWidth = 4;
    context.strokeStyle = style.getPropertyValue("--surface");
    context.fillStyle = style.getPropertyValue(color);
    const at = px + (left ? -1 : 1) * (RADIUS + 7);
    context.strokeText(text, at, py + 5);
    context.fillText(text, at, py + 5);
  }

  function cleared() {
    style = getComputedStyle(canvas);
    const ratio = window.devicePixelRatio || 1;
    [width, height] = [canvas.clientWidth || 1, canvas.clientHeight || 1];
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
  }

  /** Turn and tilt the view. @param {number[]} angles [degrees] */
  function turned(angles) {
    R = viewOf(view, angles);
  }
  return { project, unproject, line, dot, word, cleared, turned };
}

/** A place in the middle of what points cover, and half of how far they reach. */
export function boxOf(points) {
  const [low, high] = [Math.min, Math.max].map((most) =>
    points[0].map((_, k) => points.reduce((extreme, x) => most(extreme, x[k]), points[0][k])),
  );
  const center = low.map((value, k) => (value + high[k]) / 2);
  return { center, half: Math.max(...high.map((value, k) => value - center[k])) || 1 };
}
