// What was found, as a table: times and names can be typed, a row can be removed.
import { button, byId, fill, keepingFocus, make } from "../parts/elements.js";

export const BY_HAND = { p: null, confidence: null, certainty: null }; // they were of what was found

/** What the server is told of spans. @param {any[]} spans */
export const plain = (spans) =>
  spans.map(({ begin, end, label, p = null, confidence = null }) => ({ begin, end, label, p, confidence }));

/**
 * @param {any[]} spans
 * @param {number} chosen
 * @param {{choose: (k: number) => void, changed: () => void, remove: (k: number) => void}} page
 */
export function showSpans(spans, chosen, page) {
  const row = (/** @type {any} */ span, /** @type {number} */ k) => {
    /** @type {(which: "begin"|"end"|"label", words: string, options: any) => HTMLElement} */
    const field = (which, words, options) => {
      const input = make("input", {
        "aria-label": `${words} of span ${k + 1}`,
        "data-key": `span ${k} ${which === "label" ? "name" : which}`,
        on: { focus: () => page.choose(k) },
        ...options,
      });
      const isTime = which !== "label";
      input.value = isTime ? span[which].toFixed(2) : (span.label ?? "");
      input.addEventListener("change", () => {
        const value = isTime ? input.valueAsNumber : input.value.trim() || null;
        if (!Number.isNaN(value)) Object.assign(span, { [which]: value, ...BY_HAND });
        page.changed();
      });
      return make("td", { class: isTime ? null : "wide" }, input);
    };
    const time = { type: "number", step: "0.01", readOnly: k !== chosen };
    const p = Number.isFinite(span.p) ? `p = ${span.p.toFixed(2)}` : "–";
    const away = button("×", () => page.remove(k), {
      ...{ class: "button quiet square", "aria-label": `Remove span ${k + 1}`, hidden: k !== chosen },
    });
    return make(
      "tr",
      { class: k === chosen ? "chosen" : null, on: { click: () => page.choose(k) } },
      field("begin", "Begin", time),
      field("end", "End", time),
      field("label", "Name", { type: "text", list: "names", maxLength: "200", placeholder: "unknown" }),
      make("td", { title: p }, span.certainty ?? p),
      make("td", {}, away),
    );
  };
  byId("spans").hidden = !spans.length;
  keepingFocus(() => fill(byId("spans").tBodies[0], ...spans.map(row)));
}

/** Mark the row of the chosen one; its times can be typed. @param {number} chosen */
export function markRow(chosen) {
  for (const [k, row] of [...byId("spans").tBodies[0].rows].entries()) {
    row.classList.toggle("chosen", k === chosen);
    for (const part of row.querySelectorAll("button")) part.hidden = k !== chosen;
    /** @type {NodeListOf<HTMLInputElement>} */
    const times = row.querySelectorAll("[type=number]");
    for (const time of times) time.readOnly = k !== chosen;
  }
}
