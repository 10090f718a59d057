// The newest path of each formulation: at once from its operators, exactly from the server; never an old one after a new one.
import { post } from "../parts/api.js";
import { library } from "../parts/library_state.js";
import { evaluate, operatorsOf } from "./operators.js";
import { isPlain, question, what } from "./plan.js";

const SETTLED = 120; // how long nothing must change before the server is asked for what the page already drew [ms]

export class Rollouts {
  /** @param {(path: any) => void} changed */
  constructor(formulation, changed) {
    this.formulation = formulation;
    this.changed = changed;
    this.path = null;
    this.problem = "";
    this.asking = false;
    this.wanted = null;
    this.operators = null;
    this.timer = 0;
    this.preparing = "";
  }

  /** @param {any} plan */
  async prepare(plan) {
    this.operators = null;
    const key = (this.preparing = JSON.stringify(what(plan)));
    const operators = await operatorsOf(what(plan), this.formulation, library().version);
    if (this.preparing === key) this.operators = operators;
  }

  /** @param {any} plan The newest. */
  follow(plan) {
    this.wanted = question(plan, this.formulation);
    clearTimeout(this.timer);
    if (!this.operators || !isPlain(plan)) return this.ask();
    this.path = evaluate(this.operators, plan.start, plan.goal, plan.share * (plan.usual / lastOf(this.operators.times)));
    this.changed(this.path);
    this.timer = setTimeout(() => this.ask(), SETTLED);
  }

  async ask() {
    if (this.asking) return;
    this.asking = true;
    while (this.wanted) {
      const asked = this.wanted;
      this.wanted = null;
      try {
        const path = await post("/api/rollout", asked);
        this.problem = "";
        if (!this.wanted || !this.operators || asked.via || asked.obstacles) this.path = path;
      } catch (error) {
        this.problem = error.message;
      }
      this.changed(this.path);
    }
    this.asking = false;
  }
}

const lastOf = (/** @type {number[]} */ times) => times[times.length - 1] || 1;
