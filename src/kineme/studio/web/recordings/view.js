// Recordings: a file, its channels, what was found in it, corrected and learned.
import { get, post } from "../parts/api.js";
import { learnSpans } from "../parts/changes.js";
import { byId, counted, fill, make } from "../parts/elements.js";
import { COLORS, library, onLibrary } from "../parts/library_state.js";
import { ask } from "../parts/dialogs.js";
import { tried } from "../parts/toasts.js";
import { startDropping } from "./dropping.js";
import { Episodes } from "./episodes.js";
import { columnCount, fitting, mismatch } from "./fitting.js";
import { Player } from "./player.js";
import { markRow, showSpans } from "./spans.js";
import { Timeline } from "./timeline.js";

const SHORT = 10; // a recording of one movement [s]
const ASKED = 400; // how often it is asked how much is searched [ms]

/** What an episode is called above its signals. @param {any} episode */
const nameOf = ({ number, task, place }) => `Episode ${number}: ${task ?? place}`;

/**
 * Names of the channels that are chosen at first: of an episode those of the library, or of its first feature.
 * @param {any} recording @param {any} table @returns {Set<string>}
 */
const chosenOf = ({ chosen }, { channels }) => {
  const named = (/** @type {string[]} */ names) =>
    channels.filter((/** @type {any} */ channel) => names.includes(channel.name));
  const ours = (library().channels ?? []).map((/** @type {any} */ channel) => channel.name);
  const own = !chosen ? channels : ours.length && named(ours).length === ours.length ? named(ours) : named(chosen);
  const fits = !library().symbols.length || !mismatch(own, library());
  return fitting(chosen && fits ? own : channels, library());
};

class Recordings {
  constructor() {
    this.read = null;
    /** @type {AbortController|null} Of the search that is under way. */
    this.search = null;
    this.page = {
      choose: (/** @type {number} */ k) => this.choose(k),
      changed: () => this.corrected(),
      seek: (/** @type {number} */ time) => this.player.seek(time),
      key: (/** @type {KeyboardEvent} */ event) => this.player.key(event),
    };
    this.timeline = new Timeline(this.page);
    this.player = new Player((time) => this.timeline.goTo(time));
    this.episodes = new Episodes({
      open: (detail) => this.open(detail, nameOf(detail.episode)),
      channels: (detail) => [...chosenOf(detail, detail.tables[0])],
      spotted: (key, spans) => key === this.read?.recording && this.spotted(spans),
    });
    startDropping((recording, name) => this.open(recording, name));
    byId("spot").addEventListener("click", () => (this.search ? this.search.abort() : this.spot()));
    byId("add-span").addEventListener("click", () => this.add());
    byId("learn-spans").addEventListener("click", () => this.learn());
    byId("learn-file").addEventListener("click", () =>
      learnSpans(this.read.recording, { channels: this.chosenChannels() }),
    );
    for (const [id, factor] of /** @type {[string, number][]} */ ([
      ["zoom-in", 0.6],
      ["zoom-out", 1 / 0.6],
    ]))
      byId(id).addEventListener("click", () => this.timeline.zoom(factor));
    byId("tables").addEventListener("change", () => this.table());
    byId("channels").addEventListener("change", () => this.columns());
    onLibrary(() => {
      this.allow();
      this.timeline.board.draw();
    });
  }

  /** @param {any} recording @param {string} name */
  open(recording, name) {
    this.read = recording;
    byId("recording").hidden = false;
    byId("drop").classList.add("small-drop");
    byId("recording-name").textContent = name;
    fill(
      byId("tables"),
      ...recording.tables.map((/** @type {any} */ table, /** @type {number} */ k) =>
        make("option", { value: String(k) }, table.name),
      ),
    );
    byId("tables-part").hidden = recording.tables.length < 2;
    const labeled = recording.tables.filter((/** @type {any} */ table) => table.label !== null);
    const labels = [...new Set(labeled.map((/** @type {any} */ table) => table.label))].slice(0, 8).join(", ");
    byId("learn-file").hidden = recording.tables.length < 2 || !labeled.length;
    byId("learn-file").title =
      `${counted(recording.tables.length, "movement")}, ${labeled.length} with a label: ${labels}`;
    fill(
      byId("problems"),
      ...recording.problems.map((/** @type {string} */ problem) => make("p", { class: "small" }, problem)),
    );
    this.table();
    byId(recording.episode ? "timeline-canvas" : "spot").focus({ preventScroll: true });
    if (recording.episode) byId("recording").scrollIntoView({ block: "start" });
  }

  /** Another table, of this file or of a new one: what is still searched for is about the one before. */
  table() {
    this.search?.abort();
    this.over("");
    const k = Number(byId("tables").value);
    const table = this.read.tables[k];
    const rate = table.rate ? `, ${Math.round(table.rate)} samples a second` : "";
    byId("recording-facts").textContent =
      `${table.duration.toFixed(1)} s, ${counted(table.channels.length, "channel")}${rate}`;
    const chosen = chosenOf(this.read, table);
    const box = (/** @type {any} */ channel, /** @type {number} */ k) => {
      const key = make("span", { class: "key" });
      key.style.borderColor = `var(${COLORS[columnCount(table.channels.slice(0, k)) % COLORS.length]})`;
      return make(
        "label",
        { class: "check" },
        make("input", { type: "checkbox", checked: chosen.has(channel.name), value: channel.name }),
        key,
        make(
          "span",
          {},
          channel.name,
          make("span", { class: "soft small says" }, [channel.kind, channel.unit].filter(Boolean).join(", ")),
        ),
      );
    };
    fill(byId("channels"), make("legend", {}, "Channels"), ...table.channels.map(box));
    this.timeline.spans = table.label === null ? [] : [{ begin: 0, end: table.duration, label: table.label, p: null }];
    if (this.read.episode) this.timeline.spans = this.read.episode.spans;
    this.columns();
    this.timeline.show(this.shownPlot());
    this.player.open(table.duration, this.read.videos ?? []);
    this.changed();
  }

  chosenChannels() {
    /** @type {NodeListOf<HTMLInputElement>} */
    const boxes = byId("channels").querySelectorAll("input:checked");
    return [...boxes].map((box) => box.value);
  }

  /** The plot with the columns of the chosen channels. */
  shownPlot() {
    const k = Number(byId("tables").value);
    const plot = this.read.plots[k];
    const names = new Set(this.chosenChannels());
    const wanted = new Set(
      this.read.tables[k].channels
        .filter((/** @type {any} */ channel) => names.has(channel.name))
        .flatMap((/** @type {any} */ channel) => channel.columns ?? [channel.name]),
    );
    const columns = plot.columns
      .map((/** @type {any} */ column, /** @type {number} */ at) => ({ ...column, color: COLORS[at % COLORS.length] }))
      .filter((/** @type {any} */ column) => wanted.has(column.name) || names.has(column.name));
    return { ...plot, columns };
  }

  columns() {
    this.timeline.plot = this.shownPlot();
    this.timeline.board.draw();
    this.allow();
  }

  body() {
    return { table: this.read.tables[Number(byId("tables").value)].name, channels: this.chosenChannels() };
  }

  async spot() {
    const { recording, episode } = this.read;
    const question = {
      title: "Look again?",
      text: "What is found takes the place of what was corrected in this episode.",
      yes: "Look again",
    };
    if (episode?.corrected && !(await ask(question))) return;
    const path = `/api/recordings/${encodeURIComponent(recording)}/spotted`;
    const search = new AbortController();
    this.search = search;
    this.allow();
    byId("spans-state").textContent = "Looking …";
    const timer = setInterval(() => this.tell(path, search), ASKED);
    const answer = await tried(() => post(path, this.body(), search.signal));
    clearInterval(timer);
    if (this.search === search) this.over(search.signal.aborted ? "Canceled; nothing was changed." : "");
    if (!answer || search.signal.aborted) return;
    if (episode) this.episodes.put(recording, answer.spans, false);
    this.spotted(answer.spans);
  }

  /** Show what was found. @param {any[]} spans */
  spotted(spans) {
    this.timeline.spans = spans;
    if (this.read.episode) Object.assign(this.read.episode, { spans, corrected: false });
    this.choose(-1);
    this.changed();
    const named = spans.filter((span) => span.label !== null).length;
    const advice = spans.length ? " Choose one to drag its edges." : "";
    byId("spans-state").textContent = `${counted(named, "known movement")}, ${spans.length - named} unknown.${advice}`;
  }

  /** A person has changed what an episode shows: it is kept. */
  corrected() {
    this.changed();
    if (!this.read?.episode) return;
    this.read.episode.corrected = true;
    this.episodes.put(this.read.recording, this.timeline.spans, true);
  }

  /** How much is searched. @param {string} path @param {AbortController} search */
  async tell(path, search) {
    const progress = await get(path).catch(() => null);
    if (this.search === search && progress?.share)
      byId("spans-state").textContent = `Looking … ${Math.floor(100 * progress.share)} %`;
  }

  /** @param {string} text */
  over(text) {
    this.search = null;
    this.allow();
    byId("spans-state").textContent = text;
  }

  /** A span in the middle of what is shown; the first one of a short recording is all of it. */
  add() {
    const [from, to] = this.timeline.range;
    const aside = !this.timeline.spans.length && to - from < SHORT ? 0 : 0.4 * (to - from);
    this.timeline.spans.push({ begin: from + aside, end: to - aside, label: null, p: null });
    this.corrected();
    this.choose(this.timeline.spans.length - 1);
    /** @type {HTMLElement} */ (byId("spans").querySelector("tr:last-child input[type=text]")).focus();
  }

  /** @param {number} k -1 for none. */
  choose(k) {
    if (this.timeline.chosen === k) return;
    this.timeline.chosen = k;
    this.timeline.board.now();
    markRow(k);
  }

  changed() {
    showSpans(this.timeline.spans, this.timeline.chosen, this.page);
    this.timeline.board.draw();
    this.allow();
  }

  allow() {
    if (!this.read) return;
    const table = this.read.tables[Number(byId("tables").value)];
    const names = new Set(this.chosenChannels());
    const wrong = mismatch(
      table.channels.filter((/** @type {any} */ channel) => names.has(channel.name)),
      library(),
    );
    byId("channels-note").textContent = wrong;
    byId("spot").textContent = this.search ? "Cancel" : "Find movements";
    byId("spot").disabled = wrong !== "" && !this.search;
    byId("learn-file").disabled = library().read_only || !names.size || (wrong !== "" && library().symbols.length > 0);
    byId("learn-spans").disabled = library().read_only || !this.timeline.spans.some((span) => span.label !== null);
  }

  async learn() {
    const spans = this.timeline.spans
      .filter((span) => span.label !== null)
      .map(({ begin, end, label }) => ({ begin, end, label }));
    await learnSpans(this.read.recording, { ...this.body(), spans });
  }
}

export function startRecordings() {
  new Recordings();
}
