// The beginnings of stored movements, which a movement under way may be; the one under way is described as they are.

import { finiteLog, interpolate, linspace, product } from "./arrays.js";
import { fillShapes, N_POINTS, roomForShapes, setRow } from "./description.js";
import { arcLengthPhase } from "./preparation.js";

/**
 * The beginnings of paths (n, d, N_POINTS) until each share of their arc length, of signals of their time;
 * `numbers.last` is the share of a beginning's time in which the speed at its end is measured.
 * @returns {Prefixes}
 */
export function beginnings(paths, d, progress, { shapes: how, rule, numbers, signals }) {
  const [S, G, n] = [how.n_segments + 1, progress.length, paths.length / (d * N_POINTS)];
  const room = (size) => new Float64Array(n * G * size);
  const [squares, sizes, lengths, elapsed, endSpeeds] = [1, 1, 1, 1, 1].map(room);
  const [rows, timing, shapes] = [new Float32Array(n * G * d * S), room(S), roomForShapes(n * G, rule, how)];
  const prefixes = { rows, timing, shapes, squares, sizes, lengths, elapsed, endSpeeds };
  const even = linspace(0, 1, N_POINTS);
  for (let i = 0; i < n; i++) {
    const path = paths.subarray(i * d * N_POINTS, (i + 1) * d * N_POINTS);
    const lengths = arcLengthPhase(path, d);
    const phase = signals ? even : lengths;
    for (let g = 0; g < G; g++) {
      const at = i * G + g;
      const targets = linspace(0, progress[g], S);
      const times = interpolate(targets, phase, even);
      const own = new Float64Array(d * S);
      for (let k = 0; k < d; k++)
        own.set(interpolate(targets, phase, path.subarray(k * N_POINTS, (k + 1) * N_POINTS)), k * S);
      describeBeginning(prefixes, at, own, times, d, S, rule, signals);
      const [before, until] = interpolate([(1 - numbers.last) * times[S - 1], times[S - 1]], even, lengths);
      endSpeeds[at] = Math.log(Math.max((1 - before / (until || 1)) / numbers.last, numbers.least_speed));
    }
  }
  return prefixes;
}

/** Write beginning number `at` with its samples (d, S) and their times. */
function describeBeginning(prefixes, at, own, times, d, S, rule, signals) {
  for (let t = 1; t < S; t++) {
    let square = 0;
    for (let k = 0; k < d; k++) square += (own[k * S + t] - own[k * S + t - 1]) ** 2;
    prefixes.lengths[at] += Math.sqrt(square);
  }
  let total = 0;
  for (let k = 0; k < d; k++) {
    const row = own.subarray(k * S, (k + 1) * S);
    const mean = row.reduce((sum, x) => sum + x, 0) / S;
    for (let t = 0; t < S; t++) {
      row[t] -= mean;
      total += row[t] ** 2;
    }
  }
  prefixes.sizes[at] = Math.sqrt(total / S);
  const per = 1 / ((prefixes.sizes[at] || 1) * Math.sqrt(S));
  for (let t = 0; t < d * S; t++) own[t] *= per;
  setRow(prefixes.rows, at * d * S, own, rule);
  const single = prefixes.rows.subarray(at * d * S, (at + 1) * d * S);
  prefixes.squares[at] = product(single, 0, single, 0, d * S);
  prefixes.elapsed[at] = times[S - 1];
  for (let t = 0; t < S; t++) prefixes.timing[at * S + t] = times[t] / ((times[S - 1] || 1) * Math.sqrt(S));
  const sized = own.map((x) => Math.sqrt(S) * x);
  fillShapes(sized, rule, prefixes.shapes, at, signals);
}

/** Every stored movement at every progress; made once. */
export function hypotheses(recognizer) {
  const { header, arrays } = recognizer;
  const { early, comparison, n_movements: m } = header;
  const G = early.n_progress;
  const progress = Float64Array.from({ length: G }, (_, g) => (g + 1) / G);
  const [size, paths] = [comparison.n_dims * N_POINTS, arrays.paths.slice()];
  arrays["early movements"].forEach((i, k) => {
    paths.set(arrays["early paths"].subarray(k * size, (k + 1) * size), i * size);
  });
  const prefixes = beginnings(paths, comparison.n_dims, progress, early);
  const S = early.shapes.n_segments + 1;
  const each = (value) => Float64Array.from({ length: m * G }, (_, h) => value(h));
  return {
    recognizer,
    paths,
    progress,
    prefixes,
    S,
    logLengths: each((h) => finiteLog(prefixes.lengths[h])),
    logDurations: each((h) => finiteLog(arrays.durations[Math.floor(h / G)] * prefixes.elapsed[h])),
    timingSquares: each((h) => product(prefixes.timing, h * S, prefixes.timing, h * S, S)),
  };
}
