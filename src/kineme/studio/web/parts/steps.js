// What was changed, to go back and forth step by step.

const MOST = 200;

export class Steps {
  constructor() {
    this.states = []; // after each change, in JSON, the first one as it was shown
    this.at = -1; // the one that is shown
  }

  /** Keep what is shown now. */
  keep(state) {
    const now = JSON.stringify(state);
    if (now === this.states[this.at]) return;
    this.states.splice(this.at + 1, Infinity, now);
    if (this.states.length > MOST) this.states.shift();
    this.at = this.states.length - 1;
  }

  /** Whether there is a state so many steps back, below 0, or forth. */
  has(by) {
    return this.at + by in this.states;
  }

  /** Go there. @returns The state. */
  go(by) {
    this.at += by;
    return JSON.parse(this.states[this.at]);
  }
}
