// Which symbol moves, and where its goal was dragged to: what views tell each other.

/** @type {string|null} */
let chosen = null;

/** @param {string|null} id */
export function chooseToMove(id) {
  chosen = id;
}

/**
 * The way from start to goal where it is not the recorded one.
 * @type {{symbol: string, displacement: number[]}|null}
 */
let dragged = null;

/** @param {string} symbol @param {number[]|null} displacement */
export function dragGoal(symbol, displacement) {
  dragged = displacement && { symbol, displacement };
}

/** @param {string} symbol @returns {number[]|null} */
export const draggedGoal = (symbol) => (dragged?.symbol === symbol ? dragged.displacement : null);

/** @param {any[]} symbols @returns {string|null} The chosen one, or the first where it is gone. */
export const toMove = (symbols) =>
  symbols.some((symbol) => symbol.id === chosen) ? chosen : (symbols.find((symbol) => symbol.path)?.id ?? null);
