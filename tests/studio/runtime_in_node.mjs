// Runs the runtime on questions: each line names a runtime and a file of questions, both as JSON; a line of answers each.
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";

const answers = {
  recognize: ({ runtime }, { times, positions, error_rate }) => runtime.recognize(times, positions, error_rate),
  follow: ({ runtime }, { times, positions, ends, options }) => {
    const update = runtime.follow(options);
    return ends.map((end) => update(times.slice(0, end), positions.slice(0, end)));
  },
  encode: ({ runtime }, { times, positions, formulation }) => {
    const primitive = runtime.primitive(runtime.encode(times, positions), formulation);
    return { ...primitive, weights: [...primitive.weights] };
  },
  rollout: ({ runtime }, { symbol, times, positions, formulation, wish }) => {
    const primitive = runtime.primitive(symbol ?? runtime.encode(times, positions), formulation);
    const moved = runtime.rollout(primitive, wish);
    return { times: [...moved.times], positions: moved.positions };
  },
  primitive: ({ openPrimitive }, { document, wish }) => {
    const moved = openPrimitive(document).rollout(wish);
    return { ...moved, times: [...moved.times] };
  },
};

function answered(modules, question) {
  try {
    return { answer: answers[question.ask](modules, question) };
  } catch (error) {
    return { error: error.message };
  }
}

async function all(path, file) {
  const { open } = await import(pathToFileURL(path).href);
  const { openPrimitive } = await import(new URL("primitive.js", pathToFileURL(path)).href);
  const { snapshot, questions } = JSON.parse(readFileSync(file, "utf8"));
  const modules = { runtime: snapshot && open(snapshot), openPrimitive };
  return questions.map((question) => answered(modules, question));
}

for await (const line of createInterface({ input: process.stdin })) {
  const said = await all(...JSON.parse(line)).catch((error) => ({ failed: String(error.stack) }));
  process.stdout.write(`${JSON.stringify(said)}\n`);
}
