// Move: one symbol, its start, goal, via points, obstacles and duration; the path follows the hand.
import { download, post } from "../parts/api.js";
import { Camera } from "../parts/camera.js";
import { byId, fill, make } from "../parts/elements.js";
import { startFinding } from "../parts/find.js";
import { library, onLibrary, symbolOf } from "../parts/library_state.js";
import { lengths, Plot } from "../parts/plots.js";
import { isUndo } from "../parts/shortcuts.js";
import { say, tried } from "../parts/toasts.js";
import { currentView, onShow } from "../parts/views.js";
import { chooseToMove, dragGoal, toMove } from "../parts/chosen.js";
import { FORMULATIONS, showFormulations } from "./formulations.js";
import { Handles } from "./handles.js";
import { showPick } from "./pick.js";
import { MovePicture } from "./picture.js";
import { asShown, draggedWay, extent, question, rounded } from "./plan.js";
import { showPoints } from "./points.js";
import { Rollouts } from "./rollouts.js";
import { Steps } from "./steps.js";
import { showStyles } from "./styles.js";

class Move {
  constructor() {
    this.steps = new Steps();
    this.camera = new Camera();
    this.plan = null;
    /** @type {{id: string}|null} */
    this.chosen = null;
    this.version = -1;
    this.dragging = false;
    this.named = null;
    this.on = new Set([FORMULATIONS[0].name]);
    this.rollouts = new Map(FORMULATIONS.map((one) => [one.name, new Rollouts(one.name, () => this.redraw())]));
    this.handles = new Handles(this.camera, {
      moving: (on) => this.moving(on),
      said: (value) => rounded(value, extent(this.plan.path)),
    });
    this.picture = new MovePicture(this.camera, () => this.handles.place());
    this.speed = new Plot(byId("plot-speed"));
    this.acceleration = new Plot(byId("plot-acceleration"));
    showFormulations((name, on) => this.formulation(name, on));
    this.listen();
  }

  listen() {
    const clicks = {
      "move-play": () => this.play(),
      "add-via": () => this.addVia(),
      "add-obstacle": () => this.addObstacle(),
      "move-reset": () => this.choose(this.plan?.symbol),
      export: () => this.save(),
    };
    for (const [id, act] of Object.entries(clicks)) byId(id).addEventListener("click", act);
    byId("duration").addEventListener("input", () => this.stretch());
    document.addEventListener("keydown", (event) => {
      if (
        event.key !== " " ||
        currentView() !== "move" ||
        /** @type {any} */ (event.target).closest("button, input, select, summary, textarea, dialog")
      )
        return;
      event.preventDefault();
      this.play();
    });
    const pick = () => showPick(this.plan?.symbol ?? null, (chosen) => this.choose(chosen));
    startFinding(byId("find-pick"), pick, () => byId("move-pick").querySelector("input"));
    document.addEventListener("keydown", (event) => isUndo(event) && currentView() === "move" && this.back());
    onShow("move", () => this.shown());
    onLibrary(() => this.shown());
  }

  /** The view is shown, or the library changed. */
  shown() {
    if (currentView() !== "move") return;
    const { symbols, version } = library();
    const id = toMove(symbols);
    const formats = library().formats.map((/** @type {string} */ one) => one.replace(/^\./, ""));
    if (byId("export-format").children.length !== formats.length)
      fill(
        byId("export-format"),
        ...formats.map((/** @type {string} */ one) => make("option", { value: one }, one.toUpperCase())),
      );
    byId("move-empty").hidden = id !== null;
    for (const part of ["pick-part", "move-name", "move-tools", "move-plots", "move-panel"])
      byId(part).hidden = id === null;
    for (const control of /** @type {const} */ ([
      "move-play",
      "add-via",
      "add-obstacle",
      "move-reset",
      "export",
      "duration",
    ]))
      byId(control).disabled = id === null;
    showPick(id, (chosen) => this.choose(chosen));
    if (id === null) Object.assign(this, { plan: null, chosen: null }).picture.plan = null;
    else if (this.chosen?.id !== id || this.version !== version) this.choose(id);
  }

  /** @param {string|undefined} id Start anew with this symbol. */
  async choose(id) {
    const symbol = id && symbolOf(id);
    if (!symbol) return;
    const chosen = { id: symbol.id };
    this.chosen = chosen;
    chooseToMove(symbol.id);
    this.version = library().version;
    this.plan = null;
    this.steps = new Steps();
    this.handles.set([]);
    this.camera.face([symbol.path]);
    this.picture.sketch(symbol.path);
    byId("move-name").textContent = symbol.name;
    const rollout = await tried(() =>
      post("/api/rollout", { what: { symbol: symbol.id }, formulation: FORMULATIONS[0].name }),
    );
    if (this.chosen !== chosen) return; // another one since then, or this one anew
    if (!rollout) {
      this.chosen = null; // so that it is asked for again
      return;
    }
    this.plan = this.picture.plan = asShown(symbol, rollout);
    for (const one of this.rollouts.values()) one.reset();
    byId("duration").value = "0";
    byId("formulations").disabled = false;
    this.picture.paths = [];
    this.picture.fit();
    this.structure();
    const plan = this.plan;
    showStyles(
      symbol,
      (...style) => this.style(...style),
      () => this.plan === plan,
    );
    await this.prepare();
  }

  /** Formulations that move: those that are ticked; a style moves in its own alone. @returns {string[]} */
  names() {
    return this.plan?.style ? [this.plan.styled] : [...this.on];
  }

  async prepare() {
    if (!this.plan) return;
    await Promise.all(this.names().map((name) => this.rollouts.get(name).prepare(this.plan)));
  }

  /**
   * Another style moves; its primitive is asked for once the slider rests.
   * @param {number[]|null} values @param {string} formulation
   */
  style(values, formulation) {
    Object.assign(this.plan, { style: values, styled: formulation });
    byId("formulations").disabled = values !== null;
    for (const one of this.rollouts.values()) one.primitive = null;
    this.changed();
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.prepare(), 400);
  }

  /** Points came or went. */
  structure() {
    const plan = this.plan;
    const size = extent(plan.path);
    const point = (/** @type {any} */ owner, /** @type {string} */ field) => ({
      at: () => owner[field],
      move: (/** @type {number[]} */ to) => {
        owner[field] = to;
        this.changed();
      },
    });
    const gone = (/** @type {any[]} */ list, /** @type {number} */ k) => () => {
      list.splice(k, 1);
      this.structure();
    };
    const edge = (/** @type {any} */ one) => ({
      at: () => this.camera.moved(one.center, one.radius * this.camera.scale, 0),
      move: (/** @type {number[]} */ to) => {
        one.radius = Math.max(Math.hypot(...to.map((value, k) => value - one.center[k])), 0.01 * size);
        this.changed();
      },
    });
    this.handles.set([
      { key: "start", kind: "start", name: "Start", ...point(plan, "start") },
      { key: "goal", kind: "goal", name: "Goal", ...point(plan, "goal") },
      ...plan.via.map((one, k) => ({
        key: `via ${k}`,
        kind: "via",
        name: `Via point ${k + 1}`,
        remove: gone(plan.via, k),
        ...point(one, "point"),
      })),
      ...plan.obstacles.map((one, k) => ({
        key: `obstacle ${k}`,
        kind: "obstacle",
        name: `Obstacle ${k + 1}`,
        remove: gone(plan.obstacles, k),
        ...point(one, "center"),
      })),
      ...plan.obstacles.map((one, k) => ({
        key: `rim ${k}`,
        kind: "rim",
        name: `Rim of obstacle ${k + 1}`,
        remove: gone(plan.obstacles, k),
        ...edge(one),
      })),
    ]);
    this.changed();
  }

  /** A point or the duration is another one. */
  changed() {
    this.keepInSight();
    this.handles.place();
    byId("duration-text").textContent = `${(this.plan.usual * this.plan.share).toFixed(2)} s`;
    for (const name of this.names()) this.rollouts.get(name).follow(this.plan);
    this.picture.board.draw();
    dragGoal(this.plan.symbol, draggedWay(this.plan));
    if (!this.dragging) this.numbers();
  }

  numbers() {
    this.steps.keep(this.plan);
    showPoints(
      this.plan,
      () => this.changed(),
      () => this.structure(),
    );
  }

  /** @param {boolean} on */
  moving(on) {
    this.dragging = on;
    byId("move-stage").classList.toggle("dragging", on);
    if (on || !this.plan) return;
    this.numbers();
    this.keepInSight();
  }

  /** What was dragged out of the picture comes back into it once the hand lets go. */
  keepInSight() {
    if (this.dragging || !this.picture.losesAnything()) return;
    this.picture.fit();
    this.handles.place();
  }

  /** New paths are there. */
  redraw() {
    if (!this.plan) return;
    const shown = FORMULATIONS.filter((one) => this.names().includes(one.name) && this.rollouts.get(one.name).path).map(
      (one) => ({ ...one, path: this.rollouts.get(one.name).path }),
    );
    this.picture.paths = shown;
    this.keepInSight();
    this.picture.board.draw();
    this.speed.show(shown.map(({ path, look }) => ({ times: path.times, values: lengths(path.velocities), look })));
    this.acceleration.show(
      shown.map(({ path, look }) => ({ times: path.times, values: lengths(path.accelerations), look })),
    );
    this.legend(shown);
    const said = this.names()
      .flatMap((name) => [this.rollouts.get(name).problem, ...(this.rollouts.get(name).path?.warnings ?? [])])
      .filter(Boolean);
    const text = [...new Set(said)].join(" ");
    if (byId("move-warnings").textContent !== text) byId("move-warnings").textContent = text;
  }

  /** Not while a path follows the hand: it stays the same then. @param {any[]} shown */
  legend(shown) {
    const names = shown.map((one) => one.name).join();
    if (this.named === names) return;
    this.named = names;
    fill(
      byId("move-legend"),
      make("li", {}, make("span", { class: "key recorded" }), "recorded"),
      ...shown.map((one) => make("li", {}, make("span", { class: `key ${one.key}` }), one.name)),
    );
  }

  /** @param {string} name @param {boolean} on */
  async formulation(name, on) {
    on ? this.on.add(name) : this.on.delete(name);
    if (!this.plan) return;
    this.redraw();
    if (!on) return;
    await this.rollouts.get(name).prepare(this.plan);
    if (this.plan && this.names().includes(name)) this.rollouts.get(name).follow(this.plan);
  }

  /** From a quarter of the demonstrated duration to four times it. */
  stretch() {
    if (!this.plan) return;
    this.plan.share = 4 ** (Number(byId("duration").value) / 100);
    this.changed();
  }

  /** Before the last change of a point or the duration. */
  back() {
    if (!this.plan || !this.steps.back(this.plan))
      return say("Nothing is changed here. The arrow in the bar takes back changes of the library.");
    byId("duration").value = String(Math.round((100 * Math.log(this.plan.share)) / Math.log(4)));
    this.structure();
  }

  /**
   * A point of the path that is shown, or of the recording as long as there is none.
   * @param {number} share @returns {number[]}
   */
  pointAt(share) {
    const points = this.picture.paths[0]?.path.positions ?? this.plan.path;
    return [...points[Math.round(share * (points.length - 1))]];
  }

  addVia() {
    if (!this.plan) return;
    const at = [0.5, 0.25, 0.75, 0.375, 0.625, 0.125, 0.875][this.plan.via.length % 7];
    this.plan.via.push({ at, point: this.pointAt(at) });
    this.structure();
    this.focusHandle(`via ${this.plan.via.length - 1}`);
  }

  addObstacle() {
    if (!this.plan) return;
    const size = extent(this.plan.path);
    this.plan.obstacles.push({
      center: this.pointAt(0.6).map(
        (/** @type {number} */ value, /** @type {number} */ k) => value + (k < 2 ? 0.08 * size : 0),
      ),
      radius: 0.07 * size,
    });
    this.structure();
    this.focusHandle(`obstacle ${this.plan.obstacles.length - 1}`);
  }

  /** @param {string} key */
  focusHandle(key) {
    this.handles.made.get(key)?.button.focus({ preventScroll: true });
  }

  play() {
    if (!this.picture.paths.length) return;
    const began = performance.now();
    const run = {};
    this.run = run;
    const step = (/** @type {number} */ now) => {
      if (this.run !== run) return;
      const time = Math.max(now - began, 0) / 1000;
      const over = this.picture.paths.every(
        ({ path }) => time > path.times[path.times.length - 1] - path.times[0] + 0.4,
      );
      this.picture.time = this.speed.cursor = this.acceleration.cursor = over ? null : time;
      this.picture.board.now();
      this.speed.board.now();
      this.acceleration.board.now();
      if (!over) requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  async save() {
    if (!this.plan) return;
    const format = byId("export-format").value;
    const name = this.names()[0] ?? FORMULATIONS[0].name;
    const saved = await tried(() =>
      download("/api/export", { ...question(this.plan, name), format }, `movement.${format}`),
    );
    if (saved) say(`Saved as ${saved}.`);
  }
}

export function startMove() {
  new Move();
}
