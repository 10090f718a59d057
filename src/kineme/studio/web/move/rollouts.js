// The newest path of each formulation: at once by the runtime, with what is to be said of it from the server; never an
// old one after a new one.
import { post } from "../parts/api.js";
import { library } from "../parts/library_state.js";
import { server } from "../parts/server.js";
import { openPrimitive } from "../runtime/primitive.js";
import { question, what } from "./plan.js";

const SETTLED = 120; // how long nothing must change before the server is asked for what the page already drew [ms]

const SAMPLES = 201; // as many as the server answers with

const primitives = new Map();

/** The primitive, or a promise of it, in a version of the library; null where only the server knows. */
export function primitiveOf(what, formulation, version) {
  const key = JSON.stringify([what, formulation, version]);
  if (!primitives.has(key)) {
    if (primitives.size > 60) primitives.clear();
    const failed = () => {
      primitives.delete(key); // next time it is asked again
      return null;
    };
    const asked = post("/api/primitive", { what, formulation }).then((document) => document && openPrimitive(document));
    primitives.set(key, asked.catch(failed));
  }
  return primitives.get(key);
}

/** What the server would answer to the same question, but for its warnings; null where only it can say why. */
function moved(primitive, { obstacles, what, formulation, ...wish }) {
  if (!primitive || obstacles) return null;
  try {
    const { times, ...path } = primitive.rollout({ ...wish, samples: SAMPLES });
    return { times: [...times], ...path, warnings: [] };
  } catch {
    return null;
  }
}

export class Rollouts {
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

  async prepare(plan) {
    this.primitive = null;
    const key = JSON.stringify(what(plan));
    this.preparing = key;
    const primitive = await primitiveOf(what(plan), this.formulation, library().version);
    if (this.preparing === key) this.primitive = primitive;
  }

  /** Show how the newest plan moves. */
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
      const answer = await server.generate(wanted).catch((error) => ({ error }));
      if (movement !== this.movement) continue;
      this.problem = answer.error?.message ?? "";
      if (!answer.error && (!this.wanted || !this.primitive || wanted.obstacles)) this.path = answer;
      this.changed();
    }
    this.asking = false;
  }
}
