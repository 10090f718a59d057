// The newest path of each formulation: at once by the runtime, with what is to be said of it from the server; never an
// old one after a new one.
import { post } from "../parts/api.js";
import { library } from "../parts/library_state.js";
import { server } from "../parts/server.js";
import { openPrimitive } from "../runtime/primitive.js";
import { question, what } from "./plan.js";

const SETTLED = 120; // how long nothing must change before the server is asked for what the page already drew [ms]

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
function moved(primitive, { start, goal, duration, via, obstacles }) {
  if (!primitive || obstacles) return null;
  try {
    const { times, ...path } = primitive.rollout({ start, goal, duration, via, samples: SAMPLES });
    return { times: [...times], ...path, warnings: [] };
  } catch {
    return null;
  }
}

/** @param {any} question @returns {Promise<{path: any, problem: string}>} */
async function answerTo(question) {
  try {
    return { path: await server.generate(question), problem: "" };
  } catch (error) {
    return { path: null, problem: error.message };
  }
}

export class Rollouts {
  /** @param {string} formulation @param {() => void} changed */
  constructor(formulation, changed) {
    this.formulation = formulation;
    this.changed = changed;
    this.path = null;
    this.problem = "";
    this.asking = false;
    this.wanted = null;
    this.primitive = null;
    this.timer = 0;
    this.preparing = "";
    this.movement = 0; // answers about the movements before are not wanted
  }

  /** Another movement begins. */
  reset() {
    clearTimeout(this.timer);
    this.movement += 1;
    Object.assign(this, { path: null, problem: "", wanted: null, primitive: null, preparing: "" });
  }

  /** @param {any} plan */
  async prepare(plan) {
    this.primitive = null;
    const key = JSON.stringify(what(plan));
    this.preparing = key;
    const primitive = await primitiveOf(what(plan), this.formulation, library().version);
    if (this.preparing === key) this.primitive = primitive;
  }

  /** @param {any} plan The newest. */
  follow(plan) {
    this.wanted = question(plan, this.formulation);
    clearTimeout(this.timer);
    const path = moved(this.primitive, this.wanted);
    if (!path) return this.ask();
    this.path = path;
    this.changed();
    this.timer = setTimeout(() => this.ask(), SETTLED);
  }

  async ask() {
    if (this.asking) return;
    this.asking = true;
    while (this.wanted) {
      const [wanted, movement] = [this.wanted, this.movement];
      this.wanted = null;
      const { path, problem } = await answerTo(wanted);
      if (movement !== this.movement) continue;
      this.problem = problem;
      if (path && (!this.wanted || !this.primitive || wanted.obstacles)) this.path = path;
      this.changed();
    }
    this.asking = false;
  }
}
