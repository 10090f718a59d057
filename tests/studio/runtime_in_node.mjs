// Runs the runtime on questions: node runtime_in_node.mjs RUNTIME QUESTIONS, both files; answers as JSON.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const { open } = await import(pathToFileURL(process.argv[2]).href);
const { openPrimitive } = await import(new URL("primitive.js", pathToFileURL(process.argv[2])).href);
const { snapshot, questions } = JSON.parse(readFileSync(process.argv[3], "utf8"));
const runtime = snapshot && open(snapshot);

const answers = {
  recognize: ({ times, positions, error_rate }) => runtime.recognize(times, positions, error_rate),
  follow: ({ times, positions, ends, options }) => {
    const update = runtime.follow(options);
    return ends.map((end) => update(times.slice(0, end), positions.slice(0, end)));
  },
  encode: ({ times, positions, formulation }) => {
    const primitive = runtime.primitive(runtime.encode(times, positions), formulation);
    return { ...primitive, weights: [...primitive.weights] };
  },
  rollout: ({ symbol, times, positions, formulation, wish }) => {
    const primitive = runtime.primitive(symbol ?? runtime.encode(times, positions), formulation);
    const moved = runtime.rollout(primitive, wish);
    return { times: [...moved.times], positions: moved.positions };
  },
  primitive: ({ document, wish }) => {
    const moved = openPrimitive(document).rollout(wish);
    return { ...moved, times: [...moved.times] };
  },
};

function answered(question) {
  try {
    return { answer: answers[question.ask](question) };
  } catch (error) {
    return { error: error.message };
  }
}

process.stdout.write(JSON.stringify(questions.map(answered)));
