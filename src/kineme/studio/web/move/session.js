// The movement that Move shows: its plan, how it moves in each formulation, and the parts of the view that show it.
import { Camera } from "../parts/camera.js";
import { byId } from "../parts/elements.js";
import { Plot } from "../parts/plots.js";
import { FORMULATIONS } from "./formulations.js";
import { Handles } from "./handles.js";
import { MovePicture } from "./picture.js";
import { extent, rounded } from "./plan.js";
import { Rollouts } from "./rollouts.js";
import { Steps } from "../parts/steps.js";

export class Session {
  /** The page is told when a path is another one, and when a point or the path is held. */
  constructor(page) {
    /** @type {Plan|null} */
    this.plan = null;
    /** @type {{symbol: string}|null} What moves; another object whenever it starts anew. */
    this.chosen = null;
    this.version = -1; // of the library when the symbol was chosen
    this.dragging = false; // a point is held
    this.steps = new Steps();
    this.camera = new Camera();
    this.handles = new Handles(this.camera, {
      moving: (dragging) => page.dragged(this, dragging),
      text: (value) => rounded(value, extent(this.plan.path)),
    });
    this.picture = new MovePicture(
      this.camera,
      () => this.handles.place(),
      (place, event) => this.plan && page.grabbed(this, place, event),
    );
    this.speed = new Plot(byId("plot-speed"));
    this.acceleration = new Plot(byId("plot-acceleration"));
    this.ticked = new Set([FORMULATIONS[0].name]);
    this.rollouts = new Map(FORMULATIONS.map(({ name }) => [name, new Rollouts(name, () => page.moved(this))]));
    this.legend = null; // formulations in it
    this.resting = 0; // timer that waits until a style slider rests
  }
}

/** Formulations that move: those that are ticked; a style moves in its own alone. @param {MoveSession} session */
export const movingFormulations = ({ plan, ticked }) => (plan?.style ? [plan.styled] : [...ticked]);
