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
 * @typedef {{
 *   "add-obstacle": HTMLButtonElement,
 *   "add-span": HTMLButtonElement,
 *   "add-via": HTMLButtonElement,
 *   "ask-yes": HTMLButtonElement,
 *   "draw-clear": HTMLButtonElement,
 *   "draw-how": HTMLButtonElement,
 *   "draw-move": HTMLButtonElement,
 *   "episodes-before": HTMLButtonElement,
 *   "episodes-next": HTMLButtonElement,
 *   "draw-replay": HTMLButtonElement,
 *   "draw-save": HTMLButtonElement,
 *   "learn-file": HTMLButtonElement,
 *   "learn-spans": HTMLButtonElement,
 *   "move-play": HTMLButtonElement,
 *   "move-reset": HTMLButtonElement,
 *   "naming-learn": HTMLButtonElement,
 *   "play-recording": HTMLButtonElement,
 *   "robot-draw": HTMLButtonElement,
 *   "robot-go": HTMLButtonElement,
 *   "save-corrections": HTMLButtonElement,
 *   "show-unlabeled": HTMLButtonElement,
 *   "spot-page": HTMLButtonElement,
 *   "zoom-in": HTMLButtonElement,
 *   "zoom-out": HTMLButtonElement,
 *   clear: HTMLButtonElement,
 *   export: HTMLButtonElement,
 *   help: HTMLButtonElement,
 *   merge: HTMLButtonElement,
 *   play: HTMLButtonElement,
 *   reset: HTMLButtonElement,
 *   save: HTMLButtonElement,
 *   spot: HTMLButtonElement,
 *   undo: HTMLButtonElement,
 *   "draw-canvas": HTMLCanvasElement,
 *   "move-canvas": HTMLCanvasElement,
 *   "plot-acceleration": HTMLCanvasElement,
 *   "plot-speed": HTMLCanvasElement,
 *   "timeline-canvas": HTMLCanvasElement,
 *   canvas: HTMLCanvasElement,
 *   map: HTMLCanvasElement,
 *   stage: HTMLCanvasElement,
 *   "live-source": HTMLDetailsElement,
 *   "robot-preflight": HTMLDetailsElement,
 *   history: HTMLDetailsElement,
 *   why: HTMLDetailsElement,
 *   ask: HTMLDialogElement,
 *   keys: HTMLDialogElement,
 *   "pick-part": HTMLFieldSetElement,
 *   channels: HTMLFieldSetElement,
 *   formulations: HTMLFieldSetElement,
 *   styles: HTMLFieldSetElement,
 *   "ask-name": HTMLInputElement,
 *   "episodes-from": HTMLInputElement,
 *   "find-pick": HTMLInputElement,
 *   "find-symbol": HTMLInputElement,
 *   "naming-name": HTMLInputElement,
 *   "robot-dragged": HTMLInputElement,
 *   "robot-size": HTMLInputElement,
 *   "robot-slow": HTMLInputElement,
 *   duration: HTMLInputElement,
 *   file: HTMLInputElement,
 *   name: HTMLInputElement,
 *   find: HTMLInputElement,
 *   playhead: HTMLInputElement,
 *   tilt: HTMLInputElement,
 *   time: HTMLInputElement,
 *   turn: HTMLInputElement,
 *   "export-format": HTMLSelectElement,
 *   "robot-arm": HTMLSelectElement,
 *   "robot-what": HTMLSelectElement,
 *   camera: HTMLSelectElement,
 *   formulation: HTMLSelectElement,
 *   tables: HTMLSelectElement,
 *   spans: HTMLTableElement,
 *   video: HTMLVideoElement,
 * }} Elements
 */
