// Samples far from the path, as trackers write them that lose what they follow. The same as
// kineme.movements.preparation.glitches, whose numbers come with the snapshot.

/** The movement without its glitches; the same object if it has none. @param {GlitchRule} rule */
export function withoutGlitches(movement, rule) {
  const { positions: x, times, d } = movement;
  const n = times.length;
  const steps = Array.from({ length: n - 1 }, (_, j) => apart(x, j + 1, x, j, d));
  if (!(Math.max(...steps) * n > rule.mean_steps * steps.reduce((sum, step) => sum + step, 0))) return movement;
  const typical = median(steps.filter((step) => step > 0));
  const path = medians(x, n, d, rule.length);
  const moved = steps.map((_, j) => apart(path, j + 1, path, j, d));
  const reach = 2 * rule.length + 1;
  const glitches = Array.from({ length: n }, (_, j) => {
    const beside = Math.max(typical, ...moved.slice(Math.max(j - reach - 1, 0), j + reach));
    return apart(x, j, path, j, d) > rule.steps * beside;
  });
  const first = glitches.indexOf(false);
  if (first < 0) return movement;
  glitches.fill(false, 0, first).fill(false, glitches.lastIndexOf(false));
  for (let begin = 0; begin < n; begin++) {
    let end = begin;
    while (steps[end] === 0) end++;
    if (end > begin) fillHeld(x, path, glitches, begin, end, { steps, typical, d, rule });
    begin = end;
  }
  if (!glitches.includes(true)) return movement;
  return { times, positions: x.map((value, at) => (glitches[Math.floor(at / d)] ? path[at] : value)), d };
}

/** Put a line in place of equal samples begin to end, if they are far from those beside, and these near each other. */
function fillHeld(x, path, glitches, begin, end, { steps, typical, d, rule }) {
  if (begin === 0 || end === glitches.length - 1) return;
  const away = Math.min(steps[begin - 1], steps[end]);
  if (!(away > rule.steps * typical && apart(x, end + 1, x, begin - 1, d) < rule.return * away)) return;
  for (let j = begin; j <= end; j++) {
    const share = (j - begin + 1) / (end - begin + 2);
    glitches[j] = true;
    for (let k = 0; k < d; k++) {
      const before = x[(begin - 1) * d + k];
      path[j * d + k] = before + share * (x[(end + 1) * d + k] - before);
    }
  }
}

/** The median of each coordinate over a sample and so many on either side, mirrored at the ends. */
function medians(x, n, d, side) {
  return x.map((_, at) => {
    const [j, k] = [Math.floor(at / d), at % d];
    const near = Array.from({ length: 2 * side + 1 }, (_, i) => Math.abs(j - side + i));
    return median(near.map((i) => x[(i < n ? i : 2 * (n - 1) - i) * d + k]));
  });
}

function median(values) {
  const sorted = Float64Array.from(values).sort();
  const middle = (sorted.length - 1) / 2;
  return 0.5 * (sorted[Math.floor(middle)] + sorted[Math.ceil(middle)]);
}

/** The distance of a sample of one path from a sample of another one. */
function apart(a, i, b, j, d) {
  let total = 0;
  for (let k = 0; k < d; k++) total += (a[i * d + k] - b[j * d + k]) ** 2;
  return Math.sqrt(total);
}
