// Why a movement got its answer: it over its nearest example and over the runner-up, as `Explanation.to_dict` has it.
// Paths are those that are compared: centered, of one size, and smoothed more than in Python.

import { argmax } from "../javascript/arrays.js";
import { describeMovement } from "../javascript/description.js";
import { movement } from "../javascript/preparation.js";
import { compare } from "../javascript/recognition.js";
import { bestRotation } from "../javascript/rotation.js";

const NEAR = 0.5; // of the largest difference: the part around it that is named

/** The angle of a rotation (d, d). */
function angleOf(R, d) {
  if (d === 2) return Math.atan2(R[2], R[0]);
  return d === 3 ? Math.atan2(Math.hypot(R[7] - R[5], R[2] - R[6], R[3] - R[1]), R[0] + R[4] + R[8] - 1) : 0;
}

/** Null where positions are not compared. */
export function explain(recognizer, { times, positions }, answer) {
  const { header, arrays, stored } = recognizer;
  const { comparison: how, classes, first } = header;
  const r = how.by_rows.findIndex((row) => row.quantity === "positions" && row.arc_share === 1);
  if (r < 0) return null;
  const d = how.n_dims;
  const described = describeMovement(movement(times, positions, d), how, arrays);
  const { average } = compare(recognizer, described);
  const ours = described.rows[r];
  const n = ours.length / d;
  const axes = [...Array(d).keys()];
  const points = (value) => Array.from({ length: n }, (_, t) => axes.map((k) => value(k, t)));
  const path = points((k, t) => ours[k * n + t]);
  const mean = (value) => path.reduce((sum, x) => sum + value(x) / n, 0);
  const size = Math.sqrt(axes.reduce((sum, k) => sum + mean((x) => x[k] ** 2) - mean((x) => x[k]) ** 2, 0)) || 1;
  const overlay = (label) => {
    const [from, to = stored.m] = first.slice(classes.indexOf(label));
    const row = from + argmax(average.subarray(from, to));
    const theirs = stored.rows[r].subarray(row * d * n, (row + 1) * d * n);
    const R = bestRotation(how.rule, ours, theirs);
    const laid = points((k, t) => axes.reduce((sum, h) => sum + R[k * d + h] * theirs[h * n + t], 0));
    const differences = laid.map((x, t) => Math.hypot(...axes.map((k) => x[k] - path[t][k])) / size);
    const most = argmax(differences);
    const edge = (step) => {
      let at = most;
      while (differences[at + step] >= NEAR * differences[most]) at += step;
      return at / (n - 1);
    };
    return {
      label,
      similarity: Math.exp(average[row]),
      largest_difference: differences[most],
      from: edge(-1),
      to: edge(1),
      turned: (180 / Math.PI) * angleOf(R, d),
      differences,
      path: laid,
    };
  };
  const names = answer.ranked.map(({ label }) => label);
  const shown = answer.label ?? names[0];
  const other = names.find((label) => label !== shown);
  return { path, nearest: overlay(shown), runner_up: other === undefined ? null : overlay(other) };
}
