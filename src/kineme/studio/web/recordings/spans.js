// What was found, as a table: times and names can be typed, a row can be removed.
import { button, byId, fill, keepingFocus, make } from "../parts/elements.js";

export const BY_HAND = { p: null, confidence: null, certainty: null }; // they were of what was found

/** What the server is told of spans. */
export const plain = (spans) =>
  spans.map(({ begin, end, label, p = null, confidence = null }) => ({ begin, end, label, p, confidence }));

/** @param {TimelinePage} page */
export function showSpans(spans, chosen, page) {
  const row = (span, k) => {
    const onfocus = () => page.choose(k);
    const field = (which, words, options) => {
      const onchange = ({ target }) => {
        if (which === "label") Object.assign(span, { label: target.value.trim() || null, ...BY_HAND });
        else if (target.value) page.timeline.moveEdge(which, target.valueAsNumber);
        page.changed();
      };
      const name = { "aria-label": `${words} of span ${k + 1}`, "data-key": `span ${k} ${words.toLowerCase()}` };
      return make("td", which === "label" ? "wide" : {}, make("input", { ...name, ...options, onfocus, onchange }));
    };
    const time = (which) => ({ type: "number", step: "0.01", readOnly: k !== chosen, value: span[which].toFixed(2) });
    const words = { type: "text", list: "names", maxLength: "200", placeholder: "unknown", value: span.label ?? "" };
    const p = Number.isFinite(span.p) ? `p = ${span.p.toFixed(2)}` : "–";
    const look = { class: "button quiet square", "aria-label": `Remove span ${k + 1}`, hidden: k !== chosen };
    const away = button("×", () => page.remove(k), look);
    return make(
      "tr",
      { class: k === chosen ? "chosen" : null, onclick: () => page.choose(k) },
      field("begin", "Begin", time("begin")),
      field("end", "End", time("end")),
      field("label", "Name", words),
      make("td", { title: p }, span.certainty ?? p),
      make("td", {}, away),
    );
  };
  byId("spans").hidden = !spans.length;
  keepingFocus(() => fill(byId("spans").tBodies[0], ...spans.map(row)));
}

/** Mark the row of the chosen one; its times can be typed. */
export function markRow(chosen) {
  for (const [k, row] of [...byId("spans").tBodies[0].rows].entries()) {
    row.classList.toggle("chosen", k === chosen);
    for (const part of row.querySelectorAll("button")) part.hidden = k !== chosen;
    for (const time of row.querySelectorAll("[type=number]")) time.readOnly = k !== chosen;
  }
}
