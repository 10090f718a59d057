// The websocket: samples out, states and changes in. It comes back by itself after the server was away.

const WAIT = [300, 600, 1200, 2500, 5000]; // between tries [ms]

/** One connection; each kind of message goes to the function of its name: state, answer, changed, error, here, away. */
export class Live {
  /** @param {Record<string, (value?: any) => void>} hear */
  constructor(hear) {
    this.hear = hear;
    this.tries = 0;
    this.socket = null;
    this.open();
  }

  open() {
    this.socket = new WebSocket(`${location.origin.replace("http", "ws")}/api/live`);
    this.socket.onopen = () => {
      this.tries = 0;
      this.send({ watch: true });
      this.hear.here();
    };
    this.socket.onmessage = ({ data }) => {
      for (const [kind, value] of Object.entries(JSON.parse(data))) this.hear[kind]?.(value);
    };
    this.socket.onclose = () => {
      this.hear.away();
      setTimeout(() => this.open(), WAIT[Math.min(this.tries, WAIT.length - 1)]);
      this.tries += 1;
    };
  }

  /** @returns Whether it could be sent. */
  send(message) {
    if (this.socket.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}
