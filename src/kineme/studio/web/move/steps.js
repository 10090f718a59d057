// What was changed in Move, to go back and forth step by step: points, obstacles and the duration.

const KEPT = 200;

/** @param {import("./plan.js").Plan} plan */
const shape = ({ start, goal, via, obstacles, share }) => JSON.stringify({ start, goal, via, obstacles, share });

export class Steps {
  constructor() {
    /** @type {string[]} The plan after each change, the first one as it was shown. */
    this.plans = [];
    this.at = -1; // the plan that is shown
  }

  /** @param {import("./plan.js").Plan} plan As it is now. */
  keep(plan) {
    const now = shape(plan);
    if (now === this.plans[this.at]) return;
    this.plans.splice(this.at + 1, Infinity, now);
    if (this.plans.length > KEPT) this.plans.shift();
    this.at = this.plans.length - 1;
  }

  /** @param {number} by -1 goes back, 1 forth. @returns {boolean} Whether there is a plan. */
  has(by) {
    return this.at + by in this.plans;
  }

  /** Make a plan what it was before the last change, or after the next one. @param {any} plan @param {number} by */
  go(plan, by) {
    this.at += by;
    Object.assign(plan, JSON.parse(this.plans[this.at]));
  }
}
