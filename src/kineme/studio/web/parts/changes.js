// Changes of the library: each is asked for, said, and can be taken back.
import { path, post, remove } from "./api.js";
import { counted } from "./elements.js";
import { library, refresh } from "./library_state.js";
import { say, tried } from "./toasts.js";

let own = 0; // the version of the last change of this page
let withdraw = () => {}; // the last offer to take a change back, which later changes make void
let turn = Promise.resolve(); // of undoing, one after the other

const KNOWN = "Nothing is new: all of it is in the library, and a movement keeps the name that it has there.";

async function follow(request, done, same) {
  const before = library().version;
  const answer = await request;
  own = answer.version;
  await refresh();
  const changed = answer.version > before; // not where it was stored already
  withdraw();
  withdraw = say(changed ? done : same, changed && library().can_undo ? { undo: () => undo(answer.version) } : {});
  return answer;
}

/** Say what a request has changed, or that nothing is another. @param {Promise<any>} request */
const change = (request, done, same = done) => tried(follow(request, done, same));

/** Back to the state before a change, by default the last one that is shown; refused if others came since. */
export function undo(version = null) {
  turn = turn.then(() => tried(takeBack(version)));
  return turn;
}

async function takeBack(version) {
  if (!library().can_undo || library().read_only) return;
  own = (await post("/api/library/undo", { version: version ?? Math.max(own, library().version) })).version;
  withdraw();
  await refresh();
  say("The last change is taken back.");
}

/** The state of an earlier version again; refused if somebody has changed the library since it was looked at. */
export const restore = (to, seen) =>
  change(post("/api/library/undo", { version: seen, to }), `Version ${to} is restored.`);

/** @param {Movement} drawn */
export const learn = (drawn, label) =>
  change(
    post("/api/library/movements", { ...drawn, label, group: null }),
    label === null ? "Saved without a name." : `Learned as ${label}.`,
    KNOWN,
  );
export const learnExample = (name) => change(post("/api/library/example", { name }), "The example is learned.");
export const rename = (id, name) =>
  change(post(path`/api/library/symbols/${id}/rename`, { name }), `Renamed to ${name}.`);
export const describe = (id, text) =>
  change(post(path`/api/library/symbols/${id}/describe`, { text }), "Description saved.");
export const split = (id, ids, name) =>
  change(post(path`/api/library/symbols/${id}/split`, { ids, name }), `${name} is a symbol of its own.`);
export const merge = (ids, into) => change(post("/api/library/symbols/merge", { ids, into }), `Merged into ${into}.`);
export const forget = (id, name) =>
  change(remove(path`/api/library/symbols/${id}`), `${name} is deleted; its movements have no name.`);
export const assign = (ids, symbol) =>
  change(
    post("/api/library/movements/assign", { ids, symbol }),
    symbol === null ? "The name is removed." : `Assigned to ${symbol}.`,
  );
export const deleteMovements = (ids) =>
  change(
    post("/api/library/movements/delete", { ids }),
    `${counted(ids.length, "movement")} ${ids.length === 1 ? "is" : "are"} deleted.`,
  );
export const accept = (id, name) =>
  change(post(path`/api/proposals/${id}/accept`, { name }), `${name} is a symbol now.`);
export const reject = (id) => change(post(path`/api/proposals/${id}/reject`), "Not proposed again.");
/** @param {any} body Without `spans` the whole file, by its labels. */
export const learnSpans = (recording, body) =>
  change(
    post(path`/api/recordings/${recording}/learn`, body),
    body.spans ? "Learned from the recording." : "Learned the whole file, by its labels.",
    KNOWN,
  );
