// Five views, one shown: tabs, arrow keys between them, the address names the view.
import { byId } from "./elements.js";
import { onLibrary } from "./library_state.js";

export const VIEWS = ["draw", "library", "move", "recordings", "robot"];

const shown = {}; // what a view does then
let current = "";

/** Do something when a view is shown, and when the library changes meanwhile. */
export function onShow(view, act) {
  shown[view] = act;
  onLibrary(() => current === view && act());
}

/** The view that is shown. */
export const currentView = () => current;

/** Show a view; its tab may get the focus. */
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
  if (current === view) return;
  current = view;
  window.scrollTo(0, 0);
  shown[view]?.();
}

function step(event) {
  const at = VIEWS.indexOf(current);
  const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: VIEWS.length - 1 }[event.key];
  if (to === undefined) return;
  event.preventDefault();
  show(VIEWS[(to + VIEWS.length) % VIEWS.length], true);
}

export function startViews() {
  for (const view of VIEWS) byId(`tab-${view}`).onclick = () => show(view);
  document.querySelector(".tabs").onkeydown = step;
  for (const button of document.querySelectorAll("[data-view]")) button.onclick = () => show(button.dataset.view, true);
  window.onhashchange = () => show(location.hash.slice(1));
  show(VIEWS.includes(location.hash.slice(1)) ? location.hash.slice(1) : "draw");
}
