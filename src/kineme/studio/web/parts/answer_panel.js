// What it is: a word, what it is like, the candidates with their bars, and why. Rows stay where they are.
// The studio and the page of a snapshot have the same one; only the studio has a meter, and words to be spoken.
import { breakable, byId, fill, make, write } from "./elements.js";
import { Overlay } from "./overlay.js";

const ROWS = 5;
const BEGUN = 0.1; // share of the path from which a name is said: every beginning is unlike the whole
const ALIKE = 0.05; // of the size: differences that are no more than people's hands
const TURNED = 10; // [degrees]: less is no more, either
const percent = (share) => `${Math.round(100 * Math.min(Math.max(share, 0), 1))} %`;
const capital = (word) => word[0].toUpperCase() + word.slice(1);
const pValue = (p) => (p < 0.001 ? "< 0.001" : p.toFixed(p < 0.1 ? 3 : 2));

function row() {
  const [name, value, bar] = ["rank-name", "rank-value numbers", "fill"].map((look) => make("span", look));
  const meter = make("span", { class: "meter", "aria-hidden": "true" }, bar);
  return { name, value, bar, element: make("li", "rank", name, value, meter) };
}

/** Where and by how much a drawing differs from an example. */
function differs({ largest_difference: most, from, to }) {
  const size = `${Math.round(100 * most)} % of its size`;
  return most <= ALIKE
    ? `nowhere off by more than ${size}`
    : `off by up to ${size}, at ${percent(from)} to ${percent(to)} of the path`;
}

export class AnswerPanel {
  /** The page has pictures of names, and may give advice. @param {any} page */
  constructor(page = {}) {
    this.page = page;
    this.rows = Array.from({ length: ROWS }, row);
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

  /** Open, doubtful, known or unknown is the state; the picture beside is of the symbol that it is like. */
  words(kind, word, note, state, like = null) {
    write(byId("verdict-kind"), kind);
    if (byId("verdict").textContent !== word) fill(byId("verdict"), ...breakable(word));
    byId("verdict").title = word;
    write(byId("verdict-note"), note || "\u00a0");
    byId("verdict").parentElement.dataset.state = state;
    if (like === this.like) return;
    this.like = like;
    this.show(like && this.page.picture?.(like));
  }

  /** Beside the words: an example. */
  show(path) {
    byId("nearest").hidden = !path;
    byId("nearest").setAttribute("aria-label", `Like an example of ${this.like}`);
    this.nearest.show(path && { path });
  }

  /** Reasons are sentences with the numbers, for who asks. */
  why(reasons) {
    byId("why").hidden = !reasons.length;
    byId("why-pictures").hidden = true;
    this.answer = null;
    fill(byId("why-text"), ...reasons.map((text) => make("p", {}, text)));
  }

  /** The drawing over its nearest example, and over the runner-up. */
  explain({ path: drawn, nearest, runner_up: other }) {
    byId("why-pictures").hidden = false;
    this.show(nearest.path);
    for (const [k, shown] of [nearest, other].entries()) {
      const { overlay, caption } = this.overlays[k];
      caption.parentElement.hidden = !shown;
      if (!shown) continue;
      overlay.show({ ...shown, drawn });
      const turn = Math.abs(shown.turned) < TURNED ? "" : ` turned by ${Math.round(shown.turned)}°`;
      const alike = `${shown.label}${turn}, ${shown.similarity.toFixed(2)} alike`;
      write(caption, `${k ? "Next" : "Nearest"}: ${alike}; ${differs(shown)}`);
    }
  }

  progress(share) {
    const meter = byId("draw-progress");
    meter?.setAttribute("aria-valuenow", String(Math.round(100 * share)));
    meter?.querySelector("div").style.setProperty("--share", share);
  }

  /** How likely each name is, if it is a known one: the same while it is drawn and after. */
  list(ranked) {
    write(byId("ranks-kind"), ranked.length ? "If it is a known one" : "\u00a0");
    for (const [k, { name, value, bar, element }] of this.rows.entries()) {
      const { label = "\u00a0", probability = null } = ranked[k] ?? {};
      write(name, label);
      write(value, probability === null ? "" : percent(probability));
      bar.style.setProperty("--share", String(probability ?? 0));
      element.classList.toggle("nothing", probability === null);
    }
  }

  /** While it is drawn, until now [s]: it looks like something, or is open, so that the end contradicts neither. */
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

  /** Of the whole movement; `explain` gives its explanation, or a promise of it. */
  final(answer, explain) {
    const { label, certainty, ranked, rule, p_known: known, promise } = answer;
    const [name, word] = [label ?? ranked[0].label, capital(certainty)];
    const note = [
      label === null ? `Most like ${name}.` : "",
      rule === "guess" ? "More drawings of each would say how sure." : "",
      label === null ? "" : this.page.advice?.(),
    ].join(" ");
    const state = { new: "unknown", "looks like": "open" }[certainty] ?? "known";
    this.words(word, label ?? "Unknown", note.trim(), state, name);
    if (answer === this.answer) return;
    this.progress(1);
    this.list(ranked);
    const pValues = ranked
      .slice(0, ROWS)
      .filter(({ p_value: p }) => p !== null)
      .map(({ label, p_value: p }) => `${label} ${pValue(p)}`);
    this.why([`p-value of being known: ${pValue(known)}; of names: ${pValues.join(", ")}`, promise]);
    this.speak(label === null ? "New: unknown." : `${word} ${label}.`);
    this.answer = answer;
    // After the answer is there; without the server there are no pictures.
    setTimeout(async () => {
      const explanation = await Promise.resolve()
        .then(explain)
        .catch(() => null);
      if (explanation && this.answer === answer) this.explain(explanation);
    });
  }

  /** To a screen reader, once each. */
  speak(text) {
    if (text === this.last || !byId("spoken")) return;
    this.last = text;
    byId("spoken").textContent = text;
  }
}
