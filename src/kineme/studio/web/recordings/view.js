// Recordings: a file, its channels, what was found in it, corrected and learned.
import { download, get, post } from "../parts/api.js";
import { learnSpans, undo } from "../parts/changes.js";
import { byId, counted, fill, make } from "../parts/elements.js";
import { COLORS, library, onLibrary } from "../parts/library_state.js";
import { ask } from "../parts/dialogs.js";
import { isUndo } from "../parts/shortcuts.js";
import { tried } from "../parts/toasts.js";
import { currentView } from "../parts/views.js";
import { startDropping } from "./dropping.js";
import { Episodes } from "./episodes.js";
import { columnCount, fitting, mismatch } from "./fitting.js";
import { askHow } from "./importing.js";
import { Player } from "./player.js";
import { ShapeView } from "./shapes.js";
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
      add: () => this.add(),
      remove: (/** @type {number} */ k) => this.remove(k),
      seek: (/** @type {number} */ time) => this.player.seek(time),
      key: (/** @type {KeyboardEvent} */ event) => this.player.key(event),
    };
    this.timeline = new Timeline(this.page);
    this.shape = new ShapeView();
    this.player = new Player((time) => this.goTo(time));
    /** @type {string[]} What the spans were before each change, and after those that were taken back; last their now. */
    this.past = [];
    /** @type {string[]} */
    this.future = [];
    this.episodes = new Episodes({
      open: (detail) => this.open(detail, nameOf(detail.episode)),
      channels: (detail) => [...chosenOf(detail, detail.tables[0])],
      spotted: (key, spans) => key === this.read?.recording && this.spotted(spans),
    });
    startDropping(
      (recording, name) => this.open(recording, name),
      (file) => Boolean(this.read) && this.player.add(file),
    );
    byId("undo-span").addEventListener("click", () => this.step(this.past, this.future));
    byId("redo-span").addEventListener("click", () => this.step(this.future, this.past));
    document.addEventListener("keydown", (event) => this.key(event));
    byId("save-spans").addEventListener("click", () => tried(() => this.save()));
    byId("read-as").addEventListener("click", async () => {
      const name = byId("recording-name").textContent;
      const recording = await askHow({ ...this.read, unclear: "" }, name);
      if (recording) this.open(recording, name);
    });
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
    byId("read-as").hidden = !recording.preview;
    byId("shell").textContent = recording.command;
    fill(
      byId("save-format"),
      ...recording.formats.map((/** @type {any} */ form) => make("option", { value: form.name }, form.text)),
    );
    recording.videos ??= [];
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
    Object.assign(this, { past: [], future: [], now: JSON.stringify(this.timeline.spans) });
    this.columns();
    this.timeline.show(this.shownPlot());
    this.player.open(table.duration, this.read.videos);
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
    for (const { shapes } of [this.timeline, this.shape]) shapes.open(this.read.recording, this.body());
    this.timeline.board.draw();
    this.shape.board.draw();
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
    this.take(spans);
    if (this.read.episode) this.read.episode.corrected = false;
    this.keep();
    const named = spans.filter((span) => span.label !== null).length;
    const advice = spans.length ? " Choose one to drag its edges." : "";
    byId("spans-state").textContent = `${counted(named, "known movement")}, ${spans.length - named} unknown.${advice}`;
  }

  /** Show other spans. @param {any[]} spans */
  take(spans) {
    this.timeline.spans = spans;
    if (this.read.episode) this.read.episode.spans = spans;
    this.choose(-1);
    this.changed();
  }

  /** What is shown now can be taken back. */
  keep() {
    const now = JSON.stringify(this.timeline.spans);
    if (now !== this.now) this.past.push(this.now);
    if (now !== this.now) this.future = [];
    this.now = now;
    this.allow();
  }

  /** Take back a change, or make it again. @param {string[]} from @param {string[]} to */
  step(from, to) {
    if (!from.length) return;
    to.push(this.now);
    this.now = from.pop();
    this.take(JSON.parse(this.now));
    this.corrected();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const [control, letter] = [event.ctrlKey || event.metaKey, event.key.toLowerCase()];
    if (currentView() !== "recordings") return;
    if (isUndo(event)) this.past.length ? this.step(this.past, this.future) : undo();
    else if (control && !event.defaultPrevented && (letter === "y" || (letter === "z" && event.shiftKey)))
      this.step(this.future, this.past);
    else return;
    event.preventDefault();
  }

  /** The playhead is elsewhere. @param {number} time */
  goTo(time) {
    this.timeline.goTo(time);
    this.shape.goTo(time, this.timeline.spans, this.timeline.extent[1]);
  }

  /** The spans as a file, in a format of the shell. */
  save() {
    const spans = this.timeline.spans.map(({ begin, end, label, p = null, confidence = null }) => ({
      ...{ begin, end, label, p, confidence },
    }));
    const path = `/api/recordings/${encodeURIComponent(this.read.recording)}/annotations`;
    return download(path, { ...this.body(), spans, format: byId("save-format").value }, "annotations");
  }

  /** @param {number} k */
  remove(k) {
    this.timeline.spans.splice(k, 1);
    this.choose(-1);
    this.corrected();
  }

  /** A person has changed what an episode shows: it is kept. */
  corrected() {
    this.changed();
    this.keep();
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

  /** A span at the playhead, or in the middle of what is shown; the first one of a short recording is all of it. */
  add() {
    if (!this.read || library().read_only) return;
    const { range, spans, head, extent } = this.timeline;
    const [from, to] = range;
    const all = !spans.length && to - from < SHORT;
    const middle = from < head && head < to ? head : (from + to) / 2;
    const half = (all ? 1 : 0.1) * (to - from);
    spans.push({
      begin: Math.max(middle - half, extent[0]),
      end: Math.min(middle + half, extent[1]),
      label: null,
      p: null,
    });
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
    this.goTo(this.player.at);
    this.allow();
  }

  allow() {
    if (!this.read) return;
    byId("undo-span").disabled = !this.past.length;
    byId("redo-span").disabled = !this.future.length;
    byId("save-part").hidden = !this.timeline.spans.length;
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
