// Samples to the server, one message at a time: what comes meanwhile goes with the next one.

const PATIENCE = 1000; // how long an answer may take before the next message goes anyway [ms]

export class Sending {
  /** @param {(message: any) => boolean} send */
  constructor(send) {
    this.send = send;
    this.waiting = [];
    this.stale = false;
    this.open = false;
    this.finishes = 0;
    this.over = false;
    this.asked = false;
    this.sent = 0;
  }

  /** A new movement: states of the one before are no longer wanted. */
  reset() {
    this.waiting = [];
    this.stale = this.open;
    this.over = false;
    this.asked = false;
    this.send({ reset: true });
  }

  /** @param {number[][]} samples */
  push(samples) {
    this.waiting.push(...samples);
    this.go();
  }

  /** The movement is over. @returns {boolean} Whether the server hears it. */
  finish() {
    this.over = true;
    return this.go();
  }

  go() {
    if (this.open && performance.now() - this.sent < PATIENCE) return true;
    if (this.waiting.length) {
      if (!this.send({ samples: this.waiting })) return false;
      this.waiting = [];
      this.sent = performance.now();
      this.open = true;
      return true;
    }
    if (!this.over || this.asked) return true;
    this.asked = this.send({ finish: true });
    if (this.asked) this.finishes += 1;
    return this.asked;
  }

  /** An answer to a whole movement came. @returns {boolean} Whether it is about the movement of now. */
  answered() {
    this.finishes = Math.max(this.finishes - 1, 0);
    return this.asked && this.finishes === 0;
  }

  /** An answer to samples came. @returns {boolean} Whether it is about the movement of now. */
  heard() {
    const wanted = !this.stale;
    this.open = this.stale = false; // messages that waited together are answered together
    this.go();
    return wanted;
  }

  /** The connection is new: nothing is open. */
  renewed() {
    this.open = false;
    this.stale = false;
    this.finishes = 0;
  }
}
