// The movement that Move shows: its plan, how it moves in each formulation, and the parts of the view that show it.
import { Camera } from "../parts/camera.js";
import { byId } from "../parts/elements.js";
import { Plot } from "../parts/plots.js";
import { FORMULATIONS } from "./formulations.js";
import { Handles } from "./handles.js";
import { MovePicture } from "./picture.js";
import { extent, rounded } from "./plan.js";
import { Rollouts } from "./rollouts.js";
import { Steps } from "./steps.js";

export class Session {
  /**
   * @param {Object} page
   * @param {(session: Session) => void} page.moved A path is another one.
   * @param {(session: Session, dragging: boolean) => void} page.dragged A point is held, or let go.
   * @param {(session: Session, place: import("./plan.js").ViaPoint, event: PointerEvent) => void} page.grabbed
   */
  constructor(page) {
    /** @type {import("./plan.js").Plan|null} */
    this.plan = null;
    /** @type {{id: string}|null} The symbol that moves; another object whenever it starts anew. */
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
    /** @type {string|null} Formulations in it. */
    this.legend = null;
    this.playback = {}; // that is under way
    this.resting = 0; // timer that waits until a style slider rests
  }
}

/** Formulations that move: those that are ticked; a style moves in its own alone. @param {Session} session */
export const movingFormulations = ({ plan, ticked }) => (plan?.style ? [plan.styled] : [...ticked]);
