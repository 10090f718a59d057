// A program's movement on the canvas, while it happens: as if it were drawn there.
import { byId } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { usualSide } from "./scale.js";
import { Frame } from "./frame.js";
import { Sources } from "./sources.js";

const LEAST = 4; // samples that make a movement

/** @param {{id: number, movement: number}} source */
const keyOf = (source) => `${source.id} ${source.movement}`;

export class Follow {
  /** @param {any} draw The view. */
  constructor(draw) {
    this.draw = draw;
    /** @type {import("./sources.js").Source|null} Whose movement is shown. */
    this.source = null;
    this.passed = "";
    this.sources = new Sources(
      (source) => this.follow(source),
      () => this.fewer(),
    );
  }

  /** Show no program's movement; this one not again. */
  leave() {
    if (this.source) this.passed = keyOf(this.source);
    this.source = null;
    this.draw.picture.frame = null;
  }

  /** Whether a movement of this program may take the canvas: nothing is lost that was drawn or is being named. */
  isFree(/** @type {any} */ source) {
    const { drawing, waits, whole } = this.draw;
    if (drawing || waits || byId("naming-name").value.trim()) return false;
    return this.source ? this.source.id === source.id || this.source.ended !== null : whole === null;
  }

  /** @param {import("./sources.js").Source} source */
  follow(source) {
    const key = keyOf(source);
    if (key === this.passed || !source.samples.length) return;
    if (!this.source || keyOf(this.source) !== key) {
      const free = this.isFree(source);
      byId("sources").classList.toggle("waits", !free);
      if (!free) return;
      this.begin();
    }
    const known = this.source?.samples.length ?? 0;
    const ended = this.source?.ended ?? null;
    this.source = source;
    this.paint(source, known);
    if (source.ended === null) this.underWay(source);
    else if (ended === null) this.over(source.ended);
  }

  begin() {
    this.draw.clear();
    this.draw.kind = "program";
    this.draw.picture.frame = new Frame(
      usualSide() ?? 0.5,
      library()
        .symbols.map((/** @type {any} */ one) => one.path)
        .filter(Boolean),
    );
    this.draw.filled(true);
  }

  /** @param {import("./sources.js").Source} source @param {number} known How many of its samples are painted. */
  paint({ samples, state, ended }, known) {
    const { picture } = this.draw;
    const rest =
      ended === null
        ? (state?.path ?? []).filter((/** @type {number[]} */ one) => one.length === samples[0].length - 1)
        : [];
    picture.ink = samples.map(([t, ...point]) => [t - samples[0][0], ...point]);
    picture.rest = rest;
    picture.frame.include(
      [...samples.slice(Math.min(known, samples.length - 1)).map((one) => one.slice(1)), ...rest],
      picture.board,
    );
    picture.board.draw();
    byId("draw-clear").disabled = false;
  }

  /** @param {any} source */
  underWay({ samples, state }) {
    const { panel } = this.draw;
    if (!state) return;
    panel.drawing(state, samples[samples.length - 1][0]);
    if (state.skipped && !state.ranked.length) panel.words("Cannot be compared", "?", state.status[0] ?? "", "unknown");
  }

  /** The program said so, or has gone. @param {any} ended */
  over(ended) {
    const { draw } = this;
    const { samples } = this.source;
    byId("draw-replay").disabled = false;
    if (ended.error || samples.length < LEAST)
      return draw.panel.words("No answer", "?", ended.error ?? "too short", "unknown");
    draw.whole = { times: samples.map(([t]) => t), positions: samples.map(([, ...point]) => point) };
    draw.answered(ended.answer);
  }

  /** One is gone or ignored: a movement that it has not ended is asked for as a whole. */
  fewer() {
    const { source, sources } = this;
    if (!source || source.ended !== null) return;
    if (sources.known.has(source.id)) return sources.ignored.has(source.name) ? this.draw.clear() : undefined;
    this.source = { ...source, ended: { error: "" } };
    this.draw.picture.rest = [];
    if (source.samples.length < LEAST) return this.over({});
    this.draw.whole = { times: source.samples.map(([t]) => t), positions: source.samples.map(([, ...point]) => point) };
    this.draw.naming.allow(true);
    this.draw.askOnce();
  }
}
