// Which symbol moves; other views set it.

/** @type {string|null} */
let chosen = null;

/** @param {string|null} id */
export const chooseToMove = (id) => (chosen = id);

/** @param {any[]} symbols @returns {string|null} The chosen one, or the first where it is gone. */
export const toMove = (symbols) => (symbols.some((one) => one.id === chosen) ? chosen : (symbols.find((one) => one.path)?.id ?? null));
