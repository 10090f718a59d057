// Movements as they come: checked, smoothed, at even times, at even arc lengths. Paths are rows x, y, ... of n numbers.

const CLOSEST = 1e-5; // of a movement's mean step: closer stamps are moved apart before smoothing
const SHARE = 0.1; // of its usual step: closer samples are averaged before a spline goes through them
const QUANTILE = 0.75; // of the gaps: the usual step
const TIME_SHARE = 1e-3; // of the arc-length phase, which keeps it rising through pauses
const MIN_SAMPLES = 4;
const JUMP = 0.75; // of a period: a step at least this long is a wrap, and no motion
const LARGEST = 1e100; // position, and 1e50 s: squares of larger numbers may overflow

const number = (x) => (typeof x === "number" ? x : NaN);

/**
 * A movement, checked: positions are T samples of d numbers, or all of these in a row. Angles of the columns of a library
 * lose the jumps where they wrap. @returns {TimedPositions}
 */
export function movement(times, positions, d, columns = null) {
  /** @type {any[]} */
  const rows = Array.from(positions, (row) => (row?.length ? [...row] : row));
  const flat = Float64Array.from(rows.flat(), number);
  const t = Float64Array.from(times, number);
  if (t.length < MIN_SAMPLES) throw new Error(`expected at least ${MIN_SAMPLES} samples, got ${t.length}; draw longer`);
  const inRows = rows.length === flat.length || rows.every((row) => row?.length === d);
  if (!inRows || flat.length !== t.length * d) {
    const got = `${rows.length} of ${rows[0]?.length ?? 1}`;
    throw new Error(`expected ${t.length} samples of ${d} numbers, got ${got}; give one of each`);
  }
  if (!flat.every((x) => Math.abs(x) <= LARGEST) || !t.every((x) => Math.abs(x) <= Math.sqrt(LARGEST))) {
    throw new Error("expected finite positions up to 1e100 and times up to 1e50 s, got others; leave them out");
  }
  for (let k = 1; k < t.length; k++) {
    if (!(t[k] > t[k - 1])) throw new Error(`expected rising times, got ${t[k - 1]}, ${t[k]} at ${k}; sort them`);
  }
  columns?.forEach(({ period }, k) => {
    for (let j = k, turns = 0, last = flat[k]; period && j < flat.length; j += d) {
      const step = flat[j] - last;
      last = flat[j];
      turns += Math.sign(step) * Math.floor(Math.abs(step) / period + 1 - JUMP);
      flat[j] -= period * turns;
    }
  });
  return { times: t, positions: flat, d };
}

/** One dimension minus its first number. */
function column(movement, k) {
  const { positions, d } = movement;
  return Float64Array.from(movement.times, (_, j) => positions[j * d + k] - positions[k]);
}

/** Stamps of which consecutive ones are at least `CLOSEST` of the mean step apart. */
function spread(times) {
  const last = times.length - 1;
  const least = (CLOSEST * (times[last] - times[0])) / last;
  const moved = Float64Array.from(times);
  for (let j = 1, added = 0; j <= last; j++) {
    added += Math.max(least - (times[j] - times[j - 1]), 0);
    moved[j] += added;
  }
  return moved;
}

/**
 * The smoothing spline at n even times, minus the first recorded position: d rows of n numbers.
 * It minimizes `sum_j (x_j - g(u_j))^2 + lam * integral g''(u)^2 du` (Reinsch 1967), with the lam of `cutoff` cycles.
 * Without a cutoff it is an interpolating spline.
 */
export function evenPath(movement, cutoff, n) {
  if (cutoff === null) return splinePath(movement, n);
  const last = movement.times.length - 1;
  const scale = 1 / (Math.cbrt(last / (2 * Math.PI * cutoff) ** 4) * (movement.times[last] - movement.times[0]));
  const stamps = spread(movement.times);
  const v = stamps.map((t) => (t - stamps[0]) * scale);
  const rows = new Float64Array(movement.d * n);
  for (let k = 0; k < movement.d; k++) {
    const x = column(movement, k);
    if (x.some((value) => value !== 0)) rows.set(evaluate(v, x, smoothed(v, x), n), k * n);
  }
  return rows;
}

/**
 * Second derivatives of the smoothing spline with penalty 1; x becomes the smoothed values.
 * With Q the second divided differences and R the Gram matrix of hat functions, `(R + Q'Q) m = Q'x`, solved as L D L'.
 */
function smoothed(v, x) {
  const T = v.length;
  const p = new Float64Array(T - 1);
  const [m, D, a, b] = [0, 0, 0, 0].map(() => new Float64Array(T + 2));
  for (let j = 0; j < T - 1; j++) p[j] = 1 / (v[j + 1] - v[j]);
  for (let k = 1; k < T - 1; k++) {
    const own = (v[k + 1] - v[k - 1]) / 3 + p[k - 1] ** 2 + p[k] ** 2 + (p[k - 1] + p[k]) ** 2;
    const right = (x[k + 1] - x[k]) * p[k] - (x[k] - x[k - 1]) * p[k - 1];
    const e = k > 1 ? a[k - 1] : 0;
    const f = k > 2 ? b[k - 2] : 0;
    D[k] = own - (k > 1 ? D[k - 1] * e * e : 0) - (k > 2 ? D[k - 2] * f * f : 0);
    if (k < T - 2) {
      const beside = (v[k + 1] - v[k]) / 6 - p[k] * (p[k - 1] + 2 * p[k] + p[k + 1]);
      a[k] = (beside - (k > 1 ? D[k - 1] * e * b[k - 1] : 0)) / D[k];
    }
    if (k < T - 3) b[k] = (p[k] * p[k + 1]) / D[k];
    m[k] = right - e * (k > 1 ? m[k - 1] : 0) - f * (k > 2 ? m[k - 2] : 0);
  }
  for (let k = T - 2; k > 0; k--)
    m[k] = m[k] / D[k] - a[k] * (k < T - 2 ? m[k + 1] : 0) - b[k] * (k < T - 3 ? m[k + 2] : 0);
  for (let j = 0; j < T - 1; j++) {
    const bend = (m[j + 1] - m[j]) * p[j];
    x[j] -= bend;
    x[j + 1] += bend;
  }
  return m;
}

/** Cubics with values x and second derivatives m at the knots v, from 0, at n even places. */
function evaluate(v, x, m, n) {
  const samples = new Float64Array(n);
  const last = v.length - 1;
  for (let q = 0, j = 0; q < n; q++) {
    const at = (v[last] * q) / (n - 1);
    while (j < last - 1 && v[j + 1] <= at) j++;
    const gap = v[j + 1] - v[j];
    const s = (at - v[j]) / gap;
    const r = 1 - s;
    samples[q] = r * x[j] + s * x[j + 1] + ((gap * gap) / 6) * ((r * r - 1) * r * m[j] + (s * s - 1) * s * m[j + 1]);
  }
  return samples;
}

/** The not-a-knot cubic spline at n even times, minus the first position: d rows of n numbers. */
export function splinePath(movement, n) {
  const apart = separated(movement);
  const v = apart.times.map((t) => t - apart.times[0]);
  const rows = new Float64Array(movement.d * n);
  for (let k = 0; k < movement.d; k++) {
    const x = column(apart, k);
    rows.set(evaluate(v, x, bends(v, x), n), k * n);
  }
  return rows;
}

/** Second derivatives of the not-a-knot spline: the third derivative is continuous at the outer inner knots too. */
function bends(v, x) {
  const T = v.length;
  const h = Float64Array.from({ length: T - 1 }, (_, j) => v[j + 1] - v[j]);
  const slope = h.map((gap, j) => (x[j + 1] - x[j]) / gap);
  const m = new Float64Array(T);
  const above = new Float64Array(T);
  for (let j = 1; j < T - 1; j++) {
    let [left, own, right] = [h[j - 1], 2 * (h[j - 1] + h[j]), h[j]];
    if (j === 1) [left, own, right] = [0, own + h[0] + (h[0] * h[0]) / h[1], right - (h[0] * h[0]) / h[1]];
    if (j === T - 2) {
      const q = (h[j] * h[j]) / h[j - 1];
      [left, own, right] = [left - q, own + h[j] + q, 0];
    }
    const pivot = own - left * above[j - 1];
    above[j] = right / pivot;
    m[j] = (6 * (slope[j] - slope[j - 1]) - left * m[j - 1]) / pivot;
  }
  for (let j = T - 3; j > 0; j--) m[j] -= above[j] * m[j + 1];
  m[0] = m[1] + (h[0] / h[1]) * (m[1] - m[2]);
  m[T - 1] = m[T - 2] + (h[T - 2] / h[T - 3]) * (m[T - 2] - m[T - 3]);
  return m;
}

/** The movement with each group of close samples replaced by its mean; usually there is none. */
function separated(movement) {
  const { times, positions, d } = movement;
  const T = times.length;
  const gaps = Float64Array.from({ length: T - 1 }, (_, j) => times[j + 1] - times[j]);
  const ordered = gaps.slice().sort();
  if (!(ordered[0] < SHARE * ordered[T - 2])) return movement;
  const step = ordered[Math.floor(QUANTILE * (T - 1))];
  const merged = joined(times, gaps, step);
  if (T - merged.reduce((sum, on) => sum + on, 0) < MIN_SAMPLES) return movement;
  const heads = [];
  for (let j = 0; j < T; j++) if (!merged[j]) heads.push(j);
  const stamps = new Float64Array(heads.length);
  const means = new Float64Array(heads.length * d);
  heads.forEach((head, i) => {
    const end = i + 1 < heads.length ? heads[i + 1] : T;
    const fixed = i === 0 ? head : i === heads.length - 1 ? T - 1 : -1; // first and last samples are not moved
    for (let k = -1; k < d; k++) {
      const value = (j) => (k < 0 ? times[j] : positions[j * d + k]);
      let away = 0;
      for (let j = head; j < end; j++) away += value(j) - value(head);
      const mean = fixed < 0 ? value(head) + away / (end - head) : value(fixed);
      if (k < 0) stamps[i] = mean;
      else means[i * d + k] = mean;
    }
  });
  return { times: stamps, positions: means, d };
}

/** Tell whether each sample is in the group of the one before; a group longer than a step is a dense stretch. */
function joined(times, gaps, step) {
  const T = times.length;
  const merged = new Uint8Array(T);
  for (let j = 1; j < T; j++) merged[j] = gaps[j - 1] < SHARE * step ? 1 : 0;
  for (let head = 0, end = 1; head < T; head = end++) {
    while (end < T && merged[end]) end++;
    const dense = times[end - 1] - times[head] > step;
    const part = Array.from({ length: end - head }, (_, j) =>
      Math.floor((times[head + j] - times[head]) / (SHARE * step)),
    );
    for (let j = 1; j < end - head; j++) if (dense || part[j] !== part[j - 1]) merged[head + j] = 0;
  }
  return merged;
}

/** A phase of an even path, d rows of numbers, from 0 to 1: a share of it is that of arc length, the rest time. */
export function arcLengthPhase(path, d, share = 1) {
  const n = path.length / d;
  const phase = new Float64Array(n);
  for (let t = 1; t < n; t++) {
    let square = 0;
    for (let k = 0; k < d; k++) square += (path[k * n + t] - path[k * n + t - 1]) ** 2;
    phase[t] = phase[t - 1] + Math.sqrt(square);
  }
  const total = phase[n - 1];
  const a = total > 0 ? (1 - TIME_SHARE) * share : 0;
  for (let t = 0; t < n; t++) phase[t] = a * (total > 0 ? phase[t] / total : 0) + ((1 - a) * t) / (n - 1);
  return phase;
}
