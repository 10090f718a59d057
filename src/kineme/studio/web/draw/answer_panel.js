// What it is: a word, how far along, the candidates with their bars. Rows stay where they are.
import { breakable } from "../parts/breakable.js";
import { byId, fill, make, write } from "../parts/elements.js";
import { library } from "../parts/library_state.js";

const ROWS = 5;
const BEGUN = 0.1; // share of the path from which unknown is said: every beginning is unlike the whole
const percent = (/** @type {number} */ share) => `${Math.round(100 * share)} %`;
const pValue = (/** @type {number} */ p) => (p < 0.001 ? "< 0.001" : p.toFixed(p < 0.1 ? 3 : 2));

/** @param {string} name */
function row(name) {
  const parts = { name: make("span", { class: "rank-name" }, name), value: make("span", { class: "rank-value numbers" }), bar: make("span", { class: "fill" }) };
  return { ...parts, element: make("li", { class: "rank" }, parts.name, parts.value, make("span", { class: "meter", "aria-hidden": "true" }, parts.bar)) };
}

export class AnswerPanel {
  constructor() {
    this.rows = [...Array(ROWS)].map(() => row("\u00a0"));
    this.unknown = row("unknown");
    this.unknown.element.classList.add("unknown");
    fill(byId("ranks"), ...this.rows.map((one) => one.element), this.unknown.element);
    this.last = "";
    this.idle();
  }

  idle() {
    this.words("Nothing drawn yet", "–", "\u00a0", "open");
    this.progress(0);
    this.kind("Evidence for each name");
    this.list([], null, percent);
  }

  /** @param {string} kind @param {string} word @param {string} note @param {string} state open, known, unknown */
  words(kind, word, note, state) {
    write(byId("verdict-kind"), kind);
    if (byId("verdict").textContent !== word) fill(byId("verdict"), ...breakable(word));
    write(byId("verdict-note"), note || "\u00a0");
    byId("verdict").parentElement.dataset.state = state;
  }

  /** @param {string} text What the bars mean. */
  kind(text) {
    write(byId("ranks-kind"), text);
  }

  /** @param {number} share */
  progress(share) {
    const meter = byId("draw-progress");
    meter.setAttribute("aria-valuenow", String(Math.round(100 * share)));
    meter.firstElementChild.style.setProperty("--share", String(share));
  }

  /** @param {{name: string, value: number}[]} ranked @param {number|null} unknown @param {(value: number) => string} text */
  list(ranked, unknown, text) {
    this.rows.forEach((one, k) => this.set(one, ranked[k]?.name ?? "\u00a0", ranked[k]?.value ?? null, text));
    this.set(this.unknown, "unknown", unknown, text);
  }

  set(/** @type {any} */ one, /** @type {string} */ name, /** @type {number|null} */ value, /** @type {(value: number) => string} */ text) {
    write(one.name, name);
    write(one.value, value === null ? "" : text(value));
    one.bar.style.setProperty("--share", String(value ?? 0));
    one.element.classList.toggle("nothing", value === null);
  }

  /** While it is drawn. @param {any} state @param {number} now Time of the last sample [s]. */
  drawing(state, now) {
    const best = state.ranked[0];
    const unknown = state.unknown ?? 0;
    const left = Number.isFinite(state.arrival) && state.arrival !== null ? Math.max(state.arrival - now, 0) : null;
    const note = [state.progress === null ? "" : `${percent(state.progress)} of the path`, left === null ? "" : `arrives in ${left.toFixed(1)} s`];
    if (state.decided !== null) this.words("Decided while drawing", state.decided, note.filter(Boolean).join(", "), "known");
    else if (best && best.share >= 0.5) this.words("Probably", best.name, note.filter(Boolean).join(", "), "open");
    else if (unknown > 0.5 && state.progress >= BEGUN) this.words("Probably", "Unknown", "like nothing that is known so far", "open");
    else this.words("Still open", "…", note.filter(Boolean).join(", "), "open");
    this.progress(state.progress ?? 0);
    this.kind("Evidence for each name so far");
    this.list(state.ranked.map((/** @type {any} */ one) => ({ name: one.name, value: one.share })), state.unknown, percent);
    if (state.decided !== null) this.speak(`Decided: ${state.decided}`);
  }

  /** Of the whole movement. @param {any} answer */
  final(answer) {
    const ranked = answer.ranked.map((/** @type {any} */ one) => ({ name: one.name, value: one.p_value ?? 0 }));
    const nearest = answer.nearest?.[0];
    const like = nearest ? `similarity ${nearest.similarity.toFixed(2)}` : "";
    if (answer.label === null) this.words("The answer", "Unknown", `unlike everything that is known${answer.p_known === null ? "" : `, p-value ${pValue(answer.p_known)}`}`, "unknown");
    else {
      const p = ranked.find((/** @type {any} */ one) => one.name === answer.label)?.value;
      const sure = answer.calibrated ? `p-value ${pValue(p ?? 0)}` : "a guess until more is drawn";
      this.words(answer.calibrated ? "This is" : "Most like", answer.label, [sure, like].filter(Boolean).join(", "), answer.calibrated ? "known" : "open");
    }
    this.progress(1);
    this.kind("p-value of each name");
    this.list(ranked, null, pValue);
    this.speak(answer.label === null ? `Unknown.${library().read_only ? "" : " Give it a name."}` : `${answer.calibrated ? "This is" : "Most like"} ${answer.label}.`);
  }

  /** To a screen reader, once each. @param {string} text */
  speak(text) {
    if (text === this.last) return;
    this.last = text;
    byId("spoken").textContent = text;
  }
}
