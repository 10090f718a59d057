// Lists are made anew when the library changes; the focus stays on the thing that it was on.

/** @param {() => void} act What replaces elements; those with `data-key` are known again. */
export function keepingFocus(act) {
  const key = /** @type {HTMLElement} */ (document.activeElement)?.dataset?.key;
  act();
  if (key && document.activeElement === document.body)
    /** @type {any} */ (document.querySelector(`[data-key="${CSS.escape(key)}"]`))?.focus({ preventScroll: true });
}
