// A snapshot of a library: JSON with one block of numbers in base64, as kineme.studio.snapshot writes it.

const KINDS = { float64: Float64Array, float32: Float32Array, int32: Int32Array };
const FORMAT = "kineme-snapshot";
const VERSION = 6;
const SMALLEST = 2.2250738585072014e-308; // number whose logarithm is taken

/** The arrays of a snapshot, in JSON or parsed; they share one block of memory. @returns {Snapshot} */
export function unpack(text) {
  const given = typeof text === "string" ? JSON.parse(text) : text;
  if (given.format !== FORMAT || given.version !== VERSION) {
    throw new Error(`expected a snapshot of version ${VERSION}, got ${given.format} ${given.version}; make it again`);
  }
  const characters = atob(given.data);
  const bytes = new Uint8Array(characters.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = characters.charCodeAt(k);
  const arrays = {};
  for (const [name, [kind, offset, length]] of Object.entries(given.arrays)) {
    arrays[name] = new KINDS[kind](bytes.buffer, offset, length);
  }
  const { data: _data, arrays: _arrays, ...header } = given;
  return { header, arrays };
}

/** Sum of products of two rows of n numbers that begin at i and j. */
export function product(a, i, b, j, n) {
  let total = 0;
  for (let k = 0; k < n; k++) total += a[i + k] * b[j + k];
  return total;
}

/**
 * Inner products of three rows of n numbers with three others, from i and j on, each `step` after the one before, are
 * written from `at` on, N numbers for a row. Each number is read once for three of them, and the nine sums do not wait
 * for each other, so that this takes a third of the time of `product`.
 */
export function ninefold(a, i, b, j, step, n, into, at, N) {
  let xu = 0;
  let xv = 0;
  let xw = 0;
  let yu = 0;
  let yv = 0;
  let yw = 0;
  let zu = 0;
  let zv = 0;
  let zw = 0;
  for (let t = 0; t < n; t++) {
    const x = a[i + t];
    const y = a[i + step + t];
    const z = a[i + 2 * step + t];
    const u = b[j + t];
    const v = b[j + step + t];
    const w = b[j + 2 * step + t];
    xu += x * u;
    xv += x * v;
    xw += x * w;
    yu += y * u;
    yv += y * v;
    yw += y * w;
    zu += z * u;
    zv += z * v;
    zw += z * w;
  }
  into[at] = xu;
  into[at + 1] = xv;
  into[at + 2] = xw;
  into[at + N] = yu;
  into[at + N + 1] = yv;
  into[at + N + 2] = yw;
  into[at + 2 * N] = zu;
  into[at + 2 * N + 1] = zv;
  into[at + 2 * N + 2] = zw;
}

/** Linear interpolation at rising targets of a function with values y at rising x; constant beyond its ends. */
export function interpolate(targets, x, y) {
  const interpolated = new Float64Array(targets.length);
  const last = x.length - 1;
  for (let p = 0, j = 0; p < targets.length; p++) {
    const t = targets[p];
    while (j < last - 1 && x[j + 1] <= t) j++;
    if (t >= x[last]) interpolated[p] = y[last];
    else if (t <= x[0]) interpolated[p] = y[0];
    else interpolated[p] = y[j] + ((y[j + 1] - y[j]) * (t - x[j])) / (x[j + 1] - x[j]);
  }
  return interpolated;
}

/** Numbers from a to b at n even steps. */
export function linspace(a, b, n) {
  return Float64Array.from({ length: n }, (_, k) => (k === n - 1 ? b : a + ((b - a) * k) / (n - 1)));
}

/** Index of the largest number; of several the first. */
export function argmax(values) {
  let best = 0;
  for (let k = 1; k < values.length; k++) if (values[k] > values[best]) best = k;
  return best;
}

/** Indices of the numbers, largest first; of equal ones the first. */
export function descending(values) {
  return Array.from(values, (_, k) => k).sort((i, j) => (values[j] === values[i] ? i - j : values[j] - values[i]));
}

/** Logarithm of a number that is not negative; finite for 0. */
export const finiteLog = (value) => Math.log(Math.max(value, SMALLEST));

/** log(sum(exp(values))), without overflow. */
export function logSumExp(values) {
  const top = values[argmax(values)];
  if (!Number.isFinite(top)) return top;
  let sum = 0;
  for (let k = 0; k < values.length; k++) sum += Math.exp(values[k] - top);
  return Math.log(sum) + top;
}

/** Shares of numbers given by their logarithms: none negative, their sum 1. */
export function softmax(logs) {
  const top = logSumExp(logs);
  return Float64Array.from(logs, (log) => Math.exp(log - top));
}
