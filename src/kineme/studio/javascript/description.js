// What movements are compared by: rows of numbers, segments and points; in single precision, as stored ones are.

import { arcLengthPhase, evenPath } from "./preparation.js";
import { withoutGlitches } from "./glitches.js";
import { withoutPauses } from "./pauses.js";
import { interpolate, linspace, product } from "./arrays.js";

const FLAT = 1e-6; // share of the whole extent; flatter dimensions are not scaled up
const NO_LENGTH = 1e-6; // of a movement of size 1: a shorter vector has no direction
export const N_POINTS = 199; // even samples from which the phases are computed

/** A path at even values of a phase: d rows of n_points numbers, by a matrix where time does not fall on samples. */
function along(path, d, representation, matrix) {
  const n = path.length / d;
  const m = representation.n_points;
  const rows = new Float64Array(d * m);
  const every = (n - 1) / (m - 1);
  const overTime = representation.arc_share === 0 || (representation.signal && d === 1);
  const phase = overTime ? null : arcLengthPhase(path, d, representation.arc_share);
  for (let k = 0; k < d; k++) {
    const own = path.subarray(k * n, (k + 1) * n);
    if (phase) rows.set(interpolate(linspace(0, 1, m), phase, own), k * m);
    else if (Number.isInteger(every)) for (let p = 0; p < m; p++) rows[k * m + p] = own[p * every];
    else for (let p = 0; p < m; p++) for (let t = 0; t < n; t++) rows[k * m + p] += matrix[p * n + t] * own[t];
  }
  return rows;
}

/** A path minus its center, divided by its size, as far as the normalization says. */
function normalized(path, d, { translation, scale }) {
  const n = path.length / d;
  const squares = new Float64Array(d);
  const rows = Float64Array.from(path);
  for (let k = 0; k < d; k++) {
    let center = 0;
    for (let t = 0; t < n; t++) center += path[k * n + t] / n;
    for (let t = 0; t < n; t++) squares[k] += (path[k * n + t] - center) ** 2 / n;
    if (translation) for (let t = 0; t < n; t++) rows[k * n + t] -= center;
  }
  if (scale === "none") return rows;
  const extent = Math.sqrt(squares.reduce((sum, square) => sum + square, 0)) || 1;
  for (let k = 0; k < d; k++) {
    const own = Math.sqrt(squares[k]);
    const size = scale === "per-dimension" && own > FLAT * extent ? own : extent;
    for (let t = 0; t < n; t++) rows[k * n + t] /= size;
  }
  return rows;
}

/** Rows times a matrix (n, n): the forcing term of a DMP fitted to a path of n points. */
function forcing(path, d, operator, translation) {
  const n = path.length / d;
  const rows = new Float64Array(d * n);
  for (let k = 0; k < d; k++) {
    let mean = 0;
    for (let t = 0; t < n; t++) {
      const x = path[k * n + t];
      mean += x / n;
      for (let p = 0; p < n; p++) rows[k * n + p] += x * operator[t * n + p];
    }
    if (!translation) for (let p = 0; p < n; p++) rows[k * n + p] += mean;
  }
  return rows;
}

/**
 * Feature rows of a smooth path, one of each representation that is compared sample by sample; the path is relative, or
 * as recorded where position matters.
 */
export function featureRows(path, how, arrays) {
  const d = how.n_dims;
  return how.by_rows.map((representation) => {
    const matrix = representation.resample === undefined ? undefined : arrays[representation.resample];
    const single = Float32Array.from(normalized(along(path, d, representation, matrix), d, how));
    if (representation.quantity !== "forcing") return single;
    return Float32Array.from(forcing(single, d, arrays[representation.operator], how.translation));
  });
}

/**
 * Write a row of J points (J, d, n) with the x of all points first: one movement of J n samples, which turns as one.
 * It is written from `at` on.
 */
export function setRow(into, at, row, { n_dims: d, n_points: J }) {
  const n = row.length / (d * J);
  for (let p = 0; p < d * J; p++)
    into.set(row.subarray(p * n, (p + 1) * n), at + ((p % d) * J + Math.floor(p / d)) * n);
}

/** The principal points of a path (J, d, n) at size 1, (q, d, n); of few points all, as they are. */
function mixed(path, { n_dims, n_points, mixing }) {
  if (!mixing) return path;
  const size = path.length / mixing[0].length;
  const mixture = new Float64Array(mixing.length * size);
  mixing.forEach((weights, p) => {
    weights.forEach((weight, j) => {
      for (let t = 0; t < size; t++) mixture[p * size + t] += weight * path[j * size + t];
    });
  });
  const square = product(mixture, 0, mixture, 0, mixture.length);
  const extent = Math.sqrt((square * n_dims * n_points) / path.length) || 1;
  return mixture.map((x) => x / extent);
}

/**
 * Segments and points of a path of positions over arc length, centered, at size 1; written as number i of the shapes.
 * Of a signal over time tangents are slopes, and nothing turns.
 */
export function fillShapes(recorded, rule, into, i, signal) {
  const { n_segments: K, n_points: P, d } = into;
  const w = 2 * d + 1;
  const path = mixed(recorded, rule);
  const ends = evenly(path, d, K + 1);
  const points = evenly(path, d, P);
  const tangents = units(K, d, (p, k) => ends[(p + 1) * d + k] - ends[p * d + k]);
  const steps = units(P - 1, d, (p, k) => points[(p + 1) * d + k] - points[p * d + k]);
  const slopes = units(P, d, (p, k) => {
    const [a, b] = [Math.max(p - 1, 0), Math.min(p + 1, P - 1)];
    return (points[b * d + k] - points[a * d + k]) / (b - a);
  });
  for (let p = 0, at = i * K * w; p < K; p++, at += w) {
    for (let k = 0; k < d; k++) {
      into.segments[at + k] = tangents[p * d + k];
      into.segments[at + d + k] = 0.5 * (ends[(p + 1) * d + k] + ends[p * d + k]);
    }
    const inner = !signal && p > 0 && p < K - 1 && directed(tangents, p, d);
    into.segments[at + 2 * d] = inner ? angle(tangents, p - 1, p + 1, d) : 0;
  }
  if (signal) fillSlopes(ends, into, i);
  for (let p = 0, at = i * P * w; p < P; p++, at += w) {
    for (let k = 0; k < d; k++) {
      into.points[at + k] = points[p * d + k];
      into.points[at + d + 1 + k] = slopes[p * d + k];
    }
    into.points[at + d] = p > 0 && p < P - 1 ? angle(steps, p - 1, p, d) : 0;
  }
}

/** Differences from end to end of the segments of a signal, with a root mean square of 1, as its tangents. */
function fillSlopes(ends, { segments, n_segments: K }, i) {
  let squares = 0;
  for (let p = 0; p < K; p++) squares += (ends[p + 1] - ends[p]) ** 2 / K;
  for (let p = 0; p < K; p++) segments[(i * K + p) * 3] = (ends[p + 1] - ends[p]) / (Math.sqrt(squares) || 1);
}

/** Whether movements are compared as signals over time. */
const isSignal = (how) => how.n_dims === 1 && how.by_rows[how.rotating]?.signal === true;

/** Room for the shapes of m movements. @returns {Shapes} */
export function roomForShapes(m, { n_dims, n_points: J, mixing }, { n_segments, n_points }) {
  const d = mixing ? mixing.length * (((n_dims * J) / mixing[0].length) | 0) : n_dims * J;
  const w = 2 * d + 1;
  const [segments, points] = [new Float32Array(m * n_segments * w), new Float32Array(m * n_points * w)];
  return { segments, points, n_segments, n_points, d };
}

/** Room for m movements. @returns {Stored} */
export function roomFor(m, how) {
  return {
    m,
    rows: how.by_rows.map((representation) => new Float32Array(m * how.n_dims * representation.n_points)),
    squares: how.by_rows.map(() => new Float64Array(m)),
    shapes: how.shapes && roomForShapes(m, how.rule, how.shapes),
    details: how.details && roomForShapes(m, how.rule, how.details),
  };
}

/** Write movement number i of its feature rows, and of positions in detail if there are shapes of these. */
export function describeRows(into, i, rows, details, how) {
  rows.forEach((row, r) => {
    setRow(into.rows[r], i * row.length, row, how.rule);
    into.squares[r][i] = product(row, 0, row, 0, row.length);
  });
  if (into.shapes) fillShapes(rows[how.rotating], how.rule, into.shapes, i, isSignal(how));
  if (into.details) fillShapes(details, how.rule, into.details, i, isSignal(how));
}

/** Positions at n even values along a path, each d numbers, interpolated linearly. */
function evenly(path, d, n) {
  const T = path.length / d;
  const positions = new Float64Array(n * d);
  for (let p = 0; p < n; p++) {
    const at = (p * (T - 1)) / (n - 1);
    const before = Math.min(Math.floor(at), T - 2);
    const share = at - before;
    for (let k = 0; k < d; k++) {
      positions[p * d + k] = path[k * T + before] * (1 - share) + path[k * T + before + 1] * share;
    }
  }
  return positions;
}

/** n vectors divided by their lengths; zero where they have none. */
function units(n, d, vector) {
  const directions = new Float64Array(n * d);
  for (let p = 0; p < n; p++) {
    let square = 0;
    for (let k = 0; k < d; k++) {
      directions[p * d + k] = vector(p, k);
      square += directions[p * d + k] ** 2;
    }
    const length = Math.sqrt(square);
    for (let k = 0; k < d; k++) directions[p * d + k] = length > NO_LENGTH ? directions[p * d + k] / length : 0;
  }
  return directions;
}

function directed(vectors, p, d) {
  for (let k = 0; k < d; k++) if (vectors[p * d + k] !== 0) return true;
  return false;
}

/** Angle between two unit vectors, divided by pi; 0 where one of them is zero. */
function angle(vectors, p, q, d) {
  if (!directed(vectors, p, d) || !directed(vectors, q, d)) return 0;
  let cosine = 0;
  for (let k = 0; k < d; k++) cosine += vectors[p * d + k] * vectors[q * d + k];
  return Math.acos(Math.min(Math.max(cosine, -1), 1)) / Math.PI;
}

/** A movement as it is compared: its smooth path, rows with their squared norms, and shapes. */
export function describeMovement(movement, how, arrays) {
  const clean = withoutGlitches(movement, how.pauses.glitches);
  const unpaused = withoutPauses(clean, how.pauses);
  const smooth = (cutoff, rule) => evenPath(rule ? withoutPauses(clean, rule) : unpaused, cutoff, N_POINTS);
  return describePath(smoothly(how, smooth), movement.positions, how, arrays);
}

/** A path smoothed as the comparison says: what is compared in detail, if anything, less, by its own rule of pauses. */
export function smoothly(how, smooth) {
  return { path: smooth(how.cutoff), details: how.details && smooth(how.details.cutoff, how.details.pauses) };
}

/** The same of a path, smoothed both ways, relative to a first position. */
export function describePath({ path, details: detailed }, start, how, arrays) {
  const d = how.n_dims;
  const place = (own) => (how.translation ? own : own.map((x, j) => x + start[Math.floor(j / N_POINTS)]));
  const described = roomFor(1, how);
  const row = detailed && normalized(along(place(detailed), d, how.details.positions), d, how);
  describeRows(described, 0, featureRows(place(path), how, arrays), row && Float32Array.from(row), how);
  return described;
}
