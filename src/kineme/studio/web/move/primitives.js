// Primitives of the server, moved by the runtime that the page without a server has too: the path follows the hand.
import { post } from "../parts/api.js";
import { openPrimitive } from "../runtime/primitive.js";

const SAMPLES = 201; // as many as the server answers with

/** @type {Map<string, Promise<any>>} */
const primitives = new Map();

/** @param {any} what @param {string} formulation @returns {Promise<any>} */
async function ask(what, formulation) {
  const document = await post("/api/primitive", { what, formulation });
  return document && openPrimitive(document);
}

/**
 * @param {any} what
 * @param {string} formulation
 * @param {number} version Of the library.
 * @returns {Promise<any>} Null where only the server knows.
 */
export function primitiveOf(what, formulation, version) {
  const key = JSON.stringify([what, formulation, version]);
  if (!primitives.has(key)) {
    if (primitives.size > 60) primitives.clear();
    const failed = () => {
      primitives.delete(key); // next time it is asked again
      return null;
    };
    primitives.set(key, ask(what, formulation).catch(failed));
  }
  return /** @type {Promise<any>} */ (primitives.get(key));
}

/**
 * What the server would answer to the same question, but for its warnings.
 * @param {any} primitive @param {any} question @returns {any} Null where there is none, or the server has to say why.
 */
export function moved(primitive, { start, goal, duration, via, obstacles }) {
  if (!primitive || obstacles) return null;
  try {
    const { times, ...path } = primitive.rollout({ start, goal, duration, via, samples: SAMPLES });
    return { times: [...times], ...path, warnings: [] };
  } catch {
    return null;
  }
}
