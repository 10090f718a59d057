// How much speaks for each beginning of a stored movement, and with it for each class.
// See kineme.recognition.early.evidence.

import { argmax, finiteLog, logSumExp, product, softmax } from "./arrays.js";
import { describePath } from "./description.js";
import { pairDistances, squaredDistances } from "./distances.js";
import { kernelLogs, logAverages } from "./recognition.js";
import { align } from "./rotation.js";

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

/** Logarithms of the densities of size, duration, timing, speed at the end, and progress, for each hypothesis. */
function logPriors(stored, begun, duration) {
  const { prefixes, progress, S, logLengths, logDurations, timingSquares } = stored;
  const {
    size_spread: sizeSpread,
    duration_spread: durationSpread,
    timing_spread: timingSpread,
  } = stored.known.header.early;
  const [length, longer] = [begun.lengths[0], duration].map(finiteLog);
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
export function logEvidence(stored, begun, path, start, duration) {
  const { header } = stored.known;
  const {
    early,
    first,
    comparison: { n_dims: d },
  } = header;
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
  addOver(
    stored,
    path,
    start,
    evidence,
    priors.map((prior) => prior - logSumExp([0, -odds])),
  );
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
export function shares(stored, evidence) {
  const { early, first, n_movements: m } = stored.known.header;
  const G = early.n_progress;
  const logs = first.map((begin, c) => {
    const end = first[c + 1] ?? m;
    return logSumExp(evidence.subarray(begin * G, end * G)) - Math.log(((end - begin) * G) / EXPLAINING);
  });
  return softmax(Float64Array.from([...logs, UNKNOWN], (log) => TEMPER * log));
}
