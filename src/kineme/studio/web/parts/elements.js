// Elements of the page, made of plain values; text is always text.

/** @type {<Id extends string>(id: Id) => ElementOf<Id>} The element of that id. */
export const byId = (id) => /** @type {any} */ (document.getElementById(id));

/**
 * Make an element. Options are its class, or its properties and attributes; what is null or false is left out.
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {string|Record<string, any>} options
 * @param {...any} children Strings become text.
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function make(tag, options = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(typeof options === "string" ? { class: options } : options)) {
    if (name in element && typeof value !== "string") element[name] = value;
    else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  fill(element, ...children);
  return element;
}

export const button = (text, onclick, options = {}) =>
  make("button", { class: "button", type: "button", onclick, ...options }, text);

/** Offer names to choose from; the values are their numbers. */
export const offer = (select, names) => fill(select, ...names.map((name, value) => make("option", { value }, name)));

/** Say something else; what stays the same costs no layout. */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Replace what an element holds; null is left out. @param {...any} children */
export const fill = (element, ...children) => element.replaceChildren(...children.filter((child) => child != null));

/** "1 movement", "2 movements". */
export const counted = (n, what) => `${n} ${what}${n === 1 ? "" : "s"}`;

/** Hand a file to the person. @param {Blob} file */
export function handOver(file, download) {
  const href = URL.createObjectURL(file);
  make("a", { href, download }).click();
  setTimeout(() => URL.revokeObjectURL(href), 10000);
}

/** The element of that `data-key`. */
export const keyed = (key) => document.querySelector(`[data-key="${CSS.escape(key)}"]`);

/** Replace elements; the focus stays on the one that it was on, which is recognized by its `data-key`. */
export function keepingFocus(act) {
  const key = document.activeElement?.getAttribute("data-key");
  act();
  if (key && document.activeElement === document.body) keyed(key)?.focus({ preventScroll: true });
}

/**
 * A name that may break into lines where its words meet, as in DoubleBendedLine or pick_and_place, and not within them.
 * @returns {(Node|string)[]}
 */
export const breakable = (name) =>
  name
    .split(/(?<=\p{Ll})(?=\p{Lu})|(?<=[\p{L}\p{N}][_\-./:])(?=[\p{L}\p{N}])/u)
    .flatMap((part, k) => (k ? [document.createElement("wbr"), part] : [part]));
