// Primitives move again: to another start and goal, through via points, in any formulation.

import { linspace, product } from "./arrays.js";
import { splinePath } from "./preparation.js";

const ZERO = 1e-9; // share of its largest extent within which a goal equals the start
const CLOSED = 0.05; // the same where the size of a movement follows the distance of its goal
const HANDOVER = 0.2; // phase at which shape and goal have equal weight in the decoupled formulation
const DEPENDENT = 1e-11; // of the largest: via points of which one follows from the others
// Gauss-Legendre quadrature on [0, 1] with 8 nodes, the second half mirrored.
const NODES = [0.019855071751231856, 0.10166676129318664, 0.2372337950418355, 0.4082826787521751];
const WEIGHTS = [0.05061426814518813, 0.11119051722668724, 0.15685332293894363, 0.181341891689181];
const QUADRATURE = [...NODES.map((x, k) => [x, WEIGHTS[k]]), ...NODES.map((x, k) => [1 - x, WEIGHTS[k]])];

const late = (s) => ((1 + HANDOVER ** 3) * s ** 3) / (s ** 3 + HANDOVER ** 3);

/** How the goal enters besides the spring, and what scale the forcing term has for a new goal. */
export const FORMULATIONS = {
  original: { coupling: () => 0, ratio: perDimension },
  "bio-inspired": { coupling: (K, s) => -K * s, ratio: (now) => now.map(() => 1) },
  "amplitude-scaled": { coupling: (K, s) => -K * s, ratio: isotropic },
  decoupled: { coupling: (K, s) => -K * late(s), ratio: (now) => now.map(() => 1) },
};

function perDimension(now, learned, extents) {
  const nothing = ZERO * Math.max(...extents);
  return now.map((amplitude, k) => {
    if (Math.abs(learned[k]) > nothing) return amplitude / learned[k];
    if (Math.abs(amplitude) <= nothing) return 1;
    throw new Error(`expected a movement with another goal than its start in dimension ${k}; take "bio-inspired"`);
  });
}

function isotropic(now, learned, extents) {
  const length = Math.hypot(...learned);
  const ratio = length <= CLOSED * Math.max(...extents) ? 1 : Math.hypot(...now) / length;
  return now.map(() => ratio);
}

/** Elements of exp(A h) with A = [[0, 1], [-K, -D]], row by row. */
function transition(K, D, h) {
  const a = 0.5 * D;
  const square = K - a * a;
  const b = Math.sqrt(Math.abs(square));
  let C = Math.exp(-a * h);
  let S = C * h;
  if (square > 0) [C, S] = [C * Math.cos(b * h), (C * Math.sin(b * h)) / b];
  else if (b > 0) {
    const slow = 0.5 * Math.exp((-K / (a + b)) * h);
    [C, S] = [slow * (1 + Math.exp(-2 * b * h)), (-slow * Math.expm1(-2 * b * h)) / b];
  }
  return [C + a * S, S, -K * S, C - a * S];
}

/** Values of the basis functions at time u, which add up to 1, or to the gate; then what a unit of g - x0 adds. */
function forcing(how, formulation, u) {
  const { n_basis: N, alpha, overlap, gating, K } = how;
  const s = Math.exp(-alpha * u);
  const center = (i) => Math.exp((-alpha * i) / (N - 1));
  const values = Float64Array.from({ length: N + 1 }, (_, i) => {
    const gap = center(Math.min(i, N - 2)) - center(Math.min(i, N - 2) + 1);
    return (Math.log(overlap) * (s - center(i)) ** 2) / gap ** 2;
  });
  const top = values.subarray(0, N).reduce((most, value) => Math.max(most, value), -Infinity);
  let sum = 0;
  for (let i = 0; i < N; i++) sum += values[i] = Math.exp(values[i] - top);
  const gate = gating === "phase" ? s : Math.min(1, s / Math.exp(-alpha));
  for (let i = 0; i < N; i++) values[i] *= gate / sum;
  values[N] = K + FORMULATIONS[formulation].coupling(K, s);
  return values;
}

/** The state after a step h from time u: x and x' as maps of (W, g - x0, v0), two rows of N + 2. */
function step(how, formulation, state, u, h) {
  const { n_basis: N, K, D } = how;
  const carry = transition(K, D, h);
  const next = new Float64Array(2 * (N + 2));
  for (let i = 0; i < N + 2; i++) {
    next[i] = carry[0] * state[i] + carry[1] * state[N + 2 + i];
    next[N + 2 + i] = carry[2] * state[i] + carry[3] * state[N + 2 + i];
  }
  for (const [node, weight] of QUADRATURE) {
    const values = forcing(how, formulation, u + node * h);
    const impulse = transition(K, D, h * (1 - node));
    for (let i = 0; i <= N; i++) {
      next[i] += h * weight * impulse[1] * values[i];
      next[N + 2 + i] += h * weight * impulse[3] * values[i];
    }
  }
  return next;
}

/** A state with a third row, x'' = K (g - x) - D x' + f + coupling (g - x0); `values` are those of `forcing` then. */
function withAcceleration({ n_basis: N, K, D }, state, values) {
  const M = N + 2;
  const extended = new Float64Array(3 * M);
  extended.set(state);
  for (let i = 0; i < M; i++) extended[2 * M + i] = (i <= N ? values[i] : 0) - K * state[i] - D * state[M + i];
  return extended;
}

/**
 * The decode matrix of a formulation at n even times: x - x0 as a map of (W, g - x0, v0), with v0 = dx/du.
 * States at each time are x, x' and x''.
 */
function decoder(how, formulation, n) {
  const { n_basis: N } = how;
  const steps = Math.max(1, Math.ceil((2 * (N - 1)) / (n - 1)));
  let state = new Float64Array(2 * (N + 2));
  state[2 * N + 3] = 1;
  const states = [state];
  const h = 1 / ((n - 1) * steps);
  for (let k = 0; k < (n - 1) * steps; k++) {
    state = step(how, formulation, state, k * h, h);
    if ((k + 1) % steps === 0) states.push(state);
  }
  return states.map((state, t) => withAcceleration(how, state, forcing(how, formulation, t / (n - 1))));
}

const decoders = new Map();

function cachedDecoder(how, formulation, n) {
  const key = JSON.stringify([how, formulation, n]);
  if (!decoders.has(key)) {
    if (decoders.size > 20) decoders.clear();
    decoders.set(key, decoder(how, formulation, n));
  }
  return decoders.get(key);
}

/** The primitive of class c, in the formulation of the library or in another one. @returns {Primitive} */
export function primitiveOf({ header, arrays }, c, formulation = header.movements.formulation) {
  if (c < 0) throw new Error(`expected one of ${header.classes.join(", ")}, got another name`);
  const how = header.movements;
  const d = how.n_dims;
  const part = (name, size) => arrays[name].subarray(c * size, (c + 1) * size);
  const row = (name) => [...part(`primitive ${name}`, d)];
  const [start, goal, velocity, extents] = ["starts", "goals", "velocities", "extents"].map(row);
  const weights = Float64Array.from(part("weights", d * how.n_basis));
  const duration = arrays["primitive durations"][c];
  const own = { weights, start, goal, velocity, duration, extents, formulation: how.formulation };
  return inFormulation({ header, arrays }, own, formulation);
}

/** The same path in another formulation: what its goal adds is another, and the weights make up for it. */
export function inFormulation({ header, arrays }, primitive, formulation) {
  if (formulation === primitive.formulation) return primitive;
  const how = header.movements;
  if (!how.encodes) throw new Error(`expected ${primitive.formulation}, in which these primitives were fitted`);
  const [old, now] = [primitive.formulation, formulation].map((name) => cachedDecoder(how, name, how.n_points));
  const apart = old.map((state, t) => state[how.n_basis] - now[t][how.n_basis]);
  const { weights: more, velocity: faster } = fitted(arrays, how, apart);
  const weights = Float64Array.from(primitive.weights, (weight, i) => {
    const k = Math.floor(i / how.n_basis);
    return weight + (primitive.goal[k] - primitive.start[k]) * more[i % how.n_basis];
  });
  const velocity = primitive.velocity.map(
    (v, k) => v + ((primitive.goal[k] - primitive.start[k]) * faster) / primitive.duration,
  );
  return { ...primitive, weights, velocity, formulation };
}

/** Weights and initial velocity that fit a path y of n_points, in which no goal pulls. */
function fitted(arrays, { n_basis: N, n_points: n }, y) {
  const weights = Float64Array.from({ length: N }, (_, i) => product(arrays.encoder, i * n, y, 0, n));
  return { weights, velocity: product(arrays["encoder velocity"], 0, y, 0, n) };
}

/** Learn a movement; see `kineme.DMP.learn`. @param {Snapshot} snapshot @param {TimedPositions} movement */
export function encode({ header, arrays }, movement) {
  const how = header.movements;
  if (!how.encodes) throw new Error("expected a library whose primitives are fitted to the path as it was recorded");
  const { d, times, positions } = movement;
  const n = how.n_points;
  const rows = splinePath(movement, n);
  const pull = cachedDecoder(how, how.formulation, n).map((state) => state[how.n_basis]);
  const at = (t) => Array.from({ length: d }, (_, k) => positions[t * d + k]);
  const [start, goal] = [at(0), at(times.length - 1)];
  const duration = times.at(-1) - times[0];
  const weights = new Float64Array(d * how.n_basis);
  const velocity = start.map((_, k) => {
    const free = pull.map((gain, t) => rows[k * n + t] - gain * rows[k * n + n - 1]);
    const own = fitted(arrays, how, free);
    weights.set(own.weights, k * how.n_basis);
    return own.velocity / duration;
  });
  const extents = start.map((first, k) => {
    let [low, high] = [first, first];
    for (let j = k; j < positions.length; j += d)
      [low, high] = [Math.min(low, positions[j]), Math.max(high, positions[j])];
    return high - low;
  });
  return { weights, start, goal, velocity, duration, extents, formulation: how.formulation };
}

/**
 * The movement to a new start and goal; see `kineme.dmp.Primitives.rollout`.
 * @param {Snapshot} snapshot @param {Primitive} primitive @param {Wish} wish
 */
export function rollout({ header, arrays }, primitive, wish = {}) {
  const how = header.movements;
  const N = how.n_basis;
  const {
    start = primitive.start,
    goal = primitive.goal,
    duration = primitive.duration,
    via = [],
    endVelocity,
    samples = how.n_points,
  } = wish;
  for (const point of [start, goal, ...via.map(([, point]) => point)]) {
    if (point?.length !== primitive.start.length || !point.every(Number.isFinite))
      throw new Error(`expected ${primitive.start.length} finite numbers for start, goal and via points, got ${point}`);
  }
  if (!(Number.isFinite(duration) && duration > 0)) throw new Error(`expected a duration above 0 s, got ${duration}`);
  const amplitude = goal.map((g, k) => g - start[k]);
  const learned = primitive.goal.map((g, k) => g - primitive.start[k]);
  const ratio = FORMULATIONS[primitive.formulation].ratio(amplitude, learned, primitive.extents);
  const numbers = start.map((_, k) => {
    const own = Array.from({ length: N }, (_, i) => primitive.weights[k * N + i] * ratio[k]);
    return Float64Array.from([...own, amplitude[k], primitive.velocity[k] * primitive.duration]);
  });
  const row = (state, order) =>
    numbers.map((own) => product(own, 0, state, order * (N + 2), N + 2) / duration ** order);
  const map = (state) => row(state, 0).map((x, k) => start[k] + x);
  if (via.length || endVelocity) {
    const faster = (end) =>
      endVelocity ? row(end, 1).map((v, k) => (endVelocity[k] - v) * duration) : goal.map(() => 0);
    passThrough(how, arrays.smooth, primitive.formulation, via, goal, numbers, map, faster);
  }
  const states = cachedDecoder(how, primitive.formulation, samples);
  const [velocities, accelerations] = [1, 2].map((order) => states.map((state) => row(state, order)));
  return { times: linspace(0, duration, samples), positions: states.map(map), velocities, accelerations };
}

/**
 * Change the weights as little as possible so that the movement passes the via points, and ends at its goal; by how
 * much faster it shall be there `faster` says.
 */
function passThrough(how, smooth, formulation, via, goal, numbers, map, faster) {
  const grid = cachedDecoder(how, formulation, Math.max(how.n_points, 2 * how.n_basis));
  const intervals = grid.length - 1;
  const states = [...via.map(([u]) => u), 1].map((u) => {
    if (!(u > 0 && u <= 1)) throw new Error(`expected via points at shares of the duration from 0 to 1, got ${u}`);
    const before = Math.min(Math.floor(u * intervals), intervals);
    const h = u - before / intervals;
    return h > 0 ? step(how, formulation, grid[before], before / intervals, h) : grid[before];
  });
  const targets = [...via.map(([, point]) => point), goal];
  const missing = states.map((state, j) => map(state).map((x, k) => targets[j][k] - x));
  missing.push(faster(states.at(-1)));
  const gain = gains(smooth, [...states, states.at(-1).subarray(how.n_basis + 2)], how.n_basis);
  for (const [k, own] of numbers.entries())
    for (const [j, row] of gain.entries()) for (const [i, value] of row.entries()) own[i] += missing[j][k] * value;
}

/** Rows by which what is missing changes the weights: F' Q R'^-1 with F A' = Q R, see kineme.dmp.discrete.operators. */
function gains(smooth, states, N) {
  const Q = states.map((state) => Float64Array.from({ length: N }, (_, i) => product(smooth, i * N, state, 0, N)));
  const rows = [];
  const R = Q.map(() => new Float64Array(Q.length));
  Q.forEach((column, j) => {
    const length = Math.sqrt(product(column, 0, column, 0, N));
    for (let pass = 0; pass < 2; pass++) {
      for (let i = 0; i < j; i++) {
        const share = product(Q[i], 0, column, 0, N);
        R[i][j] += share;
        for (let k = 0; k < N; k++) column[k] -= share * Q[i][k];
      }
    }
    R[j][j] = Math.sqrt(product(column, 0, column, 0, N));
    if (!(R[j][j] > DEPENDENT * length)) throw new Error("expected via points that can all be met; move them apart");
    for (let k = 0; k < N; k++) column[k] /= R[j][j];
  });
  for (let j = Q.length - 1; j >= 0; j--) {
    const own = Float64Array.from({ length: N }, (_, k) => {
      let sum = 0;
      for (let i = 0; i < N; i++) sum += Q[j][i] * smooth[i * N + k];
      for (let i = j + 1; i < Q.length; i++) sum -= R[j][i] * rows[i][k];
      return sum / R[j][j];
    });
    rows[j] = own;
  }
  return rows;
}
