// Samples to the server, one message at a time: what comes meanwhile goes with the next one.

const PATIENCE = 1000; // how long an answer may take before the next message goes anyway [ms]
const MOST = 5000; // samples in one message; the server takes twice as many

export class Sending {
  /** @param {(message: Object) => boolean} send */
  constructor(send) {
    this.send = send;
    /** The movement that has no answer yet: a connection that comes back knows nothing of it. */
    this.movement = [];
    this.sent = 0; // samples of it
    this.sentAt = 0;
    this.open = false; // no answer came to what was sent
    this.stale = false; // what is answered next is about the movement before
    this.ended = false;
    this.finishing = false; // the server knows that the movement has ended
    this.finishes = 0; // answers that are to come, to this movement and to those before
  }

  /** A new movement: states of the one before are no longer wanted. */
  reset() {
    this.forget();
    this.stale = this.open;
    this.send({ reset: true });
  }

  push(samples) {
    this.movement.push(...samples);
    this.go();
  }

  /** The movement is over. @returns Whether the server hears it. */
  finish() {
    this.ended = true;
    return this.go();
  }

  go() {
    if (this.open && performance.now() - this.sentAt < PATIENCE) return true;
    const samples = this.movement.slice(this.sent, this.sent + MOST);
    if (samples.length) {
      if (!this.send({ samples })) return false;
      this.sent += samples.length;
      this.sentAt = performance.now();
      this.open = true;
      return true;
    }
    if (!this.ended || this.finishing) return true;
    this.finishing = this.send({ finish: true });
    if (this.finishing) this.finishes += 1;
    return this.finishing;
  }

  /** An answer to a movement that has ended came. @returns Whether it is about the movement of now. */
  answered() {
    this.finishes = Math.max(this.finishes - 1, 0);
    const wanted = this.finishing && this.finishes === 0;
    if (wanted) this.forget();
    return wanted;
  }

  /** An answer to samples came. @returns Whether it is about the movement of now. */
  heard() {
    const wanted = !this.stale;
    this.open = this.stale = false; // messages that waited together are answered together
    this.go();
    return wanted;
  }

  /** The movement is answered, or not wanted any more. */
  forget() {
    this.movement = [];
    this.sent = 0;
    this.ended = this.finishing = false;
  }

  /** The connection is gone: no answer comes to what was sent. */
  lost() {
    this.open = false;
  }

  /** The connection is new: nothing is open, and the movement is sent from its beginning. */
  renewed() {
    this.open = this.stale = this.finishing = false;
    this.finishes = 0;
    this.sent = 0;
    this.go();
  }
}
