// Changes of the library: each is asked for, said, and can be taken back.
import { post, remove } from "./api.js";
import { library, refresh } from "./library_state.js";
import { say, tried } from "./toasts.js";

let own = 0; // the version of the last change of this page
let withdraw = () => {}; // the last offer to take a change back, which later changes make void
let turn = Promise.resolve(); // of undoing, one after the other

const KNOWN = "Nothing is new: all of it is in the library, and a movement keeps the name that it has there.";

/**
 * @param {() => Promise<any>} ask
 * @param {string} done What to say then.
 * @param {string} same What to say where nothing changed.
 * @returns {Promise<any>}
 */
async function change(ask, done, same = done) {
  return tried(async () => {
    const before = library().version;
    const answer = await ask();
    own = answer.version;
    await refresh();
    const changed = answer.version > before; // not where it was stored already
    withdraw();
    withdraw = say(
      changed ? done : same,
      changed && library().can_undo ? { act: () => undo(answer.version), action: "Undo" } : {},
    );
    return answer;
  });
}

/**
 * Back to the state before a change, by default the last one that is shown; the server refuses if others came since.
 * @param {number} [version]
 */
export function undo(version) {
  turn = turn.then(() => takeBack(version));
  return turn;
}

/** @param {number} [version] */
async function takeBack(version) {
  if (!library().can_undo || library().read_only) return;
  await tried(async () => {
    own = (await post("/api/library/undo", { version: version ?? Math.max(own, library().version) })).version;
    withdraw();
    await refresh();
    say("The last change is taken back.");
  });
}

/**
 * The state of an earlier version again; refused if somebody has changed the library since it was looked at.
 * @param {number} number @param {number} seen
 */
export const restore = (number, seen) =>
  change(() => post("/api/library/undo", { version: seen, to: number }), `Version ${number} is restored.`);

const of = (/** @type {string} */ id) => `/api/library/symbols/${encodeURIComponent(id)}`;

/** @param {{times: number[], positions: number[][]}} drawn @param {string|null} label */
export const learn = (drawn, label) =>
  change(
    () => post("/api/library/movements", { ...drawn, label, group: null }),
    label === null ? "Saved without a name." : `Learned as ${label}.`,
    KNOWN,
  );
/** @param {string} name */
export const learnExample = (name) => change(() => post("/api/library/example", { name }), "The example is learned.");
/** @param {string} id @param {string} name */
export const rename = (id, name) => change(() => post(`${of(id)}/rename`, { name }), `Renamed to ${name}.`);
/** @param {string} id @param {string} text */
export const describe = (id, text) => change(() => post(`${of(id)}/describe`, { text }), "Description saved.");
/** @param {string} id @param {number[]} ids @param {string} name */
export const split = (id, ids, name) =>
  change(() => post(`${of(id)}/split`, { ids, name }), `${name} is a symbol of its own.`);
/** @param {string[]} ids @param {string} into */
export const merge = (ids, into) =>
  change(() => post("/api/library/symbols/merge", { ids, into }), `Merged into ${into}.`);
/** @param {string} id @param {string} name */
export const forget = (id, name) => change(() => remove(of(id)), `${name} is deleted; its movements have no name.`);
/** @param {number[]} ids @param {string|null} symbol */
export const assign = (ids, symbol) =>
  change(
    () => post("/api/library/movements/assign", { ids, symbol }),
    symbol === null ? "The name is removed." : `Assigned to ${symbol}.`,
  );
/** @param {number[]} ids */
export const deleteMovements = (ids) =>
  change(
    () => post("/api/library/movements/delete", { ids }),
    ids.length === 1 ? "1 movement is deleted." : `${ids.length} movements are deleted.`,
  );
/** @param {string} id @param {string} name */
export const accept = (id, name) =>
  change(() => post(`/api/proposals/${encodeURIComponent(id)}/accept`, { name }), `${name} is a symbol now.`);
/** @param {string} id */
export const reject = (id) =>
  change(() => post(`/api/proposals/${encodeURIComponent(id)}/reject`), "Not proposed again.");
/** @param {string} recording @param {any} body Without `spans` the whole file, by its labels. */
export const learnSpans = (recording, body) =>
  change(
    () => post(`/api/recordings/${encodeURIComponent(recording)}/learn`, body),
    body.spans ? "Learned from the recording." : "Learned the whole file, by its labels.",
    KNOWN,
  );
