// What the page knows of the library; views are told when it changes, whoever changed it.
import { request } from "./api.js";

/** @type {Library} */
const EMPTY = {
  ...{ folder: "", version: 0, n_movements: 0, unlabeled: 0, symbols: [] },
  ...{ n_dims: null, channels: null, read_only: false, can_undo: false },
};
let current = EMPTY;
let tag = null; // of the answer
let loading = null;
let next = null;
const listeners = [];

/** The library as of the last answer. */
export const library = () => current;

/** Whether an answer came at all. */
export const isLoaded = () => current !== EMPTY;

/** Act after every change. @param {(library: Library) => void} act */
export const onLibrary = (act) => listeners.push(act);

/** The library as it is now: an answer that is under way may be older, and is followed by one more. */
export function refresh() {
  if (!loading) {
    loading = load().finally(() => (loading = null));
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
  const answer = await request("/api/library", tag ? { headers: { "If-None-Match": tag } } : {});
  if (answer.status === 304) return current;
  current = await answer.json();
  tag = answer.headers.get("ETag");
  for (const act of listeners) act(current);
  return current;
}

export const symbolOf = (id) => current.symbols.find((symbol) => symbol.id === id);
export const symbolNamed = (name) => current.symbols.find((symbol) => symbol.name === name);

/** Tokens of colors that are told apart, of symbols and of columns. */
export const COLORS = ["--blue", "--orange", "--green", "--purple", "--sky", "--amber"];
const MARKS = ["dot", "square", "diamond", "triangle"];

/** The color and the mark of a symbol, by its position in the list. */
export function lookOf(id) {
  const at = current.symbols.findIndex((symbol) => symbol.id === id);
  if (at < 0) return { color: "--gray", mark: "ring" };
  return { color: COLORS[at % COLORS.length], mark: MARKS[Math.floor(at / COLORS.length) % MARKS.length] };
}
