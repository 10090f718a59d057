// Elements of the page, made of plain values; text is always text.

/**
 * The element of that id.
 * @template {string} Id
 * @param {Id} id
 * @returns {Id extends keyof Elements ? Elements[Id] : HTMLElement}
 */
export const byId = (id) => /** @type {any} */ (document.getElementById(id));

/**
 * Make an element. Names of `on` are events, `class` and attributes are set as they are, null and false are left out.
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Record<string, any>} options
 * @param {...(Node|string|number|null)} children Strings become text.
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function make(tag, options = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(options)) {
    if (name === "on") for (const [event, act] of Object.entries(value)) element.addEventListener(event, act);
    else if (name in element && typeof value !== "string") element[name] = value;
    else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(
    ...children
      .filter((child) => child !== null && child !== undefined)
      .map((child) => (child instanceof Node ? child : String(child))),
  );
  return element;
}

/** @param {string} text @param {() => any} act @param {Record<string, any>} options */
export const button = (text, act, options = {}) =>
  make("button", { class: "button", type: "button", ...options, on: { click: act } }, text);

/** Offer names to choose from; the values are their numbers. @param {Element} select @param {string[]} names */
export const offer = (select, names) =>
  fill(select, ...names.map((name, k) => make("option", { value: String(k) }, name)));

/** Say something else; what stays the same costs no layout. @param {Element} element @param {string} text */
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Replace what an element holds. @param {Element} element @param {...any} children */
export function fill(element, ...children) {
  element.replaceChildren(...children.filter((child) => child !== null && child !== undefined));
}

/** "1 movement", "2 movements". @param {number} n @param {string} what */
export const counted = (n, what) => `${n} ${what}${n === 1 ? "" : "s"}`;

/**
 * Replace elements; the focus stays on the one that it was on, which is recognized by its `data-key`.
 * @param {() => void} act
 */
export function keepingFocus(act) {
  const key = /** @type {HTMLElement} */ (document.activeElement)?.dataset?.key;
  act();
  if (key && document.activeElement === document.body)
    /** @type {HTMLElement} */ (document.querySelector(`[data-key="${CSS.escape(key)}"]`))?.focus({
      preventScroll: true,
    });
}

/**
 * A name that may break into lines where its words meet, as in DoubleBendedLine or pick_and_place, and not within them.
 * @param {string} name
 * @returns {(Node|string)[]}
 */
export const breakable = (name) =>
  name
    .split(/(?<=\p{Ll})(?=\p{Lu})|(?<=[\p{L}\p{N}][_\-./:])(?=[\p{L}\p{N}])/u)
    .flatMap((part, k) => (k ? [document.createElement("wbr"), part] : [part]));

/**
 * Elements by their ids that are more than an HTMLElement.
 * @typedef {Record<"add-obstacle"|"add-span"|"add-via"|"ask-yes"|"clear"|"draw-clear"|"draw-move"|"draw-replay"|
 *     "draw-save"|"episodes-before"|"episodes-next"|"export"|"help"|"learn-file"|"learn-spans"|"merge"|
 *     "move-play"|"move-redo"|"move-reset"|"move-undo"|"naming-learn"|"play"|"play-recording"|"read-as"|
 *     "redo-span"|"reset"|"robot-free"|"robot-go"|"robot-save"|"save"|"save-corrections"|"save-spans"|
 *     "show-unlabeled"|"spot"|"spot-page"|"undo"|"undo-span"|"zoom-in"|"zoom-out", HTMLButtonElement>
 *   & Record<"canvas"|"draw-canvas"|"map"|"move-canvas"|"nearest"|"plot-acceleration"|"plot-speed"|"shape"|
 *     "stage"|"timeline-canvas"|"wand-canvas", HTMLCanvasElement>
 *   & Record<"confusion"|"history"|"live-source"|"mirror"|"move-advanced"|"pick-part"|"robot-preflight"|
 *     "why", HTMLDetailsElement>
 *   & Record<"ask"|"importing"|"keys"|"phone", HTMLDialogElement>
 *   & Record<"channels"|"formulations"|"manner"|"styles", HTMLFieldSetElement>
 *   & Record<"ask-name"|"duration"|"episodes-from"|"file"|"find"|"find-pick"|"find-symbol"|"name"|
 *     "naming-name"|"own-video"|"phone-host"|"playhead"|"robot-dragged"|"robot-size"|"robot-slow"|"style-mix"|
 *     "tilt"|"time"|"turn"|"video-start", HTMLInputElement>
 *   & Record<"camera"|"export-format"|"formulation"|"robot-arm"|"robot-format"|"robot-what"|"save-format"|
 *     "tables", HTMLSelectElement>
 *   & Record<"confusion-table"|"importing-rows"|"spans", HTMLTableElement>
 *   & Record<"video", HTMLVideoElement>} Elements
 */
