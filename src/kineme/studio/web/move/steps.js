// What was changed in Move, to go back step by step: points, obstacles and the duration.

const KEPT = 200;

/** @param {import("./plan.js").Plan} plan */
const shape = ({ start, goal, via, obstacles, share }) => JSON.stringify({ start, goal, via, obstacles, share });

export class Steps {
  constructor() {
    /** @type {string[]} The plan after each change, the first one as it was shown. */
    this.plans = [];
  }

  /** @param {import("./plan.js").Plan} plan As it is now. */
  keep(plan) {
    const now = shape(plan);
    if (now !== this.plans[this.plans.length - 1]) this.plans.push(now);
    if (this.plans.length > KEPT) this.plans.shift();
  }

  /**
   * Make a plan what it was before the last change.
   * @param {import("./plan.js").Plan} plan
   * @returns {boolean} Whether there was one.
   */
  back(plan) {
    if (this.plans.length < 2) return false;
    this.plans.pop();
    Object.assign(plan, JSON.parse(this.plans[this.plans.length - 1]));
    return true;
  }
}
