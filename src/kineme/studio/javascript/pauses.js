// Pauses within a movement, cut short: stamps far apart, and rests. The same as kineme.movements.preparation.pauses,
// whose numbers come with the snapshot.

/** The movement without its pauses; the same object if it has none. @param {PauseRule} rule */
export function withoutPauses(movement, rule) {
  let cut = movement;
  for (let round = 0; round < rule.rounds; round++) {
    const { steps, remaining, changes } = shortened(cut, rule);
    if (!changes) break;
    const elapsed = new Float64Array(steps.length);
    for (let j = 1; j < elapsed.length; j++) elapsed[j] = elapsed[j - 1] + steps[j - 1];
    const { positions, d } = cut;
    cut = {
      times: elapsed.filter((_, j) => remaining[j]),
      positions: positions.filter((_, at) => remaining[Math.floor(at / d)]),
      d,
    };
  }
  return cut;
}

/** The time that each step counts, 0 after the last sample; which samples are left; whether anything changes. */
function shortened({ times, positions, d }, rule) {
  const n = times.length;
  const apart = (i, j) => {
    let total = 0;
    for (let k = 0; k < d; k++) total += (positions[j * d + k] - positions[i * d + k]) ** 2;
    return Math.sqrt(total);
  };
  const steps = Float64Array.from(times, (t, j) => (j < n - 1 ? times[j + 1] - t : 0));
  const usual = rule.gap * steps.slice(0, n - 1).sort()[Math.floor((n - 1) / 2)];
  let reach = 0;
  for (let j = 1; j < n; j++) reach = Math.max(reach, apart(0, j));
  const resting = restingSteps(n, apart, reach, rule);
  let [motion, path] = [0, 0];
  for (let j = 0; j < n - 1; j++) {
    motion += resting[j] ? 0 : Math.min(steps[j], usual);
    path += resting[j] ? 0 : apart(j, j + 1);
  }
  const pace = path > 0 ? motion / path : 0; // seconds for a unit of length
  const longest = steps.map((_, j) => {
    const neighbor = Math.max(j > 0 ? steps[j - 1] : 0, j < n - 1 ? steps[j + 1] : 0);
    const length = j < n - 1 ? apart(j, j + 1) : 0;
    return Math.max(usual, Math.min(rule.gap * Math.max(neighbor, length * pace), rule.pause * motion));
  });
  const changes = steps.some((step, j) => step > rule.equal * longest[j]);
  const counted = steps.map((step, j) => Math.min(step, longest[j]));
  const { remaining, shorter } = shortenRests(counted, resting, motion, rule.rest * reach * pace, rule);
  return { steps: counted, remaining, changes: changes || shorter };
}

/** Shorten the steps of long rests; which samples are left, and whether there are such rests. */
function shortenRests(steps, resting, motion, most, rule) {
  const n = steps.length;
  const remaining = new Uint8Array(n).fill(1);
  let shorter = false;
  for (let j = 0; j < n; j++) {
    const begin = j;
    let total = 0;
    for (; resting[j]; j++) total += steps[j];
    const first = begin === 0 ? rule.pause * motion : Math.min(rule.pause * motion, most);
    const limit = j === n - 1 ? rule.last_rest * motion : first;
    if (!(total > rule.equal * limit && limit > 0)) continue;
    shorter = true;
    const share = limit / total;
    const count = j - begin;
    const left = Math.max(rule.fewest, Math.ceil(share * count - rule.same_count));
    for (let p = 0; p < count; p++) {
      steps[begin + p] *= share;
      remaining[begin + p] = p === 0 || Math.floor((p * left) / count) !== Math.floor(((p - 1) * left) / count) ? 1 : 0;
    }
  }
  return { remaining, shorter };
}

/** Whether the step after each of n samples belongs to a window of samples that stays within a radius of its first. */
function restingSteps(n, apart, reach, rule) {
  const radius = rule.radius * reach;
  let window = rule.shortest;
  while (2 * rule.windows * window <= n) window *= 2;
  const resting = new Uint8Array(n);
  for (let begin = 0, until = 0; begin < n; begin++) {
    let still = begin + window <= n;
    for (let j = begin + window - 1; still && j > begin; j--) still = apart(begin, j) <= radius;
    if (still) until = begin + window - 1;
    resting[begin] = begin < until ? 1 : 0;
  }
  return resting;
}
