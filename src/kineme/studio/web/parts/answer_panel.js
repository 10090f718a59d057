// What it is: a word, how far along, the candidates with their bars. Rows stay where they are.
// The studio and the page of a snapshot have the same one; only the studio has a meter, and words to be spoken.
import { breakable, byId, fill, make, write } from "./elements.js";

const ROWS = 5;
const BEGUN = 0.1; // share of the path from which unknown is said: every beginning is unlike the whole
const percent = (/** @type {number} */ share) => `${Math.round(100 * Math.min(Math.max(share, 0), 1))} %`;
const capital = (/** @type {string} */ word) => word[0].toUpperCase() + word.slice(1);
const pValue = (/** @type {number} */ p) => (p < 0.001 ? "< 0.001" : p.toFixed(p < 0.1 ? 3 : 2));

/** @param {string} name */
function row(name) {
  const parts = {
    name: make("span", { class: "rank-name" }, name),
    value: make("span", { class: "rank-value numbers" }),
    bar: make("span", { class: "fill" }),
  };
  return {
    ...parts,
    element: make(
      "li",
      { class: "rank" },
      parts.name,
      parts.value,
      make("span", { class: "meter", "aria-hidden": "true" }, parts.bar),
    ),
  };
}

export class AnswerPanel {
  /** @param {{advice?: string, invitation?: () => string}} [page] Advice for an answer; what to do with a new one. */
  constructor({ advice = "", invitation = () => "" } = {}) {
    this.advice = advice;
    this.invitation = invitation;
    this.rows = [...Array(ROWS)].map(() => row("\u00a0"));
    fill(byId("ranks"), ...this.rows.map((line) => line.element));
    this.last = "";
    this.idle();
  }

  idle() {
    this.words("Nothing drawn yet", "–", "\u00a0", "open");
    this.progress(0);
    this.list([]);
    this.why([]);
  }

  /**
   * @param {string} kind
   * @param {string} word
   * @param {string} note
   * @param {string} state open, doubtful, known or unknown
   */
  words(kind, word, note, state) {
    write(byId("verdict-kind"), kind);
    if (byId("verdict").textContent !== word) fill(byId("verdict"), ...breakable(word));
    byId("verdict").title = word;
    write(byId("verdict-note"), note || "\u00a0");
    byId("verdict").parentElement.dataset.state = state;
  }

  /** @param {string[]} reasons Sentences with the numbers, for who asks. */
  why(reasons) {
    byId("why").hidden = !reasons.length;
    fill(byId("why-text"), ...reasons.map((text) => make("p", {}, text)));
  }

  /** @param {number} share */
  progress(share) {
    const meter = byId("draw-progress");
    if (!meter) return;
    meter.setAttribute("aria-valuenow", String(Math.round(100 * share)));
    /** @type {HTMLElement} */ (meter.firstElementChild).style.setProperty("--share", String(share));
  }

  /**
   * How likely each name is, if it is a known one: the same while it is drawn and after.
   * @param {{label: string, probability: number|null}[]} ranked
   */
  list(ranked) {
    write(byId("ranks-kind"), "If it is a known one");
    for (const [k, row] of this.rows.entries())
      this.set(row, ranked[k]?.label ?? "\u00a0", ranked[k]?.probability ?? null);
  }

  set(/** @type {any} */ line, /** @type {string} */ name, /** @type {number|null} */ value) {
    write(line.name, name);
    write(line.value, value === null ? "" : percent(value));
    line.bar.style.setProperty("--share", String(value ?? 0));
    line.element.classList.toggle("nothing", value === null);
  }

  /** While it is drawn. @param {any} state @param {number} now Time of the last sample [s]. */
  drawing(state, now) {
    const best = state.ranked[0];
    const left = Number.isFinite(state.arrival) && state.arrival !== null ? Math.max(state.arrival - now, 0) : null;
    const note = [
      state.progress === null ? "" : `${percent(state.progress)} of the path`,
      left === null ? "" : `arrives in ${left.toFixed(1)} s`,
    ]
      .filter(Boolean)
      .join(", ");
    const name = state.label ?? best?.label;
    if (!best || (state.label === null && state.progress < BEGUN)) this.words("Still open", "…", note, "open");
    else if (state.certainty === "new") this.words("New, so far", "Unknown", `most like ${best.label}`, "doubtful");
    else this.words(`${capital(state.certainty)}, so far`, name, note, state.label === null ? "open" : "known");
    this.progress(state.progress ?? 0);
    this.list(state.ranked);
    this.why([]);
    if (state.label !== null && state.certainty !== "new") this.speak(`${capital(state.certainty)} ${name}, so far.`);
  }

  /** Of the whole movement. @param {any} answer */
  final(answer) {
    const [best] = answer.ranked;
    const isNew = answer.certainty === "new";
    const word = capital(answer.certainty);
    const like = isNew ? `most like ${best.label}` : "";
    const guess = answer.rule === "guess" && (!isNew || this.advice) ? "more drawings of each would say how sure" : "";
    const note = this.noteOf([like, guess].filter(Boolean), isNew ? "" : this.advice);
    if (isNew) this.words(word, "Unknown", note, "unknown");
    else this.words(word, answer.label, note, answer.certainty === "looks like" ? "open" : "known");
    this.progress(1);
    this.list(answer.ranked);
    const nearest = answer.nearest?.[0];
    this.why(
      [
        answer.p_known === null ? "" : `p-value of being known: ${pValue(answer.p_known)}`,
        `p-values of names: ${answer.ranked
          .slice(0, ROWS)
          .filter((/** @type {any} */ candidate) => candidate.p_value !== null)
          .map((/** @type {any} */ candidate) => `${candidate.label} ${pValue(candidate.p_value)}`)
          .join(", ")}`,
        nearest ? `similarity to the nearest: ${nearest.similarity.toFixed(2)}` : "",
        answer.promise,
      ].filter(Boolean),
    );
    this.speak(isNew ? `New: unknown.${this.invitation()}` : `${word} ${answer.label}.`);
  }

  /** Phrases alone, or as sentences with advice behind them. @param {string[]} phrases @param {string} advice */
  noteOf(phrases, advice) {
    if (!this.advice) return phrases.join("; ");
    return [...phrases.map((phrase) => `${capital(phrase)}.`), advice].join(" ");
  }

  /** To a screen reader, once each. @param {string} text */
  speak(text) {
    if (text === this.last || !byId("spoken")) return;
    this.last = text;
    byId("spoken").textContent = text;
  }
}
