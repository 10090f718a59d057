// A page in a cell tells its notebook what was drawn, what moves and how high it is, and is as dark as the notebook.

import { recolor } from "../web/parts/canvas.js";

const inNotebook = document.body.matches(".notebook");
const rules = /** @type {CSSMediaRule[]} */ ([...document.styleSheets[0].cssRules]);
const dark = rules.find(({ media }) => media?.mediaText.includes("color-scheme")).media;
let drawings = [];

/** Tell parts of the widget's state. */
export const tell = (state) => inNotebook && parent.postMessage(state, "*");

/** Tell a drawing: a name, and samples. */
export const tellDrawn = (drawing) => tell({ drawn: [...drawings, drawing] });

/** Hear the widget's state. */
export function hearNotebook(hear) {
  if (!inNotebook) return;
  window.addEventListener("message", ({ source, data }) => {
    if (source !== parent) return;
    drawings = data.drawn;
    dark.mediaText = data.dark ? "all" : "not all"; // whatever the system prefers
    document.documentElement.style.colorScheme = data.dark ? "dark" : "light";
    recolor();
    hear(data);
  });
  new ResizeObserver(() => tell({ height: document.body.offsetHeight })).observe(document.body);
}
