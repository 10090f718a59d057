// Recordings: a file, its channels, what was found in it, corrected, played, saved and learned.
import { get, path, post } from "../parts/api.js";
import { learnSpans, undo } from "../parts/changes.js";
import { byId, counted, fill, make, offer } from "../parts/elements.js";
import { COLORS, library, onLibrary } from "../parts/library_state.js";
import { ask } from "../parts/dialogs.js";
import { Steps } from "../parts/steps.js";
import { isRedo, isUndo } from "../parts/shortcuts.js";
import { save, tried } from "../parts/toasts.js";
import { currentView } from "../parts/views.js";
import { startDropping } from "./dropping.js";
import { Episodes } from "./episodes.js";
import { columnCount, fitting, mismatch } from "./fitting.js";
import { askHow } from "./importing.js";
import { Player } from "./player.js";
import { ShapeView } from "./shapes.js";
import { markRow, plain, showSpans } from "./spans.js";
import { Timeline } from "./timeline.js";

const SHORT = 10; // a recording of one movement [s]
const RESTS = 100; // stretches of a recording of which shapes are drawn where there is no annotation
const ASKED = 400; // how often it is asked how much is searched [ms]

export class Recordings {
  constructor() {
    /** @type {Recording|null} */
    this.read = null;
    this.search = null; // that is under way
    this.steps = new Steps(); // of the spans
    this.stretches = []; // spans, and what lies between
    this.timeline = new Timeline(this);
    this.shape = new ShapeView();
    this.player = new Player((time) => this.goTo(time));
    this.episodes = new Episodes(this);
    startDropping(this);
    for (const [id, act] of Object.entries({
      spot: () => (this.search ? this.search.abort() : this.spot()),
      "add-span": () => this.add(),
      "undo-span": () => this.step(-1),
      "redo-span": () => this.step(1),
      "save-spans": () => this.save(),
      "learn-spans": () => this.learn(),
      "learn-file": () => learnSpans(this.read.recording, { channels: this.chosenChannels() }),
      "read-as": () => this.readAs(),
      "zoom-in": () => this.timeline.zoom(0.6),
      "zoom-out": () => this.timeline.zoom(1 / 0.6),
    }))
      byId(id).onclick = act;
    byId("tables").onchange = () => this.showTable();
    byId("channels").onchange = () => this.columns();
    document.addEventListener("keydown", (event) => this.takeBack(event));
    onLibrary(() => {
      this.allow();
      this.timeline.board.draw();
    });
  }

  /** @param {Recording} recording */
  open(recording, name) {
    const { tables, episode } = recording;
    this.read = recording;
    recording.videos ??= [];
    byId("recording").hidden = false;
    byId("drop").classList.add("small-drop");
    byId("recording-name").textContent = name;
    byId("read-as").hidden = !recording.preview;
    byId("shell").textContent = recording.command;
    const names = tables.map((table) => table.name);
    offer(byId("tables"), names);
    byId("tables-part").hidden = tables.length < 2;
    const labeled = tables.filter((table) => table.label !== null);
    const labels = [...new Set(labeled.map((table) => table.label))].slice(0, 8).join(", ");
    byId("learn-file").hidden = tables.length < 2 || !labeled.length;
    byId("learn-file").title = `${counted(tables.length, "movement")}, ${labeled.length} with a label: ${labels}`;
    fill(byId("problems"), ...recording.problems.map((problem) => make("p", "small", problem)));
    this.showTable();
    byId(episode ? "timeline-canvas" : "spot").focus({ preventScroll: true });
    if (episode) byId("recording").scrollIntoView({ block: "start" });
  }

  /** Ask how the file is read. */
  async readAs() {
    const name = byId("recording-name").textContent;
    const recording = await askHow({ ...this.read, unclear: "" }, name);
    if (recording) this.open(recording, name);
  }

  /** The table that is chosen. */
  get table() {
    return this.read.tables[byId("tables").selectedIndex];
  }

  /** Another table, of this file or of a new one: what is still searched for is about the one before. */
  showTable() {
    this.search?.abort();
    this.over("");
    const { table } = this;
    const rate = table.rate ? `, ${Math.round(table.rate)} samples a second` : "";
    byId("recording-facts").textContent =
      `${table.duration.toFixed(1)} s, ${counted(table.channels.length, "channel")}${rate}`;
    const chosen = fitting(table.channels, library(), this.read.chosen);
    const boxes = table.channels.map(({ name, kind, unit }, k) => {
      const key = make("span", "key");
      key.style.borderColor = `var(${COLORS[columnCount(table.channels.slice(0, k)) % COLORS.length]})`;
      const says = make("span", "soft small says", [kind, unit].filter(Boolean).join(", "));
      const box = make("input", { type: "checkbox", checked: chosen.has(name), value: name });
      return make("label", "check", box, key, make("span", {}, name, says));
    });
    fill(byId("channels"), make("legend", {}, "Channels"), ...boxes);
    const spans = table.label === null ? [] : [{ begin: 0, end: table.duration, label: table.label, p: null }];
    this.timeline.spans = this.read.episode?.spans ?? spans;
    this.steps = new Steps();
    this.timeline.show(this.shownPlot());
    this.player.open(table.duration, this.read.videos);
    this.columns();
    this.show();
  }

  chosenChannels() {
    return [...byId("channels").querySelectorAll("input:checked")].map((box) => box.value);
  }

  /** The plot with the columns of the chosen channels. */
  shownPlot() {
    const names = this.chosenChannels();
    const shown = this.table.channels.flatMap(({ name, columns }) => (names.includes(name) ? [name, ...columns] : []));
    const plot = this.read.plots[byId("tables").selectedIndex];
    const colored = plot.columns.map((column, at) => ({ ...column, color: COLORS[at % COLORS.length] }));
    return { ...plot, columns: colored.filter(({ name }) => shown.includes(name)) };
  }

  columns() {
    this.timeline.plot = this.shownPlot();
    this.timeline.board.draw();
    this.allow();
    this.draw();
  }

  /** Ask for the shapes of all spans, and of what lies between. */
  async draw() {
    const { spans, shapes, extent } = this.timeline;
    const long = Math.max(SHORT, extent[1] / RESTS);
    const rests = Array.from({ length: Math.ceil(extent[1] / long) }, (_, k) => ({
      begin: k * long,
      end: Math.min(k * long + long, extent[1]),
    }));
    const stretches = [...spans, ...rests];
    this.stretches = stretches;
    const parts = stretches.map(({ begin, end }) => ({ begin, end }));
    const answer = await post(this.path("shapes"), { ...this.body(), spans: parts, points: 100 }).catch(() => []);
    for (const [k, shape] of answer.entries()) shapes.set(stretches[k], shape);
    this.timeline.board.draw();
    this.goTo(this.player.at);
  }

  /** The address of what is asked about the recording. */
  path(what) {
    return path`/api/recordings/${this.read.recording}/${what}`;
  }

  body() {
    return { table: this.table.name, channels: this.chosenChannels() };
  }

  async spot() {
    const { recording, episode } = this.read;
    const text = "What is found takes the place of what was corrected in this episode.";
    if (episode?.corrected && !(await ask({ title: "Look again?", text, yes: "Look again" }))) return;
    const address = this.path("spotted");
    const search = new AbortController();
    this.search = search;
    this.allow();
    byId("spans-state").textContent = "Looking …";
    const timer = setInterval(() => this.tell(address, search), ASKED);
    const answer = await tried(post(address, this.body(), search.signal));
    clearInterval(timer);
    if (this.search === search) this.over(search.signal.aborted ? "Canceled; nothing was changed." : "");
    if (!answer || search.signal.aborted) return;
    if (episode) this.episodes.put(recording, answer.spans, false);
    this.spotted(answer.spans);
  }

  /** Show what was found. */
  spotted(spans) {
    this.take(spans);
    if (this.read.episode) this.read.episode.corrected = false;
    const named = spans.filter((span) => span.label !== null).length;
    const advice = spans.length ? " Choose one to drag its edges." : "";
    byId("spans-state").textContent = `${counted(named, "known movement")}, ${spans.length - named} unknown.${advice}`;
  }

  /** Show other spans. */
  take(spans) {
    this.timeline.spans = spans;
    if (this.read.episode) this.read.episode.spans = spans;
    this.choose(-1);
    this.show();
    this.draw();
  }

  /** Take back a change, or make it again. */
  step(by) {
    if (!this.steps.has(by)) return;
    this.take(this.steps.go(by));
    this.keep();
  }

  /** Ctrl-Z is for the spans; without any change of these, for the library. */
  takeBack(event) {
    if (currentView() !== "recordings" || event.defaultPrevented) return;
    if (isUndo(event)) this.steps.has(-1) ? this.step(-1) : undo();
    else if (isRedo(event)) this.step(1);
    else return;
    event.preventDefault();
  }

  /** The playhead is elsewhere. */
  goTo(time) {
    this.timeline.goTo(time);
    const stretch = this.stretches.find(({ begin, end }) => begin <= time && time <= end);
    if (stretch) this.shape.show(time, stretch, this.timeline.shapes.get(stretch));
  }

  /** The spans as a file, in a format of the shell. */
  save() {
    const asked = { ...this.body(), spans: plain(this.timeline.spans), format: byId("save-format").value };
    return save(this.path("annotations"), asked, "annotations");
  }

  remove(k) {
    this.timeline.spans.splice(k, 1);
    this.choose(-1);
    this.changed();
  }

  /** A person has changed what is shown. */
  changed() {
    this.show();
    this.draw();
    this.keep();
  }

  /** What an episode shows is kept by the server. */
  keep() {
    if (!this.read?.episode) return;
    this.read.episode.corrected = true;
    this.episodes.put(this.read.recording, this.timeline.spans, true);
  }

  /** How much is searched. */
  async tell(address, search) {
    const progress = await get(address).catch(() => null);
    if (this.search === search && progress?.share)
      byId("spans-state").textContent = `Looking … ${Math.floor(100 * progress.share)} %`;
  }

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
    const middle = from < head && head < to ? head : (from + to) / 2;
    const half = (to - from) * (spans.length || to - from >= SHORT ? 0.1 : 1);
    const [begin, end] = [Math.max(middle - half, extent[0]), Math.min(middle + half, extent[1])];
    spans.push({ begin, end, label: null, p: null });
    this.changed();
    this.choose(spans.length - 1);
    this.timeline.name();
  }

  /** Choose a span; -1 for none. */
  choose(k) {
    if (this.timeline.chosen === k) return;
    this.timeline.chosen = k;
    this.timeline.board.now();
    markRow(k);
  }

  seek(time) {
    this.player.seek(time);
  }

  key(event) {
    this.player.key(event);
  }

  show() {
    const { spans, chosen, board } = this.timeline;
    this.steps.keep(spans);
    showSpans(spans, chosen, this);
    board.draw();
    this.allow();
  }

  allow() {
    if (!this.read) return;
    const { spans } = this.timeline;
    const names = this.chosenChannels();
    const { read_only, symbols } = library();
    const chosen = this.table.channels.filter(({ name }) => names.includes(name));
    const wrong = mismatch(chosen, library());
    byId("channels-note").textContent = wrong;
    byId("undo-span").disabled = !this.steps.has(-1);
    byId("redo-span").disabled = !this.steps.has(1);
    byId("save-part").hidden = !spans.length;
    byId("spot").textContent = this.search ? "Cancel" : "Find movements";
    byId("spot").disabled = wrong !== "" && !this.search;
    byId("learn-file").disabled = read_only || !names.length || (wrong !== "" && symbols.length > 0);
    byId("learn-spans").disabled = read_only || !spans.some((span) => span.label !== null);
  }

  async learn() {
    const named = this.timeline.spans.filter(({ label }) => label !== null);
    const spans = named.map(({ begin, end, label }) => ({ begin, end, label }));
    await learnSpans(this.read.recording, { ...this.body(), spans });
  }
}
