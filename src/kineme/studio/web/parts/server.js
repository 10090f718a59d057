// The library of a server, in five functions; the page without a server has the same of a snapshot.
import { post } from "./api.js";
import { library } from "./library_state.js";
import { Sending } from "./sending.js";

/**
 * @typedef {{times: number[], positions: number[][]}} Movement
 *
 * @typedef {Object} Following a movement under way; its states come where they are heard
 * @property {() => void} reset A new movement begins.
 * @property {(samples: number[][]) => void} push Each a time and coordinates.
 * @property {() => boolean} finish The movement is over. Tells whether its answer comes by itself.
 *
 * @typedef {Object} Backend
 * @property {() => {id: string, name: string, path: number[][]|null}[]} symbols
 * @property {(movement: Movement) => any} recognize An answer, or a promise of it.
 * @property {(movement: Movement, answer: any) => any} explain Its explanation, or a promise of it.
 * @property {(hear: (message: any) => any) => Following} follow
 * @property {(question: any) => any} generate A new movement, or a promise of it.
 */

/** @satisfies {Backend} */
export const server = {
  symbols: () => library().symbols,
  recognize: (movement) => post("/api/recognize", movement),
  explain: (movement) => post("/api/why", movement),
  follow: (/** @type {(message: any) => boolean} */ send) => new Sending(send),
  generate: (question) => post("/api/rollout", question),
};
