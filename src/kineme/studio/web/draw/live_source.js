// How another program sends samples, to copy.
import { fill, make } from "../parts/elements.js";

const PYTHON = (/** @type {string} */ host) => `import asyncio, json, time, websockets

async def main(token, samples):
    header = {"Authorization": f"Bearer {token}"}
    async with websockets.connect("ws://${host}/api/live", additional_headers=header) as live:
        for x in samples:  # positions, two or three numbers each, as they come
            await live.send(json.dumps({"samples": [[time.monotonic(), *x]]}))
            print(json.loads(await live.recv()))
        await live.send(json.dumps({"finish": True}))
        print(json.loads(await live.recv()))`;

const JAVASCRIPT = (/** @type {string} */ host) => `const live = new WebSocket("ws://${host}/api/live");
live.onmessage = (event) => console.log(JSON.parse(event.data));
live.onopen = () => {
  hand.on("moved", ([x, y, z]) =>
    live.send(JSON.stringify({ samples: [[performance.now() / 1000, x, y, z]] })));
};`;

/** @param {Element} element */
export function describeLiveSource(element) {
  const code = (/** @type {string} */ text) => make("pre", { tabindex: "0" }, make("code", {}, text));
  fill(
    element,
    make("p", { class: "small soft" }, "Any program can send a movement while it happens, such as a hand tracker; each message is answered with what it is so far. The token is in the address that kineme studio prints. In Python:"),
    code(PYTHON(location.host)),
    make("p", { class: "small soft" }, "In a page of this server:"),
    code(JAVASCRIPT(location.host)),
  );
}
