// Pauses within a movement, cut short: stamps far apart, and rests. The same as kineme.movements.preparation.pauses.

const GAP = 3; // median steps, and as many times neighbors and what the length of a step takes: longer ones are gaps
const PAUSE = 0.1; // of the time in motion: a gap, by neighbors and length, or a rest counts at most as much
const REST = 0.2; // of the reach: a rest after the start counts as at most the time that this takes at the mean speed
const LAST_REST = 0.25; // of the time in motion: a rest at the end counts at most as much
const RADIUS = 0.015; // of the reach from the first sample: so near to where a window begins a rest stays
const [SHORTEST, WINDOWS] = [4, 32]; // samples of a window, at least; windows in a movement
const FEWEST = 3; // steps that a rest is left, at least
const ROUNDS = 2;
const [EQUAL, WHOLE] = [1 + 1e-9, 1e-6]; // differences that are rounding

/**
 * The movement without its pauses; the same object if it has none.
 * @param {import("./preparation.js").Movement} one
 * @returns {import("./preparation.js").Movement}
 */
export function withoutPauses(one) {
  let cut = one;
  for (let round = 0; round < ROUNDS; round++) {
    const { steps, kept, changes } = shortened(cut);
    if (!changes) break;
    const elapsed = new Float64Array(steps.length);
    for (let j = 1; j < elapsed.length; j++) elapsed[j] = elapsed[j - 1] + steps[j - 1];
    const { positions, d } = cut;
    cut = {
      times: elapsed.filter((_, j) => kept[j]),
      positions: positions.filter((_, at) => kept[Math.floor(at / d)]),
      d,
    };
  }
  return cut;
}

/** The time that each step counts, 0 after the last sample; which samples are left; whether anything changes. */
function shortened({ times, positions, d }) {
  const n = times.length;
  const apart = (i, j) => {
    let total = 0;
    for (let k = 0; k < d; k++) total += (positions[j * d + k] - positions[i * d + k]) ** 2;
    return Math.sqrt(total);
  };
  const steps = Float64Array.from(times, (t, j) => (j < n - 1 ? times[j + 1] - t : 0));
  const usual = GAP * steps.slice(0, n - 1).sort()[Math.floor((n - 1) / 2)];
  let reach = 0;
  for (let j = 1; j < n; j++) reach = Math.max(reach, apart(0, j));
  const resting = restingSteps(n, apart, RADIUS * reach);
  let [motion, path] = [0, 0];
  for (let j = 0; j < n - 1; j++) {
    motion += resting[j] ? 0 : Math.min(steps[j], usual);
    path += resting[j] ? 0 : apart(j, j + 1);
  }
  const pace = path > 0 ? motion / path : 0; // seconds for a unit of length
  const longest = steps.map((_, j) => {
    const neighbor = Math.max(j > 0 ? steps[j - 1] : 0, j < n - 1 ? steps[j + 1] : 0);
    const length = j < n - 1 ? apart(j, j + 1) : 0;
    return Math.max(usual, Math.min(GAP * Math.max(neighbor, length * pace), PAUSE * motion));
  });
  const changes = steps.some((step, j) => step > EQUAL * longest[j]);
  const counted = steps.map((step, j) => Math.min(step, longest[j]));
  const { kept, shorter } = shortenRests(counted, resting, motion, REST * reach * pace);
  return { steps: counted, kept, changes: changes || shorter };
}

/** Shorten the steps of long rests; which samples are left, and whether there are such rests. */
function shortenRests(steps, resting, motion, most) {
  const n = steps.length;
  const kept = new Uint8Array(n).fill(1);
  let shorter = false;
  for (let j = 0; j < n; j++) {
    const begin = j;
    let total = 0;
    for (; resting[j]; j++) total += steps[j];
    const first = begin === 0 ? PAUSE * motion : Math.min(PAUSE * motion, most);
    const limit = j === n - 1 ? LAST_REST * motion : first;
    if (!(total > EQUAL * limit && limit > 0)) continue;
    shorter = true;
    const share = limit / total;
    const count = j - begin;
    const left = Math.max(FEWEST, Math.ceil(share * count - WHOLE));
    for (let p = 0; p < count; p++) {
      steps[begin + p] *= share;
      kept[begin + p] = p === 0 || Math.floor((p * left) / count) !== Math.floor(((p - 1) * left) / count) ? 1 : 0;
    }
  }
  return { kept, shorter };
}

/** Whether the step after each of n samples belongs to a window of samples that stays within a radius of its first. */
function restingSteps(n, apart, radius) {
  let window = SHORTEST;
  while (2 * WINDOWS * window <= n) window *= 2;
  const resting = new Uint8Array(n);
  for (let begin = 0, until = 0; begin < n; begin++) {
    let still = begin + window <= n;
    for (let j = begin + window - 1; still && j > begin; j--) still = apart(begin, j) <= radius;
    if (still) until = begin + window - 1;
    resting[begin] = begin < until ? 1 : 0;
  }
  return resting;
}
