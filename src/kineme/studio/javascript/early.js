// A movement while it is under way: which stored one, how much of it, and what remains.

import { argmax, descending, interpolate, linspace, logSumExp, product, softmax } from "./arrays.js";
import { describePath, fillShapes, N_POINTS, roomForShapes } from "./description.js";
import { pairDistances, squaredDistances } from "./distances.js";
import { arcLengthPhase, evenPath, movement } from "./preparation.js";
import { kernelLogs, logAverages } from "./recognition.js";
import { align, bestRotation } from "./rotation.js";

const LAST = 0.02; // share of a beginning's time in which the speed at its end is measured
const LEAST_SPEED = 0.01; // of the mean speed
const COMPARED = 200; // hypotheses compared pair by pair, and the best one of each class
const WIDENED = 2; // widths of positions where they choose those
const ROTATION = 10; // weight of the rotation prior
const SPEED_SPREAD = 0.5; // of the logarithm of the speed at the end
const PROGRESS = 0.25; // exponent of the density of progress
const POWER = 3; // of the similarity of whole movements
const NEGLIGIBLE = 5; // whole movements are not compared with less than exp(-5) of the largest evidence
const OVER = -3; // logarithm of the odds that a movement is over before its speed is known
const MOST_ODDS = 10;
const UNKNOWN = -0.5 * (1.5 / 0.4) ** 2 - 1.5; // logarithm of the evidence for an unknown movement
const TEMPER = 0.8; // exponent of the shares
const EXPLAINING = 20; // a movement explains a beginning at about one in so many values of progress
const N_REMAINING = 20; // samples of the predicted path
const SMALLEST = 2.2250738585072014e-308;
const WHOLE = [1];

/**
 * @typedef {Object} Prefixes G beginnings of each of n movements, S samples along their arc lengths
 * @property {Float32Array} rows centered, of norm 1
 * @property {Float64Array} squares of their norms
 * @property {Float64Array} timing time of each sample as a share of the beginning's, over the root of S
 * @property {Float64Array} sizes
 * @property {Float64Array} lengths
 * @property {Float64Array} elapsed as a share of the movement's time
 * @property {Float64Array} endSpeeds logarithms
 * @property {import("./description.js").Shapes} shapes
 */

/** The beginnings of paths (n, d, N_POINTS) until each share of their arc length. @returns {Prefixes} */
function beginnings(paths, d, progress, how) {
  const [S, G, n] = [how.n_segments + 1, progress.length, paths.length / (d * N_POINTS)];
  const room = (size) => new Float64Array(n * G * size);
  const [squares, sizes, lengths, elapsed, endSpeeds] = [1, 1, 1, 1, 1].map(room);
  const found = { rows: new Float32Array(n * G * d * S), timing: room(S), shapes: roomForShapes(n * G, d, how) };
  Object.assign(found, { squares, sizes, lengths, elapsed, endSpeeds });
  const even = linspace(0, 1, N_POINTS);
  for (let i = 0; i < n; i++) {
    const path = paths.subarray(i * d * N_POINTS, (i + 1) * d * N_POINTS);
    const phase = arcLengthPhase(path, d);
    for (let g = 0; g < G; g++) {
      const at = i * G + g;
      const targets = linspace(0, progress[g], S);
      const times = interpolate(targets, phase, even);
      const own = new Float64Array(d * S);
      for (let k = 0; k < d; k++) own.set(interpolate(targets, phase, path.subarray(k * N_POINTS, (k + 1) * N_POINTS)), k * S);
      describeBeginning(found, at, own, times, d, S);
      const before = interpolate([(1 - LAST) * times[S - 1]], even, phase)[0];
      endSpeeds[at] = Math.log(Math.max((1 - before / progress[g]) / LAST, LEAST_SPEED));
    }
  }
  return found;
}

/** Write beginning number `at` with its samples (d, S) and their times. */
function describeBeginning(found, at, own, times, d, S) {
  for (let t = 1; t < S; t++) {
    let square = 0;
    for (let k = 0; k < d; k++) square += (own[k * S + t] - own[k * S + t - 1]) ** 2;
    found.lengths[at] += Math.sqrt(square);
  }
  let total = 0;
  for (let k = 0; k < d; k++) {
    const row = own.subarray(k * S, (k + 1) * S);
    const mean = row.reduce((sum, x) => sum + x, 0) / S;
    for (let t = 0; t < S; t++) total += (row[t] -= mean) ** 2;
  }
  found.sizes[at] = Math.sqrt(total / S);
  const per = 1 / ((found.sizes[at] || 1) * Math.sqrt(S));
  for (let t = 0; t < d * S; t++) own[t] *= per;
  found.rows.set(own, at * d * S);
  const single = found.rows.subarray(at * d * S, (at + 1) * d * S);
  found.squares[at] = product(single, 0, single, 0, d * S);
  found.elapsed[at] = times[S - 1];
  for (let t = 0; t < S; t++) found.timing[at * S + t] = times[t] / ((times[S - 1] || 1) * Math.sqrt(S));
  fillShapes(own, d, found.shapes, at, Math.sqrt(S));
}

/**
 * Every stored movement at every progress; made once.
 * @param {import("./recognition.js").Known} known
 */
export function hypotheses(known) {
  const { header, arrays } = known;
  const { early, comparison, n_movements: m } = header;
  const G = early.n_progress;
  const progress = Float64Array.from({ length: G }, (_, g) => (g + 1) / G);
  const prefixes = beginnings(arrays.paths, comparison.n_dims, progress, early.shapes);
  const S = early.shapes.n_segments + 1;
  const each = (value) => Float64Array.from({ length: m * G }, (_, h) => value(h));
  return {
    known, progress, prefixes, S,
    logLengths: each((h) => Math.log(Math.max(prefixes.lengths[h], SMALLEST))),
    logDurations: each((h) => Math.log(Math.max(arrays.durations[Math.floor(h / G)] * prefixes.elapsed[h], SMALLEST))),
    timingSquares: each((h) => product(prefixes.timing, h * S, prefixes.timing, h * S, S)),
  };
}

/** Logarithms of the densities of size, duration, timing, speed at the end, and progress, for each hypothesis. */
function logPriors(stored, begun, duration) {
  const { prefixes, progress, S, logLengths, logDurations, timingSquares } = stored;
  const { size_spread: sizeSpread, duration_spread: durationSpread, timing_spread: timingSpread } = stored.known.header.early;
  const [length, longer] = [begun.lengths[0], duration].map((one) => Math.log(Math.max(one, SMALLEST)));
  const square = product(begun.timing, 0, begun.timing, 0, S);
  const over = (value, spread) => (spread === null ? 0 : 0.5 * (value / spread) ** 2);
  return logLengths.map((_, h) => {
    const late = Math.max(square + timingSquares[h] - 2 * product(begun.timing, 0, prefixes.timing, h * S, S), 0);
    const normal = over(length - logLengths[h], sizeSpread) + over(longer - logDurations[h], durationSpread);
    const faster = (begun.endSpeeds[0] - prefixes.endSpeeds[h]) / SPEED_SPREAD;
    const cauchy = (1 + over(Math.sqrt(late), timingSpread)) * (1 + 0.5 * faster * faster);
    return PROGRESS * Math.log(progress[h % progress.length]) - normal - Math.log(cauchy);
  });
}

/** Hypotheses to be compared pair by pair: the best ones, and the best of each class. @returns {number[]} */
function choose(rough, first, G) {
  const n = rough.length;
  if (n <= COMPARED) return Array.from(rough, (_, h) => h);
  const least = Float64Array.from(rough).sort()[n - COMPARED];
  const found = [];
  first.forEach((start, c) => {
    const end = (first[c + 1] ?? n / G) * G;
    let best = -Infinity;
    for (let h = start * G; h < end; h++) best = Math.max(best, rough[h]);
    for (let h = start * G; h < end; h++) if (rough[h] >= least || rough[h] >= best) found.push(h);
  });
  return found;
}

/** Logarithm of the odds that movements of that speed at their end are over. */
function logOdds({ over, before }, speed) {
  const tooFast = Math.max(speed - over[0], 0) / over[1];
  const tooSlow = Math.min(speed - before[0], 0) / before[1];
  return OVER + Math.min(Math.max(0.5 * (tooSlow ** 2 - tooFast ** 2), -MOST_ODDS), MOST_ODDS);
}

/**
 * Logarithm of the evidence for each hypothesis; -Infinity where another is far more likely.
 * See kineme.recognition.early.evidence.
 */
function logEvidence(stored, begun, path, start, duration) {
  const { header } = stored.known;
  const { early, first, comparison: { n_dims: d } } = header;
  const [G, S, prefixes] = [early.n_progress, stored.S, stored.prefixes];
  const priors = logPriors(stored, begun, duration);
  const [w0, w1, w2] = early.widths.map((width) => 2 * width * width);
  const compare = (h, R) => {
    const norms = Math.sqrt(begun.squares[0] * prefixes.squares[h]);
    return align(early.rule, begun.rows, 0, prefixes.rows, h * d * S, S, norms, R);
  };
  const rough = priors.map((prior, h) => {
    const square = Math.max(begun.squares[0] + prefixes.squares[h] - 2 * compare(h, null), 0);
    return prior - square / (WIDENED * WIDENED * w0);
  });
  const odds = logOdds(early, begun.endSpeeds[0]);
  const evidence = new Float64Array(rough.length).fill(-Infinity);
  const measure = pairDistances(early.shapes, d, begun.shapes);
  const [R, squares] = [new Float64Array(d * d), new Float64Array(3)];
  for (const h of choose(rough, first, G)) {
    compare(h, R);
    for (let k = 0; k < d * d; k++) R[k] = Math.fround(R[k]);
    measure(prefixes.shapes, h, R, squares);
    const near = logSumExp([-squares[0] / w1, -squares[2] / w2]) - Math.LN2 + logRotation(early.rule, R);
    evidence[h] = near + priors[h] - logSumExp([0, odds]);
  }
  addOver(stored, path, start, evidence, priors.map((prior) => prior - logSumExp([0, -odds])));
  return evidence;
}

/** Logarithm of the prior density of a rotation. */
function logRotation({ n_dims: d, prior }, R) {
  if (!prior) return 0;
  let [sum, trace] = [0, 0];
  for (let k = 0; k < d * d; k++) sum += R[k] * prior[k];
  for (let k = 0; k < d; k++) trace += prior[k * (d + 1)];
  return ROTATION * (sum - trace);
}

/** Add the evidence that the movement is over. */
function addOver(stored, path, start, evidence, priors) {
  const { header, arrays, stored: references } = stored.known;
  const { early, first, n_movements: m } = header;
  const G = early.n_progress;
  const most = Float64Array.from({ length: m }, (_, j) => priors[j * G + G - 1]);
  if (most[argmax(most)] < evidence[argmax(evidence)] - NEGLIGIBLE) return;
  const how = early.own_rotations ? { ...header.comparison, rule: early.rule } : header.comparison;
  const whole = describePath(path, start, how, arrays);
  const similar = logAverages(how, kernelLogs(how, squaredDistances(how, whole, references))).map((log) => POWER * log);
  const counts = first.map((begin, c) => (first[c + 1] ?? m) - begin);
  const owner = counts.flatMap((count, c) => Array(count).fill(c));
  const over = logSumExp(similar.map((log, j) => most[j] + log - Math.log(counts[owner[j]])));
  const best = first.map((begin, c) => begin + argmax(similar.subarray(begin, begin + counts[c])));
  const all = logSumExp(best.map((j) => similar[j]));
  best.forEach((j, c) => {
    const at = j * G + G - 1;
    evidence[at] = logSumExp([evidence[at], over + similar[j] - all + Math.log(counts[c] * (G / EXPLAINING))]);
  });
}

/** Share of each class, and, last, of an unknown movement, in the evidence. */
function shares(stored, evidence) {
  const { early, first, n_movements: m } = stored.known.header;
  const G = early.n_progress;
  const logs = first.map((begin, c) => {
    const end = first[c + 1] ?? m;
    return logSumExp(evidence.subarray(begin * G, end * G)) - Math.log(((end - begin) * G) / EXPLAINING);
  });
  return softmax(Float64Array.from([...logs, UNKNOWN], (log) => TEMPER * log));
}

/** Progress and time left on average over a class's hypotheses, the remaining path from its best one. */
function forecast(stored, evidence, label, begun, duration) {
  const { header, arrays } = stored.known;
  const { early, first, n_movements: m, comparison: { n_dims: d } } = header;
  const [G, { prefixes, S }] = [early.n_progress, stored];
  const from = first[label] * G;
  const own = evidence.subarray(from, (first[label + 1] ?? m) * G);
  const weights = softmax(own);
  let [progress, left] = [0, 0];
  weights.forEach((weight, i) => {
    const elapsed = Math.max(prefixes.elapsed[from + i], 1e-3);
    progress += weight * stored.progress[(from + i) % G];
    left += (weight * (1 - elapsed)) / elapsed;
  });
  const best = from + argmax(own);
  const path = arrays.paths.subarray(Math.floor(best / G) * d * N_POINTS);
  const even = linspace(0, 1, N_POINTS);
  const times = linspace(prefixes.elapsed[best], 1, N_REMAINING);
  const rows = Array.from({ length: d }, (_, k) => interpolate(times, even, path.subarray(k * N_POINTS, (k + 1) * N_POINTS)));
  const R = bestRotation(early.rule, begun.rows, prefixes.rows.subarray(best * d * S, (best + 1) * d * S));
  const size = prefixes.sizes[best] > 0 ? begun.sizes[0] / prefixes.sizes[best] : 1;
  const remaining = Array.from({ length: N_REMAINING }, (_, p) => Array.from({ length: d }, (_, k) => {
    let x = 0;
    for (let h = 0; h < d; h++) x += R[k * d + h] * (rows[h][p] - rows[h][0]);
    return size * x;
  }));
  return { progress, seconds: left * duration, remaining };
}

/** Decides for a label after it has been confident for a while; changes it only for one that is so for longer. */
function decision(confidence, patience) {
  let [label, candidate, since] = [null, null, 0];
  return (elapsed, leader, share) => {
    if (share < confidence || leader === label) {
      candidate = null;
      return label;
    }
    if (leader !== candidate) [candidate, since] = [leader, elapsed];
    const needed = patience * elapsed * (label === null ? 1 : 2);
    if (elapsed - since >= needed && (elapsed > since || patience === 0)) [label, candidate] = [leader, null];
    return label;
  };
}

/**
 * Follows one movement; see `kineme.Recognizer.stream`.
 * @param {ReturnType<typeof hypotheses>} stored
 * @param {{confidence?: number, patience?: number}} [options]
 */
export function follow(stored, { confidence = 0.9, patience = 0.05 } = {}) {
  const { classes, comparison: { n_dims: d, cutoff } } = stored.known.header;
  const decide = decision(confidence, patience);
  let [leader, furthest] = [-1, 0];
  /**
   * The state after all samples so far; null while there are too few, or nothing moves.
   * @param {number[]} times
   * @param {number[][]} positions
   */
  return (times, positions) => {
    const n = times.length;
    if (n < 4 || positions.every((x) => x.every((value, k) => value === positions[0][k]))) return null;
    const even = linspace(times[0], times[n - 1], N_POINTS);
    const rows = Array.from({ length: d }, (_, k) => interpolate(even, times, positions.map((x) => x[k] - positions[0][k])));
    const samples = Float64Array.from({ length: d * N_POINTS }, (_, j) => rows[j % d][Math.floor(j / d)]);
    const path = smooth(movement(linspace(0, 1, N_POINTS), samples, d), cutoff, rows);
    const begun = beginnings(path, d, WHOLE, stored.known.header.early.shapes);
    const elapsed = times[n - 1] - times[0];
    const evidence = logEvidence(stored, begun, path, positions[0], elapsed);
    const share = shares(stored, evidence);
    const order = descending(share.subarray(0, classes.length));
    const decided = decide(elapsed, order[0], share[order[0]]);
    const shown = decided ?? order[0];
    const ahead = forecast(stored, evidence, shown, begun, elapsed);
    furthest = Math.max(ahead.progress, shown === leader ? furthest : 0);
    leader = shown;
    return {
      ranked: order.map((c) => ({ name: classes[c], share: share[c] })),
      unknown: share[classes.length],
      decided: decided === null ? null : classes[decided],
      progress: Math.min(furthest, 1),
      arrival: times[n - 1] + ahead.seconds,
      path: ahead.remaining.map((x) => x.map((value, k) => value + positions[n - 1][k])),
    };
  };
}

/** A path at even times as the stored ones are smoothed; its start stays where the spline has it. */
function smooth(one, cutoff, rows) {
  return cutoff === null ? Float64Array.from(rows.flatMap((row) => [...row])) : evenPath(one, cutoff, N_POINTS);
}
