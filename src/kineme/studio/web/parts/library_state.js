// What the page knows of the library; views are told when it changes, whoever changed it.
import { newer } from "./api.js";

const EMPTY = {
  folder: "",
  version: 0,
  n_movements: 0,
  n_dims: null,
  channels: null,
  read_only: false,
  can_undo: false,
  symbols: [],
  unlabeled: 0,
  formats: [],
};

/** @type {any} */
let current = EMPTY;
let loaded = false;
/** @type {string|null} */
let tag = null;
/** @type {Promise<any>|null} */
let loading = null;
/** @type {Promise<any>|null} */
let next = null;
/** @type {((library: any) => void)[]} */
const listeners = [];

/** The library as of the last answer. */
export const library = () => current;

/** Whether an answer came at all. */
export const isLoaded = () => loaded;

/** @param {(library: any) => void} act Called after every change. */
export const onLibrary = (act) => listeners.push(act);

/**
 * The library as it is now: an answer that is under way may be older, and is followed by one more.
 * @returns {Promise<any>}
 */
export function refresh() {
  if (!loading) {
    loading = load().finally(() => {
      loading = null;
    });
    return loading;
  }
  next ??= loading
    .catch(() => null)
    .then(() => {
      next = null;
      return refresh();
    });
  return next;
}

async function load() {
  const answer = await newer("/api/library", tag);
  if (!answer) return current;
  ({ body: current, tag } = answer);
  loaded = true;
  for (const act of listeners) act(current);
  return current;
}

/** @param {string} id @returns {any} The symbol of that id, or undefined. */
export const symbolOf = (id) => current.symbols.find((/** @type {any} */ symbol) => symbol.id === id);

/** @param {string} name @returns {any} */
export const symbolNamed = (name) => current.symbols.find((/** @type {any} */ symbol) => symbol.name === name);

/** Tokens of colors that are told apart, of symbols and of columns. */
export const COLORS = ["--blue", "--orange", "--green", "--purple", "--sky", "--amber"];

/** The color and the mark of a symbol, by its position in the list. @param {string|null} id */
export function lookOf(id) {
  const at = current.symbols.findIndex((/** @type {any} */ symbol) => symbol.id === id);
  if (at < 0) return { color: "--gray", mark: "ring" };
  return {
    color: COLORS[at % COLORS.length],
    mark: ["dot", "square", "diamond", "triangle"][Math.floor(at / COLORS.length) % 4],
  };
}
