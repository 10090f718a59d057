// Pauses within a movement, cut short: stamps far apart, and rests. The same as kineme.movements.preparation.pauses.

const GAP = 3; // median steps: longer ones are gaps
const PAUSE = 0.1; // of the time in motion: a gap or a rest counts at most as much
const LAST_REST = 0.25; // the same of a rest at the end
const RADIUS = 0.015; // of the reach from the first sample: so near to where a window begins a rest stays
const [SHORTEST, WINDOWS] = [4, 32]; // samples of a window, at least; windows in a movement
const FEWEST = 3; // steps that a rest is left, at least
const ROUNDS = 3;
const [EQUAL, WHOLE] = [1 + 1e-9, 1e-6]; // differences that are rounding

/**
 * The movement without its pauses; the same object if it has none.
 * @param {import("./preparation.js").Movement} one
 * @returns {import("./preparation.js").Movement}
 */
export function withoutPauses(one) {
  let cut = one;
  for (let round = 0; round < ROUNDS; round++) {
    const { steps, capped } = countedSteps(cut.times);
    const { kept, shortened } = shortenRests(cut, steps);
    if (!capped && !shortened) break;
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

/** The time that each step counts, 0 after the last sample; whether any counts less than it took. */
function countedSteps(times) {
  const last = times.length - 1;
  const steps = Float64Array.from(times, (t, j) => (j < last ? times[j + 1] - t : 0));
  const usual = GAP * steps.slice(0, last).sort()[Math.floor(last / 2)];
  const longest = Math.max(usual, PAUSE * steps.reduce((sum, step) => sum + Math.min(step, usual), 0));
  const capped = steps.some((step) => step > longest);
  return { steps: steps.map((step) => Math.min(step, longest)), capped };
}

/** Shorten the steps of long rests; which samples are left, and whether there are such rests. */
function shortenRests(one, steps) {
  const n = steps.length;
  const resting = restingSteps(one);
  const kept = new Uint8Array(n).fill(1);
  const most = PAUSE * steps.reduce((sum, step, j) => (resting[j] ? sum : sum + step), 0);
  let shortened = false;
  for (let j = 0; j < n; j++) {
    const begin = j;
    let total = 0;
    for (; resting[j]; j++) total += steps[j];
    const limit = j === n - 1 ? most * (LAST_REST / PAUSE) : most;
    if (!(total > EQUAL * limit && limit > 0)) continue;
    shortened = true;
    const share = limit / total;
    const count = j - begin;
    const left = Math.max(FEWEST, Math.ceil(share * count - WHOLE));
    for (let p = 0; p < count; p++) {
      steps[begin + p] *= share;
      kept[begin + p] = p === 0 || Math.floor((p * left) / count) !== Math.floor(((p - 1) * left) / count) ? 1 : 0;
    }
  }
  return { kept, shortened };
}

/** Whether the step after each sample belongs to a window of samples that stays in its place. */
function restingSteps({ times, positions, d }) {
  const n = times.length;
  let [window, size] = [SHORTEST, 0];
  while (2 * WINDOWS * window <= n) window *= 2;
  const apart = (i, j) => {
    let total = 0;
    for (let k = 0; k < d; k++) total += (positions[j * d + k] - positions[i * d + k]) ** 2;
    return total;
  };
  for (let j = 1; j < n; j++) size = Math.max(size, apart(0, j));
  const resting = new Uint8Array(n);
  for (let begin = 0, until = 0; begin < n; begin++) {
    let still = begin + window <= n;
    for (let j = begin + window - 1; still && j > begin; j--) still = apart(begin, j) <= RADIUS * RADIUS * size;
    if (still) until = begin + window - 1;
    resting[begin] = begin < until ? 1 : 0;
  }
  return resting;
}
