// A field that finds symbols by words of their names; it is there where they are too many to look through.

const MANY = 12;

/** Show what is found whenever the field has changed; Enter presses the first. */
export function startFinding(field, changed, first) {
  field.oninput = changed;
  field.addEventListener("keydown", (event) => event.key === "Enter" && first()?.click());
}

/** Symbols with all words of the field in their name or description. @param {HTMLInputElement} field */
export function matching(field, symbols) {
  field.hidden = symbols.length <= MANY;
  if (field.hidden) field.value = "";
  const words = field.value.toLowerCase().split(/\s+/);
  return symbols.filter((symbol) =>
    words.every((word) => `${symbol.name} ${symbol.description ?? ""}`.toLowerCase().includes(word)),
  );
}
