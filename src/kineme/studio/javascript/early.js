// A movement while it is under way: which stored one, how much of it, and what remains.

import { argmax, descending, interpolate, linspace, softmax } from "./arrays.js";
import { N_POINTS, smoothly } from "./description.js";
import { logEvidence, shares } from "./evidence.js";
import { withoutGlitches } from "./glitches.js";
import { beginnings } from "./hypotheses.js";
import { withoutPauses } from "./pauses.js";
import { evenPath, movement } from "./preparation.js";
import { bestRotation } from "./rotation.js";

const N_REMAINING = 20; // samples of the predicted path
const WHOLE = [1];

/** Progress and time left on average over a class's hypotheses, the remaining path from its best one. */
function forecast(stored, evidence, label, begun, duration) {
  const { early, first, n_movements: m, comparison } = stored.recognizer.header;
  const [G, d, { paths, prefixes, S }] = [early.n_progress, comparison.n_dims, stored];
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
  const path = paths.subarray(Math.floor(best / G) * d * N_POINTS);
  const even = linspace(0, 1, N_POINTS);
  const times = linspace(prefixes.elapsed[best], 1, N_REMAINING);
  const rows = Array.from({ length: d }, (_, k) =>
    interpolate(times, even, path.subarray(k * N_POINTS, (k + 1) * N_POINTS)),
  );
  const R = bestRotation(early.rule, begun.rows, prefixes.rows.subarray(best * d * S, (best + 1) * d * S));
  const { n_dims: r } = early.rule;
  const size = prefixes.sizes[best] > 0 ? begun.sizes[0] / prefixes.sizes[best] : 1;
  const remaining = Array.from({ length: N_REMAINING }, (_, p) =>
    Array.from({ length: d }, (_, k) => {
      let x = 0;
      for (let h = k - (k % r), at = (k % r) * r; at < ((k % r) + 1) * r; h++, at++)
        x += R[at] * (rows[h][p] - rows[h][0]);
      return size * x;
    }),
  );
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

/** Follow one movement, given the hypotheses; see `kineme.Recognizer.stream`. */
export function follow(stored, { confidence = 0.9, patience = 0.05 } = {}) {
  const { classes, columns, comparison: how, early } = stored.recognizer.header;
  const { n_dims: d, cutoff, pauses } = how;
  const decide = decision(confidence, patience);
  let [leader, furthest] = [-1, 0];
  /**
   * The state after all samples so far, in the form of `kineme.recognition.LiveState.to_dict`; null while there are too
   * few, or nothing moves.
   */
  return (times, positions) => {
    const n = times.length;
    if (n < 4 || positions.every((x) => x.every((value, k) => value === positions[0][k]))) return null;
    const soFar = movement(times, positions, d, columns);
    const clean = withoutGlitches(soFar, pauses.glitches);
    const active = withoutPauses(clean, early.pauses);
    const duration = active.times.at(-1) - active.times[0];
    const begun = beginnings(smooth(active, cutoff), d, WHOLE, early);
    const unpaused = withoutPauses(clean, pauses);
    const whole = smoothly(how, (cycles, rule) => smooth(rule ? withoutPauses(clean, rule) : unpaused, cycles));
    const elapsed = times[n - 1] - times[0];
    const evidence = logEvidence(stored, begun, whole, positions[0], duration);
    const share = shares(stored, evidence);
    const order = descending(share.subarray(0, classes.length));
    const decided = decide(elapsed, order[0], share[order[0]]);
    const shown = decided ?? order[0];
    const ahead = forecast(stored, evidence, shown, begun, duration);
    furthest = Math.max(ahead.progress, shown === leader ? furthest : 0);
    leader = shown;
    const unknown = share[classes.length];
    const known = order.reduce((sum, c) => sum + share[c], 0);
    const remaining = ahead.remaining.map((x) => x.map((value, k) => value + soFar.positions[(n - 1) * d + k]));
    return {
      label: decided === null ? null : classes[decided],
      certainty: unknown > share[order[0]] ? null : "looks like",
      ranked: order.map((c) => ({ label: classes[c], confidence: share[c], probability: share[c] / known })),
      unknown,
      progress: Math.min(furthest, 1),
      arrival: times[n - 1] + ahead.seconds,
      path: remaining,
      goal: remaining.at(-1),
    };
  };
}

/** A movement at even times, as the stored ones are smoothed; its start stays where the spline has it. */
function smooth({ times, positions, d }, cutoff) {
  const even = linspace(times[0], times.at(-1), N_POINTS);
  const column = (k) => Float64Array.from(times, (_, j) => positions[j * d + k] - positions[k]);
  const rows = Array.from({ length: d }, (_, k) => interpolate(even, times, column(k)));
  if (cutoff === null) return Float64Array.from(rows.flatMap((row) => [...row]));
  const samples = Float64Array.from({ length: d * N_POINTS }, (_, j) => rows[j % d][Math.floor(j / d)]);
  return evenPath(movement(linspace(0, 1, N_POINTS), samples, d), cutoff, N_POINTS);
}
