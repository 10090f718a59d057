// The best rotation of one movement onto another: under a prior, or in the plane by at most an angle.

import { ninefold } from "./arrays.js";

const STEPS = 40; // of Newton's, at most
const CLOSE = 1e-12; // relative step after which there are no more
const ROUNDING = 1e-15; // of |M|^4: the quartic is no more exact
const TIE = 1e-5; // of the cube of the norm: smaller divisors have lost digits
const TIE_BREAK = [3e-3, 2e-3, 1e-3]; // of the norm, added to the diagonal where rotations are equally good
const STRAIGHT = 1e-4; // second singular value as a share of the first: a movement on a line
const STRAIGHT_TIE = 1e-3;
const LEAST_TIE = 1e-9;

/** Whether there is a rotation at all. @param {RotationRule} rule */
export const rotates = ({ n_dims: d, max_angle }) => max_angle > 0 && (d === 2 || d === 3);

/**
 * The largest inner product of row a with the rotated row b, less what the rotation costs, and that rotation R (d, d),
 * which is written if given. The rows, see `setRow`, have n numbers for each dimension, from i and j on;
 * norms are |a| |b|.
 * @param {RotationRule} rule
 */
export function align(rule, a, i, b, j, n, norms, R) {
  const d = rule.n_dims;
  if (!rotates(rule)) {
    let total = 0;
    for (let t = 0; t < d * n; t++) total += a[i + t] * b[j + t];
    if (R) for (let k = 0; k < d * d; k++) R[k] = k % (d + 1) === 0 ? 1 : 0;
    return total;
  }
  return d === 2 ? inPlane(rule, a, i, b, j, n, norms, R) : inSpace(rule, a, i, b, j, n, norms, R);
}

function inPlane(rule, a, i, b, j, n, norms, R) {
  let re = 0;
  let im = 0;
  for (let t = 0; t < n; t++) {
    const x = a[i + t];
    const y = a[i + n + t];
    re += x * b[j + t] + y * b[j + n + t];
    im += x * b[j + n + t] - y * b[j + t];
  }
  const weight = rule.prior ? (rule.prior[0] + rule.prior[3]) * norms : 0;
  const limit = rule.prior ? Math.PI : rule.max_angle;
  const angle = Math.min(Math.max(Math.atan2(-im, re + weight), -limit), limit);
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  if (R) {
    R[0] = R[3] = c;
    R[1] = -s;
    R[2] = s;
  }
  return c * (re + weight) - s * im - weight;
}

const C = new Float64Array(9);

function inSpace(rule, a, i, b, j, n, norms, R) {
  ninefold(a, i, b, j, n, n, C, 0, 3);
  for (let k = 0; k < 9; k++) C[k] += norms * rule.prior[k];
  return largestTrace(C, R) - (rule.prior[0] + rule.prior[4] + rule.prior[8]) * norms;
}

const M = new Float64Array(9);
const A = new Float64Array(9);

/** Largest tr(R' G) over rotations R, and that rotation: the largest root of a quartic (Theobald 2005). */
function largestTrace(G, R) {
  let size = 0;
  for (let k = 0; k < 9; k++) size += G[k] * G[k];
  size = Math.sqrt(size);
  for (let k = 0; k < 9; k++) M[k] = size > 0 ? G[k] / size : k % 4 === 0 ? 1 : 0;
  const top = solve(R);
  if (R && !(Math.abs(divisor) >= TIE)) {
    for (let k = 0; k < 3; k++) M[4 * k] += TIE_BREAK[k];
    solve(R);
  }
  return top * size;
}

let divisor = 0;

/** Cofactors, invariants and the largest root for M; writes the rotation. */
function solve(R) {
  let [square, last] = [0, 0];
  for (let k = 0; k < 3; k++) {
    const [p, q] = [(k + 1) % 3, (k + 2) % 3];
    for (let h = 0; h < 3; h++) {
      const [u, v] = [(h + 1) % 3, (h + 2) % 3];
      A[3 * k + h] = M[3 * p + u] * M[3 * q + v] - M[3 * p + v] * M[3 * q + u];
      square += M[3 * k + h] ** 2;
      last += 4 * A[3 * k + h] ** 2;
    }
  }
  const determinant = M[0] * A[0] + M[1] * A[1] + M[2] * A[2];
  let top = Math.sqrt(square + Math.sqrt(3 * last));
  for (let step = 0; step < STEPS; step++) {
    const over = top * top - square;
    const slope = 4 * top * over - 8 * determinant;
    const value = over * over - 8 * top * determinant - last;
    if (!(value > ROUNDING * square * square && slope > 0)) break;
    top -= value / slope;
    if (!(value / slope > CLOSE * top)) break;
  }
  if (R) rotate(R, top, square, determinant);
  return top;
}

/** R = ((k + |M|^2) M + l adj(M)' - M M' M) / (k l - det M). */
function rotate(R, top, square, determinant) {
  divisor = 0.5 * (top * top - square) * top - determinant;
  for (let row = 0; row < 3; row++) {
    for (let column = 0; column < 3; column++) {
      let cubic = 0;
      for (let h = 0; h < 3; h++) {
        const gram = M[3 * row] * M[3 * h] + M[3 * row + 1] * M[3 * h + 1] + M[3 * row + 2] * M[3 * h + 2];
        cubic += gram * M[3 * h + column];
      }
      const at = 3 * row + column;
      R[at] = (0.5 * (top * top + square) * M[at] + top * A[at] - cubic) / (divisor || 1);
    }
  }
}

/** The rotation (d, d) that brings b closest to a, whatever it costs; of several equally good ones the smallest. */
export function bestRotation(rule, a, b) {
  const d = rule.n_dims;
  const R = new Float64Array(d * d);
  const n = a.length / d;
  if (d !== 3 || !rotates(rule)) {
    align({ ...rule, prior: null }, a, 0, b, 0, n, 0, R);
    return R;
  }
  const G = new Float64Array(9);
  ninefold(a, 0, b, 0, n, n, G, 0, 3);
  const largest = G.reduce((most, value) => Math.max(most, Math.abs(value)), 0) || 1;
  for (let k = 0; k < 9; k++) M[k] = G[k] /= largest;
  solve(null); // for its cofactors: |adj G| is about the product of the two largest singular values
  const [square, adjoint] = [G, A].map((matrix) => matrix.reduce((sum, x) => sum + x * x, 0));
  const tie = adjoint <= (STRAIGHT * square) ** 2 ? STRAIGHT_TIE : LEAST_TIE;
  for (let k = 0; k < 9; k += 4) G[k] += tie / 4;
  largestTrace(G, R);
  return R;
}
