// What a page in a cell of a notebook tells the notebook around it: drawings, movements, its height; and what it hears.

import { recolor } from "../web/parts/canvas.js";

const inNotebook = document.body.matches(".notebook");
const rules = /** @type {CSSMediaRule[]} */ ([...document.styleSheets[0].cssRules]);
const dark = rules.find(({ media }) => media?.mediaText.includes("color-scheme")).media;

/** @param {Object} message See notebook.js. */
export const tell = (message) => inNotebook && parent.postMessage(message, "*");

/** @param {(state: {drawn: any[], moved: any}) => void} hear Of all drawings that the notebook has, and what moved last. */
export function hearNotebook(hear) {
  window.addEventListener("message", ({ source, data }) => {
    if (!inNotebook || source !== parent) return;
    dark.mediaText = data.dark ? "all" : "not all"; // as the notebook is, whatever the system prefers
    document.documentElement.style.colorScheme = data.dark ? "dark" : "light";
    recolor();
    hear(data);
  });
  new ResizeObserver(() => tell({ height: Math.ceil(document.body.offsetHeight) })).observe(document.body);
}
