// What it is: a word, what it is like, the candidates with their bars, and why. Rows stay where they are.
// The studio and the page of a snapshot have the same one; only the studio has a meter, and words to be spoken.
import { breakable, byId, fill, make, write } from "./elements.js";
import { Overlay } from "./overlay.js";

const ROWS = 5;
const BEGUN = 0.1; // share of the path from which a name is said: every beginning is unlike the whole
const ALIKE = 0.05; // of the size: differences that are no more than people's hands
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

/** Where and by how much a drawing differs from an example. @param {any} overlay Of an explanation. */
function differs({ largest_difference: most, from, to }) {
  const size = `${Math.round(100 * most)} % of its size`;
  return most <= ALIKE
    ? `nowhere off by more than ${size}`
    : `off by up to ${size}, at ${percent(from)} to ${percent(to)} of the path`;
}

export class AnswerPanel {
  /** @param {{picture?: (name: string) => number[][]|null, advice?: () => string}} page */
  constructor({ picture = () => null, advice = () => "" } = {}) {
    this.page = { picture, advice };
    this.rows = [...Array(ROWS)].map(() => row("\u00a0"));
    fill(byId("ranks"), ...this.rows.map((line) => line.element));
    this.nearest = new Overlay(byId("nearest"));
    this.overlays = [0, 1].map(() => {
      const [canvas, caption] = [make("canvas", { "aria-hidden": "true" }), make("figcaption")];
      byId("why-pictures").append(make("figure", {}, canvas, caption));
      return { overlay: new Overlay(canvas), caption };
    });
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
   * @param {string} kind @param {string} word @param {string} note
   * @param {string} state open, doubtful, known or unknown
   * @param {string|null} like The symbol whose picture is beside them.
   */
  words(kind, word, note, state, like = null) {
    write(byId("verdict-kind"), kind);
    if (byId("verdict").textContent !== word) fill(byId("verdict"), ...breakable(word));
    byId("verdict").title = word;
    write(byId("verdict-note"), note || "\u00a0");
    byId("verdict").parentElement.dataset.state = state;
    if (like === this.like) return;
    this.like = like;
    this.show(like && this.page.picture(like));
  }

  /** Beside the words: an example. @param {number[][]|null} path */
  show(path) {
    byId("nearest").hidden = !path;
    byId("nearest").setAttribute("aria-label", `Like an example of ${this.like}`);
    this.nearest.show(path && { path });
  }

  /** @param {string[]} reasons Sentences with the numbers, for who asks. */
  why(reasons) {
    byId("why").hidden = !reasons.length;
    byId("why-pictures").hidden = true;
    this.answer = null;
    fill(byId("why-text"), ...reasons.map((text) => make("p", {}, text)));
  }

  /** The drawing over its nearest example, and over the runner-up. @param {any} explanation */
  explain({ path: drawn, nearest, runner_up: other }) {
    byId("why-pictures").hidden = false;
    this.show(nearest.path);
    for (const [k, shown] of [nearest, other].entries()) {
      const { overlay, caption } = this.overlays[k];
      caption.parentElement.hidden = !shown;
      if (!shown) continue;
      overlay.show({ ...shown, drawn });
      write(
        caption,
        `${k ? "Next" : "Nearest"}: ${shown.label}, ${shown.similarity.toFixed(2)} alike; ${differs(shown)}`,
      );
    }
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
    write(byId("ranks-kind"), ranked.length ? "If it is a known one" : "\u00a0");
    for (const [k, row] of this.rows.entries())
      this.set(row, ranked[k]?.label ?? "\u00a0", ranked[k]?.probability ?? null);
  }

  set(/** @type {any} */ line, /** @type {string} */ name, /** @type {number|null} */ value) {
    write(line.name, name);
    write(line.value, value === null ? "" : percent(value));
    line.bar.style.setProperty("--share", String(value ?? 0));
    line.element.classList.toggle("nothing", value === null);
  }

  /**
   * While it is drawn: it looks like something, or is open, so that the end contradicts neither.
   * @param {any} state @param {number} now Time of the last sample [s].
   */
  drawing({ ranked, label, certainty, progress, arrival }, now) {
    const name = label ?? ranked[0]?.label;
    const left = Number.isFinite(arrival) ? `, arrives in ${Math.max(arrival - now, 0).toFixed(1)} s` : "";
    const note = progress === null ? "" : `${percent(progress)} of the path${left}`;
    const isOpen = !name || (label === null && progress < BEGUN);
    if (isOpen) this.words("Still open", "…", note, "open");
    else if (!certainty) this.words("Still open", name, "Most like it so far; it may be new.", "doubtful", name);
    else this.words("Looks like, so far", name, note, label === null ? "open" : "known", name);
    this.progress(progress ?? 0);
    this.list(ranked);
    this.why([]);
    if (label !== null && certainty) this.speak(`Looks like ${name}, so far.`);
  }

  /** Of the whole movement. @param {any} answer @param {() => any} explain Its explanation, or a promise of it. */
  final(answer, explain) {
    const { label, certainty, ranked, rule, p_known: known, promise } = answer;
    const [name, word] = [label ?? ranked[0].label, capital(certainty)];
    const note = [
      label === null ? `Most like ${name}.` : "",
      rule === "guess" ? "More drawings of each would say how sure." : "",
      label === null ? "" : this.page.advice(),
    ].join(" ");
    const state = { new: "unknown", "looks like": "open" }[certainty] ?? "known";
    this.words(word, label ?? "Unknown", note.trim(), state, name);
    if (answer === this.answer) return;
    this.progress(1);
    this.list(ranked);
    const pValues = ranked
      .slice(0, ROWS)
      .filter((/** @type {any} */ candidate) => candidate.p_value !== null)
      .map((/** @type {any} */ candidate) => `${candidate.label} ${pValue(candidate.p_value)}`);
    this.why([`p-value of being known: ${pValue(known)}; of names: ${pValues.join(", ")}`, promise]);
    this.speak(label === null ? "New: unknown." : `${word} ${label}.`);
    this.answer = answer;
    const asked = async () => {
      const explanation = await explain();
      if (explanation && this.answer === answer) this.explain(explanation);
    };
    setTimeout(() => asked().catch(() => {})); // after the answer is there; without the server there are no pictures
  }

  /** To a screen reader, once each. @param {string} text */
  speak(text) {
    if (text === this.last || !byId("spoken")) return;
    this.last = text;
    byId("spoken").textContent = text;
  }
}
