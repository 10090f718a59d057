// What was found, as a table: times and names can be typed, a row can be removed.
import { byId, fill, keepingFocus, make } from "../parts/elements.js";

export const BY_HAND = { p: null, confidence: null, certainty: null }; // they were of what was found

/** The p-value of what was found. @param {any} span */
const said = ({ p = null }) => (p === null ? null : p.toFixed(2));

/**
 * @param {any[]} spans
 * @param {number} chosen
 * @param {{choose: (k: number) => void, changed: () => void, remove: (k: number) => void}} page
 */
export function showSpans(spans, chosen, page) {
  const time = (/** @type {any} */ span, /** @type {number} */ k, /** @type {"begin"|"end"} */ which) => {
    const field = make("input", {
      type: "number",
      step: "0.01",
      disabled: k !== chosen,
      "aria-label": `${which === "begin" ? "Begin" : "End"} of span ${k + 1}`,
      "data-key": `span ${k} ${which}`,
      on: { focus: () => page.choose(k) },
    });
    field.value = span[which].toFixed(2);
    field.addEventListener("change", () => {
      if (Number.isFinite(field.valueAsNumber)) Object.assign(span, { [which]: field.valueAsNumber, ...BY_HAND });
      page.changed();
    });
    return field;
  };
  const name = (/** @type {any} */ span, /** @type {number} */ k) => {
    const field = make("input", {
      type: "text",
      list: "names",
      maxlength: "200",
      placeholder: "unknown",
      "aria-label": `Name of span ${k + 1}`,
      "data-key": `span ${k} name`,
      on: { focus: () => page.choose(k) },
    });
    field.value = span.label ?? "";
    field.addEventListener("change", () => {
      Object.assign(span, { label: field.value.trim() || null, ...BY_HAND });
      page.changed();
    });
    return field;
  };
  const away = (/** @type {number} */ k) =>
    make(
      "button",
      {
        class: "button quiet square",
        type: "button",
        disabled: k !== chosen,
        "aria-label": `Remove span ${k + 1}`,
        on: { click: () => page.remove(k) },
      },
      "×",
    );
  const row = (/** @type {any} */ span, /** @type {number} */ k) =>
    make(
      "tr",
      { class: k === chosen ? "chosen" : null, on: { click: () => page.choose(k) } },
      make("td", {}, time(span, k, "begin")),
      make("td", {}, time(span, k, "end")),
      make("td", { class: "wide" }, name(span, k)),
      make("td", { title: said(span) && `p-value ${said(span)}` }, (said(span) && span.certainty) || said(span) || "–"),
      make("td", {}, away(k)),
    );
  byId("spans").hidden = !spans.length;
  keepingFocus(() => fill(byId("spans").tBodies[0], ...spans.map(row)));
}

/** Mark the row of the chosen one; its times can be typed. @param {number} chosen */
export function markRow(chosen) {
  for (const [k, row] of [...byId("spans").tBodies[0].rows].entries()) {
    row.classList.toggle("chosen", k === chosen);
    /** @type {NodeListOf<HTMLButtonElement>} */
    const parts = row.querySelectorAll("[type=number], button");
    for (const part of parts) part.disabled = k !== chosen;
  }
}
