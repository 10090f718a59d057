// Why a movement got its answer: it over its nearest example and over the runner-up, as in `Explanation.to_dict`.

import { argmax } from "./arrays.js";
import { describeMovement } from "./description.js";
import { compare } from "./recognition.js";
import { bestRotation } from "./rotation.js";

const NEAR = 0.5; // of the largest difference: the part around it that is named

/**
 * Paths are those that are compared: centered and of one size as far as the library allows, smoothed more than in Python.
 * Null where positions are not compared.
 * @param {import("./recognition.js").Recognizer} recognizer
 * @param {import("./preparation.js").Movement} movement
 * @param {import("./recognition.js").Answer} answer
 */
export function explain(recognizer, movement, answer) {
  const { header, arrays, stored } = recognizer;
  const { comparison: how, classes, first } = header;
  const { n_dims: d } = how;
  const r = how.by_rows.findIndex((row) => row.quantity === "positions" && row.arc_share === 1);
  if (r < 0) return null;
  const described = describeMovement(movement, how, arrays);
  const { average } = compare(recognizer, described);
  const ours = described.rows[r];
  const n = ours.length / d;
  const points = (value) => Array.from({ length: n }, (_, t) => Array.from({ length: d }, (_, k) => value(k, t)));
  const path = points((k, t) => ours[k * n + t]);
  const means = path[0].map((_, k) => path.reduce((sum, x) => sum + x[k] / n, 0));
  const size = Math.sqrt(path.reduce((sum, x) => sum + Math.hypot(...x.map((v, k) => v - means[k])) ** 2 / n, 0)) || 1;
  const overlay = ({ label }) => {
    const begin = first[classes.indexOf(label)];
    const row = begin + argmax(average.subarray(begin, first[classes.indexOf(label) + 1] ?? stored.m));
    const theirs = stored.rows[r].subarray(row * d * n, (row + 1) * d * n);
    const R = bestRotation(how.rule, ours, theirs);
    const laid = points((k, t) => path[0].reduce((sum, _, h) => sum + R[k * d + h] * theirs[h * n + t], 0));
    const differences = laid.map((x, t) => Math.hypot(...x.map((value, k) => value - path[t][k])) / size);
    const most = argmax(differences);
    const near = (/** @type {number} */ step) => {
      let at = most;
      while (differences[at + step] >= NEAR * differences[most]) at += step;
      return at / (n - 1);
    };
    return {
      label,
      similarity: Math.exp(average[row]),
      largest_difference: differences[most],
      from: near(-1),
      to: near(1),
      differences,
      path: laid,
    };
  };
  const shown = answer.ranked.find(({ label }) => label === answer.label) ?? answer.ranked[0];
  const other = answer.ranked.find(({ label }) => label !== shown.label);
  return { path, nearest: overlay(shown), runner_up: other ? overlay(other) : null };
}
