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
 * @typedef {(
 *   Record<"add-obstacle"| "add-span"| "add-via"| "ask-yes"| "draw-clear"| "draw-how"| "draw-move"|
 *   "episodes-before"| "episodes-next"| "draw-replay"| "draw-save"| "learn-file"| "learn-spans"| "move-play"|
 *   "move-reset"| "naming-learn"| "play-recording"| "robot-draw"| "robot-go"| "save-corrections"| "show-unlabeled"|
 *   "spot-page"| "zoom-in"| "zoom-out"| "clear"| "export"| "help"| "merge"| "play"| "reset"| "save"| "spot"| "undo",
 *   HTMLButtonElement> &
 *   Record<"draw-canvas"| "move-canvas"| "plot-acceleration"| "plot-speed"| "timeline-canvas"| "canvas"| "map"|
 *   "stage", HTMLCanvasElement> &
 *   Record<"live-source"| "robot-preflight"| "history"| "why", HTMLDetailsElement> &
 *   Record<"ask"| "keys", HTMLDialogElement> &
 *   Record<"pick-part"| "channels"| "formulations"| "styles", HTMLFieldSetElement> &
 *   Record<"ask-name"| "episodes-from"| "find-pick"| "find-symbol"| "naming-name"| "robot-dragged"| "robot-size"|
 *   "robot-slow"| "duration"| "file"| "name"| "find"| "playhead"| "tilt"| "time"| "turn", HTMLInputElement> &
 *   Record<"export-format"| "robot-arm"| "robot-what"| "camera"| "formulation"| "tables", HTMLSelectElement> &
 *   Record<"spans", HTMLTableElement> &
 *   Record<"video", HTMLVideoElement>
 * )} Elements
 */
