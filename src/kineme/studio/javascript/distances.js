// Squared distances of a movement to stored ones, in every representation.

import { ninefold } from "./arrays.js";
import { align, rotates } from "./rotation.js";

const FAR = 1e300;
const NO_TURN = Float64Array.of(1);

/**
 * Elastic, turning and point-cloud distances of one movement to others; see kineme.kernels.pair_distances and
 * point_cloud. Some of the measures may be wanted: 0 and 1, elastic and turning, are computed together.
 * @param {PairRule} how @param {Shapes} own @returns {WritePairDistances}
 */
export function pairDistances(how, own, measures = [0, 1, 2]) {
  const { n_segments: K, n_points: P, band } = how;
  const { d } = own;
  const w = 2 * d + 1;
  const factors = [1, Math.sqrt(how.position_weight), Math.sqrt(how.turning_weight)];
  const place = [1, Math.sqrt(how.cloud_turning_weight), how.line_weight ** 0.25];
  const [segments, points] = [roomForPairs(K, w), roomForPairs(P, w)];
  turned(own.segments, 0, K, d, d, null, factors, segments.a, segments.own);
  turned(own.points, 0, P, d, d + 1, null, place, points.a, points.own);
  const work = { elastic: new Float64Array(K + 1), turning: new Float64Array(K + 1) };
  const [rows, columns, nearest, lines] = [P, P, P, points.N ** 2].map((size) => new Float64Array(size));
  const room = { rows, columns, nearest, lines };
  return (others, j, R, squares) => {
    if (measures.some((k) => k < 2)) {
      turned(others.segments, j * K * w, K, d, d, R, factors, segments.b, segments.other);
      innerProducts(segments, w, 0, w, band, segments.products);
      warp(segments, K, w, band, work, squares);
    }
    if (measures.includes(2)) {
      turned(others.points, j * P * w, P, d, d + 1, R, place, points.b, points.other);
      innerProducts(points, w, 0, d + 1, P, points.products);
      innerProducts(points, w, d + 1, w, P, room.lines);
      squares[2] = matched(points, P, room);
    }
  };
}

/** Room for n records of w numbers of each movement of a pair, to which records of zeros are added: three at a time. */
function roomForPairs(n, w) {
  const N = n + ((3 - (n % 3)) % 3);
  const [products, own, other] = [N * N, n, n].map((size) => new Float64Array(size));
  return { a: new Float32Array(N * w), b: new Float32Array(N * w), products, N, own, other };
}

/** Inner products of the numbers `from` to `to` of all records of a pair that are at most `band` apart. */
function innerProducts({ a, b, N }, w, from, to, band, into) {
  for (let p = 0; p < N; p += 3) {
    const first = Math.max(0, p - band);
    const last = Math.min(N - 1, p + 2 + band);
    for (let q = first - (first % 3); q <= last; q += 3)
      ninefold(a, p * w + from, b, q * w + from, w, to - from, into, p * N + q, N);
  }
}

/**
 * n records of a vector, a second one and a number, each point rotated, multiplied by the roots of their weights.
 * Of segments the records are tangent, midpoint and angle; of points they are point, angle and tangent. Their squared
 * norms are written, too, of the tangents of points half of the fourth powers.
 */
function turned(source, from, n, d, second, R, factors, into, squares) {
  const w = 2 * d + 1;
  const scalar = second === d ? 2 * d : d;
  const weight = second === d ? factors[2] : factors[1];
  const other = second === d ? factors[1] : factors[2];
  const turns = R ?? NO_TURN;
  const r = Math.sqrt(turns.length) | 0; // as an index a whole number is fast
  for (let p = 0; p < n; p++) {
    const at = from + p * w;
    const to = p * w;
    let square = 0;
    let otherSquare = 0;
    for (let k = 0, row = 0, point = 0; k < d; k++) {
      let u = 0;
      let v = 0;
      for (let h = at + point; h < at + point + r; h++, row++) {
        u += turns[row] * source[h];
        v += turns[row] * source[second + h];
      }
      if (row === turns.length) {
        row = 0;
        point += r;
      }
      u = Math.fround(factors[0] * u);
      v = Math.fround(other * v);
      square += u * u;
      otherSquare += v * v;
      into[to + k] = u;
      into[to + second + k] = v;
    }
    const angle = Math.fround(weight * source[at + scalar]);
    into[to + scalar] = angle;
    squares[p] = square + angle * angle + (second === d ? otherSquare : 0.5 * otherSquare * otherSquare);
  }
}

/** The smaller number without a branch: processors cannot guess which one it is, and lose time by wrong guesses. */
const smaller = (x, y) => 0.5 * (x + y - Math.abs(x - y));

/** Dynamic time warping of segments: the sums of both costs along their best paths, divided by K. */
function warp({ a, b, products, N, own, other }, K, w, band, { elastic, turning }, squares) {
  for (let q = 0; q < Math.min(K, band + 1); q++) {
    const angle = a[w - 1] - b[(q + 1) * w - 1];
    elastic[q + 1] = own[0] + other[q] - 2 * products[q] + (q > 0 ? elastic[q] : 0);
    turning[q + 1] = angle * angle + (q > 0 ? turning[q] : 0);
  }
  for (let p = 1; p < K; p++) {
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
    for (let q = first; q < end; q++) {
      const angle = a[(p + 1) * w - 1] - b[(q + 1) * w - 1];
      const above = elastic[q + 1];
      const aboveTurning = turning[q + 1];
      left = own[p] + other[q] - 2 * products[p * N + q] + smaller(smaller(above, corner), left);
      leftTurning = angle * angle + smaller(smaller(aboveTurning, cornerTurning), leftTurning);
      elastic[q + 1] = left;
      turning[q + 1] = leftTurning;
      corner = above;
      cornerTurning = aboveTurning;
    }
  }
  squares[0] = Math.max(elastic[K], 0) / K;
  squares[1] = turning[K] / K;
}

/** Squared mean distance of matched points, in the direction in which it is smaller. */
function matched({ products, N, own, other }, P, { rows, columns, nearest, lines }) {
  columns.fill(FAR);
  let taken = 0; // bits of the points of the other that a point of the one is nearest to
  for (let p = 0; p < P; p++) {
    let smallest = FAR;
    let at = 0;
    for (let q = 0, pair = p * N; q < P; q++, pair++) {
      const cost = own[p] + other[q] - 2 * products[pair] - lines[pair] * lines[pair];
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

/** Squared distances of a described movement to m stored ones: R rows of m numbers. */
export function squaredDistances(how, described, stored) {
  const { rule, by_rows: blocks, by_pairs: measures } = how;
  const m = stored.m;
  const distances = new Float64Array((blocks.length + measures.length) * m);
  const coarse = measures.filter((k) => k < N_MEASURES);
  const detailed = measures.filter((k) => k >= N_MEASURES).map((k) => k - N_MEASURES);
  const compare = coarse.length ? pairDistances(how.shapes, described.shapes, coarse) : null;
  const compareDetails = detailed.length ? pairDistances(how.details, described.details, detailed) : null;
  const R = rotates(rule) ? new Float64Array(rule.n_dims ** 2) : null;
  const squares = new Float64Array(2 * N_MEASURES);
  for (let j = 0; j < m; j++) {
    for (let r = 0; r < blocks.length; r++) {
      const n = blocks[r].n_points * rule.n_points;
      const square = stored.squares[r][j];
      const norms = Math.sqrt(described.squares[r][0] * square);
      const turning = measures.length > 0 && r === how.rotating ? R : null;
      const best = align(rule, described.rows[r], 0, stored.rows[r], j * n * rule.n_dims, n, norms, turning);
      distances[r * m + j] = Math.max(described.squares[r][0] + square - 2 * best, 0);
    }
    R?.set(R.map(Math.fround));
    compare?.(stored.shapes, j, R, squares);
    compareDetails?.(stored.details, j, how.details.upright ? null : R, squares.subarray(N_MEASURES));
    for (let k = 0; k < measures.length; k++) distances[(blocks.length + k) * m + j] = squares[measures[k]];
  }
  return distances;
}
