// One primitive, as kineme.studio.snapshot writes it: it moves without asking anyone.

import { unpack } from "./arrays.js";
import { primitiveOf, rollout } from "./rollout.js";

/**
 * A primitive whose movements end exactly at their goals, with the velocity that it has at the demonstrated one.
 * @param {string|Object} text a snapshot of one primitive
 */
export function openPrimitive(text) {
  const snapshot = unpack(text);
  const one = primitiveOf(snapshot, 0);
  const end = rollout(snapshot, one).velocities.at(-1);
  return {
    ...one,
    /** @param {import("./rollout.js").Wish} [asked] */
    rollout: (asked = {}) => {
      const { duration = one.duration } = asked;
      return rollout(snapshot, one, { ...asked, endVelocity: end.map((v) => (v * one.duration) / duration) });
    },
  };
}
