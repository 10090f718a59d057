// How another program sends samples, to copy.
import { fill, make } from "../parts/elements.js";

const PYTHON = (/** @type {string} */ host) => `import json, math, os, time
from websockets.sync.client import connect

header = {"Authorization": "Bearer " + os.environ["KINEME_STUDIO_TOKEN"]}
with connect("ws://${host}/api/live", additional_headers=header) as live:
    live.send(json.dumps({"name": "hand tracker"}))
    for k in range(100):  # instead of the circle your samples, as they come: seconds, then coordinates
        live.send(json.dumps({"samples": [[time.monotonic(), math.cos(k / 20), math.sin(k / 20)]]}))
        print(json.loads(live.recv()))
    live.send(json.dumps({"finish": True}))
    print(json.loads(live.recv()))`;

const JAVASCRIPT = (
  /** @type {string} */ host,
) => `const live = new WebSocket(\`ws://${host}/api/live?token=\${process.env.KINEME_STUDIO_TOKEN}\`);
const send = (message) => live.send(JSON.stringify(message));
live.onmessage = ({ data }) => (console.log(data), "answer" in JSON.parse(data) && live.close());
live.onopen = async () => {
  send({ name: "hand tracker" });
  for (let k = 0; k < 100; k += 1) { // instead of the circle your samples, as they come
    send({ samples: [[performance.now() / 1000, Math.cos(k / 20), Math.sin(k / 20)]] });
    await new Promise((done) => setTimeout(done, 10));
  }
  send({ finish: true });
};`;

/** @param {Element} element */
export function describeLiveSource(element) {
  const code = (/** @type {string} */ text) => make("pre", { tabindex: "0" }, make("code", {}, text));
  fill(
    element,
    make(
      "p",
      { class: "small soft" },
      "Any program can send a movement while it happens, such as a hand tracker. It is shown here, and each message " +
        "is answered with what it is so far. The token is in the address that kineme studio prints; " +
        "KINEME_STUDIO_TOKEN keeps one. In Python:",
    ),
    code(PYTHON(location.host)),
    make("p", { class: "small soft" }, "In JavaScript, with node 22 or later:"),
    code(JAVASCRIPT(location.host)),
  );
}
