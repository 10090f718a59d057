// The websocket: samples out, states and changes in. It comes back by itself after the server was away.

const WAIT = [300, 600, 1200, 2500, 5000]; // between tries [ms]

/** One connection; each kind of message goes to the function of its name: state, answer, changed, error, here, away. */
export class Live {
  /** @param {Record<string, (value: any) => void>} hear */
  constructor(hear) {
    this.hear = hear;
    this.tries = 0;
    this.socket = null;
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/api/live`);
    this.socket.addEventListener("open", () => this.opened());
    this.socket.addEventListener("message", (event) => this.heard(event.data));
    this.socket.addEventListener("close", () => this.closed());
  }

  opened() {
    this.tries = 0;
    this.send({ watch: true });
    this.hear.here(true);
  }

  closed() {
    this.hear.away(true);
    setTimeout(() => this.open(), WAIT[Math.min(this.tries, WAIT.length - 1)]);
    this.tries += 1;
  }

  /** @param {string} text */
  heard(text) {
    const message = JSON.parse(text);
    for (const [kind, value] of Object.entries(message)) this.hear[kind]?.(value);
  }

  /** @param {any} message @returns {boolean} Whether it could be sent. */
  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}
