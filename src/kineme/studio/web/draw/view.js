// Draw: a movement is recognized while it is drawn, and learned from one drawing.
import { post } from "../parts/api.js";
import { byId } from "../parts/elements.js";
import { isLoaded, library, onLibrary, symbolNamed } from "../parts/library_state.js";
import { followTurns } from "../parts/turning.js";
import { currentView, show } from "../parts/views.js";
import { chooseToMove } from "../parts/chosen.js";
import { AnswerPanel } from "./answer_panel.js";
import { Follow } from "./follow.js";
import { followKeys } from "./keyboard_pen.js";
import { describeLiveSource } from "./live_source.js";
import { startNaming } from "./naming.js";
import { Picture } from "./picture.js";
import { canvasHeight } from "./scale.js";
import { Sending } from "./sending.js";
import { followPointer } from "./stroke.js";

const LEAST = 4; // samples that make a movement

/** Whether drawings fit the library: in the plane, or in space where all movements are plane. */
function takesDrawings() {
  const { n_dims: dims, symbols } = library();
  if (dims === null || dims === 2) return true;
  return (
    dims === 3 &&
    symbols.every(
      (/** @type {any} */ one) =>
        !one.path || one.path.every((/** @type {number[]} */ point) => Math.abs(point[2] - one.path[0][2]) < 1e-9),
    )
  );
}

/**
 * @param {number[]} point Of the canvas.
 * @param {number} height Of the canvas, in the units of the library.
 * @returns {number[]} In the library's dimensions.
 */
const inLibrary = (point, height) => [...point.map((value) => value * height), ...(library().n_dims === 3 ? [0] : [])];

class Draw {
  /** @param {(message: any) => boolean} send */
  constructor(send) {
    this.sending = new Sending(send);
    this.picture = new Picture(byId("draw-canvas"));
    this.panel = new AnswerPanel();
    this.drawing = false;
    this.whole = null;
    this.kind = "";
    this.height = 1;
    this.label = null;
    this.waits = false;
    this.follow = new Follow(this);
    this.naming = startNaming({ drawn: () => this.whole, learned: (name) => this.learned(name) });
    this.listen();
  }

  listen() {
    const hear = {
      begins: (/** @type {string} */ kind) => this.begins(kind),
      // Escape ends it while the pen is down.
      goes: (/** @type {number[][]} */ samples) => this.drawing && this.goes(samples),
      ends: () => this.drawing && this.ends(),
      pen: (/** @type {number[]|null} */ at) => {
        this.picture.pen = at;
        this.picture.board.draw();
      },
    };
    followPointer(byId("draw-canvas"), hear);
    followKeys(byId("draw-canvas"), hear);
    followTurns(
      byId("draw-canvas"),
      () => this.picture.turns,
      (dx, dy) => this.picture.turn(dx, dy),
    );
    byId("draw-clear").addEventListener("click", () => this.clear());
    byId("draw-replay").addEventListener("click", () => this.picture.replay());
    byId("draw-move").addEventListener("click", () => this.move());
    document.addEventListener(
      "keydown",
      (event) =>
        event.key === "Escape" && currentView() === "draw" && !document.querySelector("dialog[open]") && this.clear(),
    );
    byId("draw-how").addEventListener("click", () => {
      byId("live-source").scrollIntoView({ block: "start" });
      /** @type {HTMLElement} */ (byId("live-source").firstElementChild).focus();
    });
    onLibrary(() => this.invite());
    describeLiveSource(byId("live-source-text"));
  }

  /** What the empty canvas says. */
  invite() {
    const { symbols, read_only: readOnly } = library();
    const takes = takesDrawings();
    this.filled(this.picture.ink.length > 0);
    byId("draw-empty-title").textContent = !takes
      ? "Movements in space"
      : symbols.length
        ? "Draw a movement here"
        : "Nothing is known yet";
    byId("draw-empty-text").textContent = !takes
      ? "This library holds movements that a mouse cannot draw. Send samples from a program and see them here, or " +
        "drop a recording in Recordings."
      : symbols.length || readOnly
        ? "In one stroke, with mouse, pen or finger. What it is appears while you draw."
        : "Draw a movement in one stroke, then give it a name. One drawing is enough to be recognized again.";
    byId("draw-how").hidden = takes;
    if (!takes) byId("live-source").open = true;
  }

  /** @param {boolean} on Whether there is a movement: the invitation goes, and what its colors mean is said. */
  filled(on) {
    byId("draw-empty").hidden = on;
    byId("draw-legend").hidden = !on || !library().symbols.length;
  }

  /** @param {string} kind */
  begins(kind) {
    if (!takesDrawings() || this.picture.turns) return false;
    this.clear();
    this.drawing = true;
    this.picture.height = this.picture.board.height;
    this.kind = kind;
    this.sending.reset();
    this.height = canvasHeight();
    this.filled(true);
    this.panel.words("Drawing", "…", "", "open");
    return true;
  }

  /** @param {number[][]} samples */
  goes(samples) {
    this.picture.ink.push(...samples);
    this.picture.board.draw();
    if (library().symbols.length)
      this.sending.push(samples.map(([t, ...point]) => [t, ...inLibrary(point, this.height)]));
  }

  ends() {
    this.drawing = false;
    this.picture.height = null;
    this.picture.rest = [];
    this.picture.board.draw();
    const { ink } = this.picture;
    byId("draw-clear").disabled = byId("draw-replay").disabled = ink.length === 0;
    if (ink.length < LEAST) return this.panel.words("Too short", "–", "Press, draw, and let go at the end.", "open");
    this.whole = { times: ink.map(([t]) => t), positions: ink.map(([, ...point]) => inLibrary(point, this.height)) };
    this.naming.allow(true);
    if (!library().symbols.length) return this.answered(null);
    this.waits = true;
    if (!this.sending.finish()) this.askOnce();
  }

  /** @param {any} answer To the whole movement; null where there is too little to compare with. */
  answered(answer) {
    this.waits = false;
    this.naming.allow(true);
    if (answer !== null) this.show(answer);
    else if (library().symbols.length) this.cannotCompare();
    else this.isNew();
  }

  /** There is nothing to compare with. */
  isNew() {
    this.panel.words("The first of its kind", "?", "Give it a name.", "unknown");
    this.panel.progress(1);
    this.panel.speak("Give it a name.");
    this.focusName();
  }

  /** One movement has a name: too few to say what is unlike it. */
  cannotCompare() {
    const names = library().symbols.map((/** @type {any} */ one) => one.name);
    this.panel.words(
      "Too few to compare",
      "?",
      names.length
        ? `Only ${names[0]} is known. Draw something else and name it, too: two names can be told apart.`
        : "Give it a name.",
      "unknown",
    );
    this.panel.progress(1);
    this.panel.speak("Give it a name.");
    this.naming.allow(true, names.slice(0, 3));
    this.focusName();
  }

  /** Without a websocket the whole movement is asked for at once. */
  async askOnce() {
    const asked = this.whole;
    const answer = await post("/api/recognize", asked).catch((/** @type {any} */ error) => ({ error }));
    if (asked !== this.whole) return;
    if (!answer.error) this.answered(answer);
    else if (!answer.error.status)
      this.panel.words("No answer yet", "…", "It is asked for again when the server is there.", "open");
    else this.refused(answer.error.message);
  }

  /** @param {any} state Of the server, while drawing. */
  state(state) {
    if (!this.sending.heard() || !this.drawing) return;
    const { ink, rest } = this.picture;
    this.panel.drawing(state, ink[ink.length - 1]?.[0] ?? 0);
    this.picture.rest =
      state.path?.map((/** @type {number[]} */ point) => point.map((value) => value / this.height)) ?? rest;
    this.picture.board.draw();
  }

  /** @param {any} answer Of the websocket, to the whole movement. */
  answer(answer) {
    if (this.sending.answered() && this.waits) this.answered(answer);
  }

  /** @param {any} answer */
  show(answer) {
    this.panel.final(answer);
    this.label = answer.label;
    byId("draw-move").disabled = answer.label === null;
    this.naming.allow(
      true,
      answer.ranked.slice(0, 3).map((/** @type {any} */ one) => one.name),
    );
    this.focusName();
  }

  /** @param {string} text What the server could not do. @returns {boolean} Whether it was about this drawing. */
  error(text) {
    const about = this.drawing || this.waits;
    if (this.drawing) this.sending.heard();
    if (this.waits) {
      this.sending.answered();
      this.refused(text);
    }
    return about;
  }

  /** @param {string} text Why there is no answer. */
  refused(text) {
    this.waits = false;
    this.panel.words("No answer", "?", text, "unknown");
    this.focusName();
  }

  /** A keyboard of glass covers the drawing: with a finger the field waits to be touched, as while programs move. */
  focusName() {
    if (!["touch", "program"].includes(this.kind) && currentView() === "draw") this.naming.focus();
  }

  /** @param {string|null} name */
  learned(name) {
    this.label = name;
    this.whole = null;
    this.naming.empty();
    this.naming.allow(false);
    byId("draw-move").disabled = name === null;
    const alone = library().symbols.length < 2;
    if (name !== null)
      this.panel.words(
        "Learned",
        name,
        alone
          ? "Now draw something else and name it: two names can be told apart."
          : "Draw it again, anywhere and in any size.",
        "known",
      );
    byId("sources").classList.remove("waits");
    byId("draw-canvas").focus({ preventScroll: true });
  }

  move() {
    const symbol = this.label === null ? null : symbolNamed(this.label);
    if (symbol) chooseToMove(symbol.id);
    show("move", true);
  }

  clear() {
    this.follow.leave();
    byId("sources").classList.remove("waits");
    Object.assign(this.picture, { ink: [], rest: [], height: null, replayed: null });
    this.picture.board.draw();
    this.whole = null;
    this.label = null;
    this.waits = false;
    this.drawing = false;
    this.panel.idle();
    this.naming.allow(false);
    this.naming.empty();
    byId("draw-clear").disabled = byId("draw-replay").disabled = byId("draw-move").disabled = true;
    if (isLoaded()) this.invite();
  }
}

/** @param {(message: any) => boolean} send @returns {any} What hears the server. */
export function startDraw(send) {
  const draw = new Draw(send);
  const renewed = () => {
    draw.sending.renewed();
    draw.follow.sources.renewed();
    if (draw.waits) draw.askOnce();
  };
  const lost = () => draw.sending.lost();
  return {
    lost,
    state: draw.state.bind(draw),
    answer: draw.answer.bind(draw),
    error: draw.error.bind(draw),
    source: (/** @type {any} */ told) => draw.follow.sources.hear(told),
    renewed,
  };
}
