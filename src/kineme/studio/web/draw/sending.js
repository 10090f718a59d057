// Samples to the server, one message at a time: what comes meanwhile goes with the next one.

const PATIENCE = 1000; // how long an answer may take before the next message goes anyway [ms]
const MOST = 5000; // samples in one message; the server takes twice as many

export class Sending {
  /** @param {(message: any) => boolean} send */
  constructor(send) {
    this.send = send;
    /** @type {number[][]} The movement that has no answer yet: a connection that comes back knows nothing of it. */
    this.movement = [];
    this.told = 0; // samples of it that were sent
    this.stale = false;
    this.open = false;
    this.finishes = 0;
    this.over = false;
    this.asked = false;
    this.sent = 0;
  }

  /** A new movement: states of the one before are no longer wanted. */
  reset() {
    this.forget();
    this.stale = this.open;
    this.send({ reset: true });
  }

  /** @param {number[][]} samples */
  push(samples) {
    this.movement.push(...samples);
    this.go();
  }

  /** The movement is over. @returns {boolean} Whether the server hears it. */
  finish() {
    this.over = true;
    return this.go();
  }

  go() {
    if (this.open && performance.now() - this.sent < PATIENCE) return true;
    const waiting = this.movement.slice(this.told, this.told + MOST);
    if (waiting.length) {
      if (!this.send({ samples: waiting })) return false;
      this.told += waiting.length;
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
    const wanted = this.asked && this.finishes === 0;
    if (wanted) this.forget();
    return wanted;
  }

  /** An answer to samples came. @returns {boolean} Whether it is about the movement of now. */
  heard() {
    const wanted = !this.stale;
    this.open = this.stale = false; // messages that waited together are answered together
    this.go();
    return wanted;
  }

  /** The movement is answered, or not wanted any more. */
  forget() {
    this.movement = [];
    this.told = 0;
    this.over = this.asked = false;
  }

  /** The connection is gone: no answer comes to what was sent. */
  lost() {
    this.open = false;
  }

  /** The connection is new: nothing is open, and the movement is sent from its beginning. */
  renewed() {
    this.open = this.stale = this.asked = false;
    this.finishes = 0;
    this.told = 0;
    this.go();
  }
}
