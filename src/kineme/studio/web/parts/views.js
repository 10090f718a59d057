// Five views, one shown: tabs, arrow keys between them, the address names the view.
import { byId } from "./elements.js";

export const VIEWS = ["draw", "library", "move", "recordings", "robot"];

/** @type {Record<string, () => void>} What a view does when it is shown. */
const shown = {};
let current = "";

/** @param {string} view @param {() => void} act */
export function onShow(view, act) {
  shown[view] = act;
}

/** The view that is shown. */
export const currentView = () => current;

/** @param {string} view @param {boolean} focus Whether its tab gets the focus. */
export function show(view, focus = false) {
  if (!VIEWS.includes(view)) return;
  for (const name of VIEWS) {
    byId(`view-${name}`).hidden = name !== view;
    byId(`tab-${name}`).setAttribute("aria-selected", String(name === view));
    byId(`tab-${name}`).tabIndex = name === view ? 0 : -1;
  }
  if (focus) byId(`tab-${view}`).focus();
  if (location.hash !== `#${view}`) history.replaceState(null, "", `#${view}`);
  document.title = `${byId(`tab-${view}`).textContent.trim()} – kineme studio`;
  const changed = current !== view;
  current = view;
  if (changed) {
    window.scrollTo(0, 0);
    shown[view]?.();
  }
}

/** @param {KeyboardEvent} event */
function step(event) {
  const at = VIEWS.indexOf(current);
  const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: VIEWS.length - 1 }[event.key];
  if (to === undefined) return;
  event.preventDefault();
  show(VIEWS[(to + VIEWS.length) % VIEWS.length], true);
}

export function startViews() {
  for (const view of VIEWS) byId(`tab-${view}`).addEventListener("click", () => show(view));
  document.querySelector(".tabs").addEventListener("keydown", step);
  for (const button of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-view]")))
    button.addEventListener("click", () => show(button.dataset.view, true));
  window.addEventListener("hashchange", () => show(location.hash.slice(1)));
  show(VIEWS.includes(location.hash.slice(1)) ? location.hash.slice(1) : "draw");
}
