// The library of a snapshot, in the five functions that the studio has of its server; see ../web/parts/server.js.

import { open } from "../javascript/runtime.js";
import { explain } from "./explanation.js";

/** @returns {OpenedSnapshot} */
export function openSnapshot(text) {
  const runtime = open(text);
  const prototype = (name) => runtime.rollout(runtime.primitive(name)).positions;
  const symbols = runtime.classes.map((name) => ({ id: name, name, path: prototype(name) }));
  return {
    runtime,
    symbols: () => symbols,
    recognize: ({ times, positions }) => runtime.recognize(times, positions),
    explain: (movement, answer) => explain(runtime.recognizer(), movement, answer),
    /** A state is computed when the page paints, of all samples so far; the answer is asked for. */
    follow: (hear) => {
      let [update, times, positions, frame] = [null, [], [], 0];
      const compute = () => {
        frame = 0;
        update ??= runtime.follow();
        hear({ state: update(times, positions) });
      };
      const stop = () => {
        cancelAnimationFrame(frame);
        frame = 0;
      };
      return {
        reset: () => {
          stop();
          [update, times, positions] = [null, [], []];
        },
        push: (samples) => {
          for (const [time, ...point] of samples) {
            times.push(time);
            positions.push(point);
          }
          frame ||= requestAnimationFrame(compute);
        },
        finish: () => {
          stop();
          return false;
        },
      };
    },
    /** Of a symbol, or of a primitive that was learned here. */
    generate: ({ what: { symbol, primitive }, formulation, ...wish }) =>
      runtime.rollout(runtime.primitive(symbol ?? primitive, formulation), wish),
  };
}
