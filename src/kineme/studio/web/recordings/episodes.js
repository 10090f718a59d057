// The episodes of what the studio was started with: a page of strips at a time, symbols found in them, corrections.
import { get, path, post } from "../parts/api.js";
import { ask } from "../parts/dialogs.js";
import { byId, counted, fill, write } from "../parts/elements.js";
import { library, onLibrary } from "../parts/library_state.js";
import { say, tried } from "../parts/toasts.js";
import { onShow } from "../parts/views.js";
import { fitting } from "./fitting.js";
import { plain } from "./spans.js";
import { Strip } from "./strip.js";

const PAGE = 20; // episodes

export class Episodes {
  /** @param {import("./view.js").Recordings} page */
  constructor(page) {
    this.page = page;
    this.offset = 0;
    this.answer = null; // that is shown
    this.saved = true;
    this.opened = null; // key of the episode that is open
    this.channels = null; // in which movements are looked for
    this.sending = Promise.resolve(); // of spans, one after the other
    this.search = null; // of a page that is under way
    /** @type {Strip[]} */
    this.strips = [];
    const turn = (offset) => tried(this.turn(offset));
    onShow("recordings", () => this.answer || turn(0));
    byId("episodes-before").onclick = () => turn(this.offset - PAGE);
    byId("episodes-next").onclick = () => turn(this.offset + PAGE);
    byId("episodes-from").onchange = () => turn((byId("episodes-from").valueAsNumber || 1) - 1);
    byId("spot-page").onclick = () => (this.search ? this.search.abort() : this.spot());
    byId("save-corrections").onclick = () => tried(this.save());
    byId("strips").onkeydown = (event) => this.key(event);
    onLibrary(() => {
      this.channels = null; // it may hold others now
      for (const strip of this.strips) strip.recolor();
    });
  }

  /** Show the episodes from one on. */
  async turn(offset) {
    this.search?.abort();
    await this.sending;
    const answer = await get(`/api/episodes?offset=${Math.max(Math.floor(offset), 0)}&limit=${PAGE}`);
    const beyond = answer.name !== null && !answer.episodes.length && answer.total;
    if (beyond) return this.turn(Math.floor((answer.total - 1) / PAGE) * PAGE);
    this.answer = answer;
    if (answer.name === null) return;
    this.offset = answer.offset;
    this.saved = answer.saved;
    byId("download-corrections").hidden = !answer.n_corrected;
    if (!this.strips.length) {
      this.strips = Array.from({ length: PAGE }, () => new Strip((strip) => this.open(strip)));
      byId("drop").classList.add("small-drop");
      byId("episodes").hidden = false;
      fill(byId("strips"), ...this.strips.map((strip) => strip.element));
      if (answer.problem) say(answer.problem, { failed: true });
    }
    for (const [k, strip] of this.strips.entries()) strip.show(answer.episodes[k] ?? null);
    this.mark();
    this.say();
  }

  say() {
    const { name, total, episodes } = this.answer;
    const last = this.offset + episodes.length;
    const range = episodes.length ? `${this.offset + 1} to ${last}` : "none";
    write(byId("episodes-title"), name);
    write(byId("episodes-facts"), total === null ? range : `${range} of ${counted(total, "episode")}`);
    byId("episodes-from").value = String(this.offset + 1);
    byId("episodes-before").disabled = !this.offset;
    byId("episodes-next").disabled = total !== null ? last >= total : episodes.length < PAGE;
    byId("episodes-pages").hidden = !this.offset && byId("episodes-next").disabled;
    byId("save-corrections").disabled = this.saved;
    write(byId("spot-page"), this.search ? "Cancel" : "Find movements in these");
  }

  /** Mark the strip of the episode that is open. */
  mark() {
    for (const { button, episode } of this.strips)
      button.setAttribute("aria-current", String(episode?.key === this.opened));
  }

  async open(strip) {
    await this.sending;
    const detail = await tried(get(path`/api/episodes/${strip.episode.key}?width=${Math.round(window.innerWidth)}`));
    if (!detail) return;
    this.opened = detail.recording;
    this.mark();
    for (const video of detail.videos) video.address = path`/api/episodes/${detail.recording}/videos/${video.camera}`;
    const { number, task, place } = detail.episode;
    this.page.open(detail, `Episode ${number}: ${task ?? place}`);
  }

  /** Keep what an episode shows, and whether a person has corrected any. */
  put(key, spans, corrected) {
    const body = { spans: plain(spans), corrected };
    if (corrected) {
      this.saved = false;
      byId("download-corrections").hidden = false;
    }
    this.sending = this.sending.then(() => tried(post(path`/api/episodes/${key}/spans`, body)));
    const strip = this.strips.find(({ episode }) => episode?.key === key);
    if (strip) {
      Object.assign(strip.episode, body);
      strip.say();
      strip.board.draw();
    }
    this.say();
    return this.sending;
  }

  /** Look for movements in each episode of this page; what a person has corrected stays as it is. */
  async spot() {
    const search = new AbortController();
    this.search = search;
    const strips = this.strips.filter(({ episode }) => episode?.n_samples && !episode.corrected);
    let done = 0;
    const refused = []; // why others could not be
    this.say();
    try {
      for (const { episode } of strips) {
        write(byId("episodes-state"), `Looking … ${done} of ${counted(strips.length, "episode")}`);
        const spans = await this.find(episode.key, search.signal).catch((error) => {
          if (error.status !== 400) throw error;
          refused.push(`Episode ${episode.number}: ${error.message}`);
        });
        if (!spans) continue;
        await this.put(episode.key, spans, false);
        if (this.page.read?.recording === episode.key) this.page.spotted(spans);
        done += 1;
      }
      write(byId("episodes-state"), `Looked through ${counted(done, "episode")}.`);
      if (refused.length)
        say(`${counted(refused.length, "episode")} not looked through. ${refused[0]}`, { failed: true });
    } catch (error) {
      write(byId("episodes-state"), search.signal.aborted ? `Canceled after ${counted(done, "episode")}.` : "");
      if (!search.signal.aborted) say(error.message, { failed: true });
    } finally {
      if (this.search === search) this.search = null;
      this.say();
    }
  }

  /** What happens when in an episode. */
  async find(key, signal) {
    if (!this.channels) {
      const { tables, chosen } = await get(path`/api/episodes/${key}`);
      this.channels = [...fitting(tables[0].channels, library(), chosen)];
    }
    return (await post(path`/api/recordings/${key}/spotted`, { channels: this.channels }, signal)).spans;
  }

  /** Write the table of corrections beside what was opened. */
  async save(replace = false) {
    await this.sending;
    try {
      const { file, n_spans } = await post("/api/episodes/corrections", { replace });
      this.saved = true;
      this.say();
      say(`${counted(n_spans, "span")} written to ${file}.`);
    } catch (error) {
      if (error.status !== 409 || replace) throw error;
      const question = { title: `Replace ${this.answer.file}?`, text: error.message, yes: "Replace", danger: true };
      if (await ask(question)) await this.save(true);
    }
  }

  /** Arrow keys go from strip to strip. */
  key(event) {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    const at = this.strips.findIndex(({ button }) => button === event.target);
    const next = this.strips[at + (step ?? 0)];
    if (!step || at < 0 || !next || next.element.hidden) return;
    event.preventDefault();
    next.button.focus();
  }
}
