// What was found, as a table: times and names can be typed, a row can be removed.
import { byId, fill, keepingFocus, make } from "../parts/elements.js";

export const BY_HAND = { p: null, confidence: null }; // they were of what was found

/** @param {any[]} spans @param {number} chosen @param {{choose: (k: number) => void, changed: () => void}} page */
export function showSpans(spans, chosen, page) {
  const time = (/** @type {any} */ span, /** @type {number} */ k, /** @type {"begin"|"end"} */ which) => {
    const field = make("input", {
      type: "number",
      step: "0.01",
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
  const remove = (/** @type {number} */ k) => {
    spans.splice(k, 1);
    page.choose(-1);
    page.changed();
  };
  const away = (/** @type {number} */ k) =>
    make(
      "button",
      {
        class: "button quiet square",
        type: "button",
        "aria-label": `Remove span ${k + 1}`,
        on: { click: () => remove(k) },
      },
      "×",
    );
  const row = (/** @type {any} */ span, /** @type {number} */ k) =>
    make(
      "tr",
      { class: k === chosen ? "chosen" : null },
      make("td", {}, time(span, k, "begin")),
      make("td", {}, time(span, k, "end")),
      make("td", { class: "wide" }, name(span, k)),
      make("td", {}, span.p === null || span.p === undefined ? "–" : span.p.toFixed(2)),
      make("td", {}, away(k)),
    );
  byId("spans").hidden = !spans.length;
  keepingFocus(() => fill(byId("spans").tBodies[0], ...spans.map(row)));
}

/** Mark the row of the chosen one. @param {number} chosen */
export function markRow(chosen) {
  for (const [k, row] of [...byId("spans").tBodies[0].rows].entries()) row.classList.toggle("chosen", k === chosen);
}
