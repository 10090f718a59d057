// How much speaks for each beginning of a stored movement, and with it for each class.
// See kineme.recognition.early.evidence.

import { argmax, finiteLog, logSumExp, product, softmax } from "./arrays.js";
import { describePath } from "./description.js";
import { pairDistances, squaredDistances } from "./distances.js";
import { kernelLogs, logAverages } from "./recognition.js";
import { align, rotates } from "./rotation.js";

/** Logarithms of the densities of size, duration, timing, speed at the end, and progress, for each hypothesis. */
function logPriors(stored, begun, duration) {
  const { prefixes, progress, S, logLengths, logDurations, timingSquares } = stored;
  const { size_spread, duration_spread, timing_spread, numbers } = stored.recognizer.header.early;
  const [length, longer] = [begun.lengths[0], duration].map(finiteLog);
  const square = product(begun.timing, 0, begun.timing, 0, S);
  const over = (value, spread) => (spread === null ? 0 : 0.5 * (value / spread) ** 2);
  return logLengths.map((_, h) => {
    const late = Math.max(square + timingSquares[h] - 2 * product(begun.timing, 0, prefixes.timing, h * S, S), 0);
    const normal = over(length - logLengths[h], size_spread) + over(longer - logDurations[h], duration_spread);
    const faster = (begun.endSpeeds[0] - prefixes.endSpeeds[h]) / numbers.speed_spread;
    const cauchy = (1 + over(Math.sqrt(late), timing_spread)) * (1 + 0.5 * faster * faster);
    return numbers.progress * Math.log(progress[h % progress.length]) - normal - Math.log(cauchy);
  });
}

/** Hypotheses to be compared pair by pair: the best ones, and the best of each class. */
function choose(rough, first, G, compared) {
  const n = rough.length;
  if (n <= compared) return Array.from(rough, (_, h) => h);
  const least = Float64Array.from(rough).sort()[n - compared];
  const chosen = [];
  first.forEach((start, c) => {
    const end = (first[c + 1] ?? n / G) * G;
    let best = -Infinity;
    for (let h = start * G; h < end; h++) best = Math.max(best, rough[h]);
    for (let h = start * G; h < end; h++) if (rough[h] >= least || rough[h] >= best) chosen.push(h);
  });
  return chosen;
}

/** Logarithm of the odds that movements of that speed at their end are over. */
function logOdds({ over, before, numbers }, speed) {
  const tooFast = Math.max(speed - over[0], 0) / over[1];
  const tooSlow = Math.min(speed - before[0], 0) / before[1];
  const most = numbers.most_odds;
  return numbers.prior_odds + Math.min(Math.max(0.5 * (tooSlow ** 2 - tooFast ** 2), -most), most);
}

/**
 * Logarithm of the evidence for each hypothesis; -Infinity where another is far more likely.
 * See kineme.recognition.early.evidence.
 */
export function logEvidence(stored, begun, whole, start, duration) {
  const { header } = stored.recognizer;
  const { early, first } = header;
  const [G, prefixes, numbers] = [early.n_progress, stored.prefixes, early.numbers];
  const size = begun.rows.length;
  const priors = logPriors(stored, begun, duration);
  const [w0, ...pairs] = early.widths.map((width) => 2 * width * width);
  const compare = (h, R) => {
    const norms = Math.sqrt(begun.squares[0] * prefixes.squares[h]);
    return align(early.rule, begun.rows, 0, prefixes.rows, h * size, size / early.rule.n_dims, norms, R);
  };
  const rough = priors.map((prior, h) => {
    const square = Math.max(begun.squares[0] + prefixes.squares[h] - 2 * compare(h, null), 0);
    return prior - square / (numbers.widened ** 2 * w0);
  });
  const odds = logOdds(early, begun.endSpeeds[0]);
  const evidence = new Float64Array(rough.length).fill(-Infinity);
  const measure = pairDistances(early.shapes, begun.shapes);
  const R = rotates(early.rule) ? new Float64Array(early.rule.n_dims ** 2) : null;
  const squares = new Float64Array(3);
  for (const h of choose(rough, first, G, numbers.compared)) {
    compare(h, R);
    R?.set(R.map(Math.fround));
    measure(prefixes.shapes, h, R, squares);
    const logs = pairs.map((w, k) => -squares[2 * k] / w); // of the elastic path, and of the cloud except for signals
    evidence[h] = logSumExp(logs) - Math.log(logs.length) + logRotation(early, R) + priors[h] - logSumExp([0, odds]);
  }
  const ended = priors.map((prior) => prior - logSumExp([0, -odds]));
  addOver(stored, whole, start, evidence, ended);
  return evidence;
}

/** Logarithm of the prior density of a rotation. */
function logRotation({ rule: { n_dims: d, prior }, numbers }, R) {
  if (!prior) return 0;
  let [sum, trace] = [0, 0];
  for (let k = 0; k < d * d; k++) sum += R[k] * prior[k];
  for (let k = 0; k < d; k++) trace += prior[k * (d + 1)];
  return numbers.rotation * (sum - trace);
}

/** Add the evidence that the movement is over. */
function addOver(stored, whole, start, evidence, priors) {
  const { header, arrays, stored: references } = stored.recognizer;
  const { early, first, n_movements: m } = header;
  const { n_progress: G, numbers } = early;
  const most = Float64Array.from({ length: m }, (_, j) => priors[j * G + G - 1]);
  if (most[argmax(most)] < evidence[argmax(evidence)] - numbers.negligible) return;
  const how = early.own_rotations ? { ...header.comparison, rule: early.rule } : header.comparison;
  const described = describePath(whole, start, how, arrays);
  const similar = logAverages(how, kernelLogs(how, squaredDistances(how, described, references))).map(
    (log) => numbers.power * log,
  );
  const counts = first.map((begin, c) => (first[c + 1] ?? m) - begin);
  const owner = counts.flatMap((count, c) => Array(count).fill(c));
  const over = logSumExp(similar.map((log, j) => most[j] + log - Math.log(counts[owner[j]])));
  const best = first.map((begin, c) => begin + argmax(similar.subarray(begin, begin + counts[c])));
  const all = logSumExp(best.map((j) => similar[j]));
  best.forEach((j, c) => {
    const at = j * G + G - 1;
    evidence[at] = logSumExp([evidence[at], over + similar[j] - all + Math.log(counts[c] * (G / numbers.explaining))]);
  });
}

/** Share of each class, and, last, of an unknown movement, in the evidence. */
export function shares(stored, evidence) {
  const { early, first, n_movements: m } = stored.recognizer.header;
  const { n_progress: G, numbers } = early;
  const logs = first.map((begin, c) => {
    const end = first[c + 1] ?? m;
    return logSumExp(evidence.subarray(begin * G, end * G)) - Math.log(((end - begin) * G) / numbers.explaining);
  });
  const unknown = Math.min(numbers.log_unknown, Math.max(...logs) + 600 / numbers.temper); // no share is 0
  return softmax(Float64Array.from([...logs, unknown], (log) => numbers.temper * log));
}
