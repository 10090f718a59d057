// The runtime: a snapshot of a library in, answers and movements out. Needs nothing but JavaScript.

import { unpack } from "./arrays.js";
import { follow } from "./early.js";
import { hypotheses } from "./hypotheses.js";
import { movement } from "./preparation.js";
import { knownClasses, recognize } from "./recognition.js";
import { encode, FORMULATIONS, inFormulation, primitiveOf, rollout } from "./rollout.js";

/** A library that recognizes and moves. The text is a snapshot, see kineme.studio.snapshot. */
export function open(text) {
  const snapshot = unpack(text);
  const { header } = snapshot;
  const read = (times, positions) => movement(times, positions, header.comparison.n_dims, header.columns);
  let recognizer = null;
  let begun = null;
  const all = () => (recognizer ??= knownClasses(snapshot));
  const beginnings = () => (begun ??= hypotheses(all()));
  return {
    header,
    classes: header.classes,
    formulations: header.movements.encodes ? Object.keys(FORMULATIONS) : [header.movements.formulation],
    /** The answer to a movement: times [s], positions of d numbers each. */
    recognize: (times, positions, errorRate) => recognize(all(), read(times, positions), errorRate),
    /** What recognizes. */
    recognizer: all,
    /** A function that is given all samples so far, again and again, and says what they begin to be. */
    follow: (options) => follow(beginnings(), options),
    /** Learn a movement. */
    encode: (times, positions) => encode(snapshot, read(times, positions)),
    /** The primitive of a class by its name, or one that was learned, in another formulation if one is named. */
    primitive: (what, formulation) =>
      typeof what === "string"
        ? primitiveOf(snapshot, header.classes.indexOf(what), formulation)
        : inFormulation(snapshot, what, formulation ?? what.formulation),
    /** The movement of a primitive to a new start and goal, through via points. */
    rollout: (primitive, wish) => rollout(snapshot, primitive, wish),
  };
}
