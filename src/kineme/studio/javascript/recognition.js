// What a movement is, or that it is unknown: similarities, classes, calibrated p-values.

import { argmax, descending, logSumExp, softmax } from "./arrays.js";
import { certainty } from "./certainty.js";
import { describeMovement, describeRows, featureRows, N_POINTS, roomFor } from "./description.js";
import { squaredDistances } from "./distances.js";

const SCALE_OF_REACH = Math.sqrt(Math.PI / 4 / Math.log(20)); // by which the broad law is 0.05 at a reach of 1
const SHOWN = 3; // movements named in an answer

/** A-averages of kernels given by their logarithms. */
const MEANS = {
  arithmetic: (logs) => logSumExp(logs) - Math.log(logs.length),
  geometric: (logs) => logs.reduce((sum, log) => sum + log, 0) / logs.length,
  harmonic: (logs) => Math.log(logs.length) - logSumExp(logs.map((log) => -log)),
  quadratic: (logs) => 0.5 * (logSumExp(logs.map((log) => 2 * log)) - Math.log(logs.length)),
  min: (logs) => Math.min(...logs),
};

/** Share of each kernel in an average. */
const SHARES = {
  arithmetic: softmax,
  geometric: (logs) => logs.map(() => 1 / logs.length),
  harmonic: (logs) => softmax(logs.map((log) => -log)),
  quadratic: (logs) => softmax(logs.map((log) => 2 * log)),
  min: (logs) => logs.map((log) => (log === Math.min(...logs) ? 1 : 0)),
};

/** The stored movements, described by their smooth paths. @returns {Recognizer} */
export function knownClasses({ header, arrays }) {
  const how = header.comparison;
  const [d, m] = [how.n_dims, header.n_movements];
  const stored = roomFor(m, how);
  const size = how.details ? d * how.details.positions.n_points : 0;
  for (let i = 0; i < m; i++) {
    const path = Float64Array.from(arrays.paths.subarray(i * d * N_POINTS, (i + 1) * d * N_POINTS));
    const start = arrays.starts.subarray(i * d, (i + 1) * d);
    const placed = how.translation ? path : path.map((x, j) => x + start[Math.floor(j / N_POINTS)]);
    const details = arrays["detailed rows"]?.subarray(i * size, (i + 1) * size);
    describeRows(stored, i, featureRows(placed, how, arrays), details, how);
  }
  return { header, arrays, stored };
}

/** Logarithms of each representation's kernel times R times its weight: R rows of m numbers. */
export function kernelLogs(how, squares) {
  const { widths, weights } = how;
  const m = squares.length / widths.length;
  const equal = weights.every((weight) => weight === weights[0]);
  return squares.map((square, k) => {
    const r = Math.floor(k / m);
    const log = widths[r] === null ? 0 : -square / (2 * widths[r] ** 2);
    return equal ? log : log + Math.log(widths.length * weights[r]);
  });
}

/** The averages of R logarithms, for each of m movements. */
export function logAverages(how, logs) {
  const R = how.widths.length;
  const m = logs.length / R;
  const column = new Float64Array(R);
  return Float64Array.from({ length: m }, (_, j) => {
    for (let r = 0; r < R; r++) column[r] = logs[r * m + j];
    return MEANS[how.mean](column);
  });
}

/** The largest of each class's numbers. */
function largest(values, first) {
  return Float64Array.from(first, (start, c) => {
    let most = -Infinity;
    for (let j = start; j < (first[c + 1] ?? values.length); j++) most = Math.max(most, values[j]);
    return most;
  });
}

/** How a movement compares with every class. */
export function compare(recognizer, described) {
  const { comparison: how, first, classifier, medoids } = recognizer.header;
  const logs = kernelLogs(how, squaredDistances(how, described, recognizer.stored));
  const m = recognizer.stored.m;
  const average = logAverages(how, logs);
  const nearest = largest(average, first);
  let scores = nearest;
  let similar = nearest; // what odds are told by
  if (classifier === "nearest-each") {
    const each = how.widths.map((_, r) => largest(logs.subarray(r * m, (r + 1) * m), first));
    scores = similar = Float64Array.from(first, (_, c) => MEANS[how.mean](Float64Array.from(each, (row) => row[c])));
  } else if (classifier === "prototype") {
    scores = Float64Array.from(medoids, (j) => average[j]);
  }
  return { logs, average, nearest, scores, similar };
}

/** `sqrt(-2 log K)`: the distance, in kernel widths, of an averaged similarity. */
const distance = (log, { rounding }) => (log < -rounding ? Math.sqrt(-2 * log) : 0);

/** Share of distances above a score, broad: normal vectors in the plane. */
const broadLaw = (score) => Math.exp(-0.25 * Math.PI * score * score);

/** The same of normal vectors in more dimensions, an even number. */
function law(score, { dimensions, mean_length: mean }) {
  const y = 0.5 * (mean * score) ** 2;
  let [sum, term] = [0, 1];
  for (let k = 1; k <= dimensions / 2; k++) {
    sum += term;
    term *= y / k;
  }
  return Math.exp(-y) * sum;
}

/** `(1 + #{calibrating >= score}) / (number + 1)`, of rising numbers. */
function shareAbove(calibrating, score) {
  let below = 0;
  for (let end = calibrating.length; below < end; ) {
    const middle = (below + end) >> 1;
    if (calibrating[middle] < score) below = middle + 1;
    else end = middle;
  }
  return (1 + calibrating.length - below) / (calibrating.length + 1);
}

/** The rule and the rising scores that count for a class: its own if they suffice, else those of all, else none. */
function calibratedBy(recognizer, kind, c, errorRate) {
  const { arrays, header } = recognizer;
  const part = (name, i) => arrays[name].subarray(arrays[`${name} ends`][i - 1] ?? 0, arrays[`${name} ends`][i]);
  const enough = (scores) => (scores.length + 1) * errorRate > 1 - 1e-12;
  const own = part(`own ${kind}`, c);
  const pooled = part(`pooled ${kind}`, header.calibration.pooled[c]);
  if (enough(own)) return { rule: "class", scores: own, pooled };
  return enough(pooled) ? { rule: "pooled", scores: pooled, pooled } : { rule: "guess", scores: null, pooled };
}

/** The p-value if somebody else made the movement; 0 where groups tell how much people differ. */
function byStrangers(recognizer, away) {
  const { between, least, reach_of_strangers: most, reach_to_next: share } = recognizer.header.calibration;
  if (!between) return 0;
  const [nearest, next = Infinity] = Float64Array.from(away).sort();
  const reach = Math.min(most * between, share * next);
  return broadLaw(nearest / Math.max(reach * SCALE_OF_REACH, least));
}

/**
 * P-values of each class and of all together, see kineme.recognition.conformal, by the log similarity to the nearest
 * movement of each class.
 */
function pValues(recognizer, nearest, errorRate) {
  const { calibration } = recognizer.header;
  const away = nearest.map((log) => distance(log, calibration));
  const scores = away.map((gap, c) => gap / recognizer.arrays.scales[c]);
  const rules = Array.from(scores, (_, c) => calibratedBy(recognizer, "scores", c, errorRate));
  const each = scores.map((score, c) => (rules[c].scores ? shareAbove(rules[c].scores, score) : broadLaw(score)));
  const like = scores.reduce((best, score, c) => (score < scores[best] ? c : best), 0);
  const all = calibratedBy(recognizer, "novelties", like, errorRate);
  const mean = all.pooled.reduce((sum, score) => sum + score, 0) / all.pooled.length;
  const guess = all.pooled.length
    ? law(scores[like] / Math.max(mean, calibration.least), calibration)
    : broadLaw(scores[like]);
  const shown = all.scores ? shareAbove(all.scores, scores[like]) : guess;
  const strangers = byStrangers(recognizer, away);
  return {
    each,
    pKnown: Math.max(shown, strangers),
    rule: all.scores && shown <= errorRate && strangers > errorRate ? "strangers" : all.rule,
    calibrated: rules.every((rule) => rule.scores !== null),
  };
}

/** Probability of each class for movements of one of them: the odds are ratios of distances to the power fitted. */
function probabilities(recognizer, similar) {
  const { calibration } = recognizer.header;
  const { exponent, least } = calibration;
  return softmax(similar.map((log) => -exponent * Math.log(Math.max(distance(log, calibration), least))));
}

/**
 * The answer to a movement; the error rate is the share of known movements that may be called unknown.
 * @param {Recognizer} recognizer @param {TimedPositions} movement @returns {Answer}
 */
export function recognize(recognizer, movement, errorRate = 0.05) {
  const { calibration, comparison: how, classes, first } = recognizer.header;
  const compared = compare(recognizer, describeMovement(movement, how, recognizer.arrays));
  const p = pValues(recognizer, compared.nearest, errorRate);
  const possible = p.each.some((share) => share > errorRate);
  const chosen = argmax(compared.scores.map((score, c) => (!possible || p.each[c] > errorRate ? score : -Infinity)));
  const isKnown = p.pKnown > errorRate;
  const ranked = descending(compared.scores);
  const shown = isKnown ? chosen : ranked[0];
  const odds = probabilities(recognizer, compared.similar);
  const own = compared.average.subarray(first[shown], first[shown + 1] ?? recognizer.stored.m);
  const nearest = descending(own)
    .slice(0, SHOWN)
    .map((j) => ({ row: first[shown] + j, similarity: Math.exp(own[j]) }));
  const m = recognizer.stored.m;
  const shares = SHARES[how.mean](Float64Array.from(how.widths, (_, r) => compared.logs[r * m + nearest[0].row]));
  const responsibilities = {};
  for (const [r, name] of how.names.entries()) responsibilities[name] = (responsibilities[name] ?? 0) + shares[r];
  return {
    label: isKnown ? classes[chosen] : null,
    certainty: certainty(recognizer.header.certainty, odds[shown], {
      isNew: !isKnown,
      isGuess: calibration.guesses.includes(p.rule),
    }),
    confidence: isKnown ? odds[shown] : 1 - p.pKnown,
    p_known: p.pKnown,
    rule: p.rule,
    promise: calibration.promises[p.rule],
    calibrated: p.calibrated,
    ranked: ranked.map((c) => ({ label: classes[c], probability: odds[c], p_value: p.each[c] })),
    nearest: nearest.map(({ row, similarity }) => ({
      index: recognizer.header.ids?.[row] ?? row,
      name: null,
      similarity,
    })),
    transform: null,
    responsibilities,
  };
}
