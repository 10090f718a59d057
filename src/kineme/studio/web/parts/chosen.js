// Which symbol moves, and where its goal was dragged to: what views tell each other.

let chosen = null;
export function chooseToMove(id) {
  chosen = id;
}

let dragged = null; // the way from start to goal where it is not the recorded one

export function dragGoal(symbol, displacement) {
  dragged = displacement && { symbol, displacement };
}

export const draggedGoal = (symbol) => (dragged?.symbol === symbol ? dragged.displacement : null);

/** @returns The chosen one, or the first where it is gone. */
export const toMove = (symbols) =>
  symbols.some((symbol) => symbol.id === chosen) ? chosen : (symbols.find((symbol) => symbol.path)?.id ?? null);
