// One primitive, as kineme.studio.snapshot writes it: it moves without asking anyone.

import { unpack } from "./arrays.js";
import { primitiveOf, rollout } from "./rollout.js";

/** A primitive whose movements end exactly at their goals, with the velocity that it has at the demonstrated one. */
export function openPrimitive(text) {
  const snapshot = unpack(text);
  const primitive = primitiveOf(snapshot, 0);
  const end = rollout(snapshot, primitive).velocities.at(-1);
  return {
    ...primitive,
    /** @param {Wish} wish */
    rollout: (wish = {}) => {
      const { duration = primitive.duration } = wish;
      return rollout(snapshot, primitive, {
        ...wish,
        endVelocity: end.map((v) => (v * primitive.duration) / duration),
      });
    },
  };
}
