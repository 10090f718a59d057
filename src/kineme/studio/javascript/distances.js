// Squared distances of a movement to stored ones, in every representation.

import { align } from "./rotation.js";

const FAR = 1e300;

/**
 * @typedef {Object} Stored m movements that others are compared with
 * @property {number} m
 * @property {Float32Array[]} rows of each block, one movement after the other
 * @property {Float64Array[]} squares their squared norms, (m,) of each block
 * @property {import("./description.js").Shapes|null} shapes
 * @property {import("./description.js").Shapes|null} details
 *
 * @typedef {Object} PairRule how segments and points are compared
 * @property {number} n_segments
 * @property {number} band
 * @property {number} n_points
 * @property {number} position_weight
 * @property {number} turning_weight of segments
 * @property {number} cloud_turning_weight of points
 * @property {number} line_weight
 *
 * @callback WritePairDistances writes three squares
 * @param {import("./description.js").Shapes} others
 * @param {number} j of one of them
 * @param {Float64Array} R the rotation that brings it onto the one movement
 * @param {Float64Array} squares
 * @returns {void}
 */

/**
 * Elastic, turning and point-cloud distances of one movement to others; see kineme.kernels.pair_distances and
 * point_cloud.
 * @param {PairRule} how
 * @param {number} d
 * @param {import("./description.js").Shapes} own of the one movement
 * @param {boolean} cloud whether the point cloud is wanted
 * @param {boolean} elastic whether the others are
 * @returns {WritePairDistances}
 */
export function pairDistances(how, d, own, cloud = true, elastic = true) {
  const { n_segments: K, n_points: P, band } = how;
  const w = 2 * d + 1;
  const line = how.line_weight ** 0.25;
  const factors = [1, Math.sqrt(how.position_weight), Math.sqrt(how.turning_weight)];
  const place = [1, Math.sqrt(how.cloud_turning_weight), line];
  const IDENTITY = Float64Array.from({ length: d * d }, (_, k) => (k % (d + 1) === 0 ? 1 : 0));
  const [a, b] = [new Float64Array(K * w), new Float64Array(K * w)];
  const [x, y] = [new Float64Array(P * w), new Float64Array(P * w)];
  turned(own.segments, 0, K, d, d, IDENTITY, factors, a);
  turned(own.points, 0, P, d, d + 1, IDENTITY, place, x);
  const work = { elastic: new Float64Array(K + 1), turning: new Float64Array(K + 1) };
  const room = {
    rows: new Float64Array(P),
    columns: new Float64Array(P),
    nearest: new Int32Array(P),
    halves: new Float64Array(2 * P),
    costs: new Float64Array(P * P),
  };
  return (others, j, R, squares) => {
    if (elastic) {
      turned(others.segments, j * K * w, K, d, d, R, factors, b);
      warp(a, b, K, w, band, work, squares);
    }
    if (cloud) {
      turned(others.points, j * P * w, P, d, d + 1, R, place, y);
      squares[2] = matched(x, y, P, d, room);
    }
  };
}

/**
 * n records of a vector, a second one and a number, rotated and multiplied by the roots of their weights.
 * Of segments the records are tangent, midpoint and angle; of points they are point, angle and tangent.
 */
function turned(source, from, n, d, second, R, factors, into) {
  const w = 2 * d + 1;
  const scalar = second === d ? 2 * d : d;
  const weight = second === d ? factors[2] : factors[1];
  const other = second === d ? factors[1] : factors[2];
  for (let p = 0; p < n; p++) {
    const at = from + p * w;
    const to = p * w;
    for (let k = 0; k < d; k++) {
      let u = 0;
      let v = 0;
      for (let h = 0; h < d; h++) {
        u += R[k * d + h] * source[at + h];
        v += R[k * d + h] * source[at + second + h];
      }
      into[to + k] = factors[0] * u;
      into[to + second + k] = other * v;
    }
    into[to + scalar] = weight * source[at + scalar];
  }
}

/** Squared distance of n numbers from i and from j on, two or more; few at a time are compared fastest so. */
function squaredGap(a, i, b, j, n) {
  const x = a[i] - b[j];
  const y = a[i + 1] - b[j + 1];
  let total = x * x + y * y;
  for (let k = 2; k < n; k++) {
    const z = a[i + k] - b[j + k];
    total += z * z;
  }
  return total;
}

/** The smaller number without a branch: processors cannot guess which one it is, and lose time by wrong guesses. */
const smaller = (x, y) => 0.5 * (x + y - Math.abs(x - y));

/** Dynamic time warping of segments: the sums of both costs along their best paths, divided by K. */
function warp(a, b, K, w, band, { elastic, turning }, squares) {
  for (let q = 0, from = 0; q < Math.min(K, band + 1); q++, from += w) {
    const angle = a[w - 1] - b[from + w - 1];
    elastic[q + 1] = squaredGap(a, 0, b, from, w) + (q > 0 ? elastic[q] : 0);
    turning[q + 1] = angle * angle + (q > 0 ? turning[q] : 0);
  }
  for (let p = 1, at = w; p < K; p++, at += w) {
    const first = Math.max(0, p - band);
    const end = Math.min(K, p + band + 1);
    if (p + band < K) {
      elastic[end] = elastic[end - 1]; // no path comes from above
      turning[end] = turning[end - 1];
    }
    const before = Math.max(first, 1); // the first of a row is never reached from the corner
    let corner = elastic[before];
    let cornerTurning = turning[before];
    let left = corner;
    let leftTurning = cornerTurning;
    for (let q = first, from = first * w; q < end; q++, from += w) {
      const angle = a[at + w - 1] - b[from + w - 1];
      const square = angle * angle;
      const above = elastic[q + 1];
      const aboveTurning = turning[q + 1];
      left = square + squaredGap(a, at, b, from, w - 1) + smaller(smaller(above, corner), left);
      leftTurning = square + smaller(smaller(aboveTurning, cornerTurning), leftTurning);
      elastic[q + 1] = left;
      turning[q + 1] = leftTurning;
      corner = above;
      cornerTurning = aboveTurning;
    }
  }
  squares[0] = elastic[K] / K;
  squares[1] = turning[K] / K;
}

/** Squared mean distance of matched points, in the direction in which it is smaller. */
function matched(x, y, P, d, room) {
  const { rows, columns, nearest, costs, halves } = room;
  halfFourthPowers(x, P, d, halves, 0);
  halfFourthPowers(y, P, d, halves, P);
  if (d === 2) planePointCosts(x, y, P, halves, costs);
  else pointCosts(x, y, P, d, halves, costs);
  columns.fill(FAR);
  let taken = 0; // bits of the points of y that a point of x is nearest to
  for (let p = 0, pair = 0; p < P; p++) {
    let smallest = FAR;
    let at = 0;
    for (let q = 0; q < P; q++, pair++) {
      const cost = costs[pair];
      if (cost < smallest) {
        smallest = cost;
        at = q;
      }
      if (cost < columns[q]) {
        columns[q] = cost;
        nearest[q] = p;
      }
    }
    taken |= 1 << at;
    rows[p] = Math.sqrt(Math.max(smallest, 0));
  }
  return sums(rows, columns, nearest, taken, P);
}

/** Halves of the fourth powers of the tangents' lengths: the weight of their lines is in these lengths twice. */
function halfFourthPowers(points, P, d, halves, from) {
  const w = 2 * d + 1;
  for (let p = 0; p < P; p++) {
    let square = 0;
    for (let k = p * w + d + 1; k < (p + 1) * w; k++) square += points[k] * points[k];
    halves[from + p] = 0.5 * square * square;
  }
}

/** Squared distances of all points of x to all of y: of points and angles, and of the tangents' lines. */
function pointCosts(x, y, P, d, halves, costs) {
  const w = 2 * d + 1;
  for (let p = 0, from = 0, pair = 0; p < P; p++, from += w) {
    for (let q = 0, to = 0; q < P; q++, to += w, pair++) {
      let both = x[from + d + 1] * y[to + d + 1];
      for (let k = d + 2; k < w; k++) both += x[from + k] * y[to + k];
      costs[pair] = halves[p] + halves[P + q] + squaredGap(x, from, y, to, d + 1) - both * both;
    }
  }
}

/** The same in the plane, without inner loops. */
function planePointCosts(x, y, P, halves, costs) {
  for (let p = 0, from = 0, pair = 0; p < P; p++, from += 5) {
    const [x0, x1, x2, x3, x4] = [x[from], x[from + 1], x[from + 2], x[from + 3], x[from + 4]];
    for (let q = 0, to = 0; q < P; q++, to += 5, pair++) {
      const u = x0 - y[to];
      const v = x1 - y[to + 1];
      const angle = x2 - y[to + 2];
      const both = x3 * y[to + 3] + x4 * y[to + 4];
      costs[pair] = halves[p] + halves[P + q] + (u * u + v * v + angle * angle) - both * both;
    }
  }
}

function sums(rows, columns, nearest, taken, P) {
  let forth = 0;
  let back = 0;
  let takenBack = 0;
  for (let q = 0; q < P; q++) {
    const distance = Math.sqrt(Math.max(columns[q], 0));
    back += distance;
    if (!(taken & (1 << q))) forth += distance;
    takenBack |= 1 << nearest[q];
  }
  for (let p = 0; p < P; p++) {
    forth += rows[p];
    if (!(takenBack & (1 << p))) back += rows[p];
  }
  return (Math.min(forth, back) / P) ** 2;
}

const N_MEASURES = 3; // elastic, turning, cloud; the same in detail have the next numbers

/**
 * Compares pairs by some of the measures: writes those squares of the one movement and a stored one.
 * @param {PairRule|null} rule
 * @param {number} d
 * @param {import("./description.js").Shapes} own
 * @param {number[]} measures
 */
function comparing(rule, d, own, measures) {
  if (!measures.length) return null;
  return pairDistances(
    rule,
    d,
    own,
    measures.includes(2),
    measures.some((k) => k < 2),
  );
}

/**
 * Squared distances of a described movement to m stored ones: R rows of m numbers.
 * @param {Object} how the header's comparison
 * @param {{rows: Float32Array[], squares: number[], shapes: Object, details: Object}} described
 * @param {Stored} stored
 * @returns {Float64Array}
 */
export function squaredDistances(how, described, stored) {
  const { rule, by_rows: blocks, by_pairs: measures, n_dims: d } = how;
  const m = stored.m;
  const distances = new Float64Array((blocks.length + measures.length) * m);
  const coarse = measures.filter((k) => k < N_MEASURES);
  const detailed = measures.filter((k) => k >= N_MEASURES).map((k) => k - N_MEASURES);
  const compare = comparing(how.shapes, d, described.shapes, coarse);
  const compareDetails = comparing(how.details, d, described.details, detailed);
  const identity = Float64Array.from({ length: d * d }, (_, k) => (k % (d + 1) === 0 ? 1 : 0));
  const R = new Float64Array(d * d);
  const squares = new Float64Array(2 * N_MEASURES);
  for (let j = 0; j < m; j++) {
    for (let r = 0; r < blocks.length; r++) {
      const n = blocks[r].n_points;
      const square = stored.squares[r][j];
      const turns = measures.length > 0 && r === how.rotating;
      const best = align(
        rule,
        described.rows[r],
        0,
        stored.rows[r],
        j * n * d,
        n,
        Math.sqrt(described.squares[r] * square),
        turns ? R : null,
      );
      distances[r * m + j] = Math.max(described.squares[r] + square - 2 * best, 0);
    }
    for (let k = 0; k < d * d; k++) R[k] = Math.fround(R[k]);
    compare?.(stored.shapes, j, R, squares);
    compareDetails?.(stored.details, j, how.details.upright ? identity : R, squares.subarray(N_MEASURES));
    for (let k = 0; k < measures.length; k++) distances[(blocks.length + k) * m + j] = squares[measures[k]];
  }
  return distances;
}
