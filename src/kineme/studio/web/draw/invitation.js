// What the empty canvas says, and whether one may draw on it.
import { breakable, byId, fill, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { thumbnail } from "../parts/thumbnails.js";

const SHOWN = 12; // symbols whose pictures say what can be drawn
const SAME_HEIGHT = 1e-9; // of points of a plane movement

/** Whether drawings fit the library: in the plane, or in space where all movements are plane. */
export function takesDrawings() {
  const { n_dims: dims, symbols } = library();
  if (dims === null || dims === 2) return true;
  const isPlane = (path) => path.every((point) => Math.abs(point[2] - path[0][2]) < SAME_HEIGHT);
  return dims === 3 && symbols.every((symbol) => !symbol.path || isPlane(symbol.path));
}

/** Show the invitation, or the canvas that a movement has filled. */
export function showInvitation(filled) {
  const [{ symbols }, takes] = [library(), takesDrawings()];
  showLegend(filled);
  byId("draw-empty-title").textContent = takes ? "Draw a movement here" : "Movements in space";
  byId("draw-empty-text").textContent = takes
    ? "In one stroke, with mouse, pen or finger."
    : "A mouse cannot draw them. Send samples from a program and see them here, or drop a recording in Recordings.";
  if (!takes) byId("live-source").open = true;
  byId("draw-examples").hidden = byId("first-steps").hidden = symbols.length > 0;
  byId("known-title").hidden = !symbols.length || !takes;
  fill(byId("known-symbols"), ...symbols.slice(0, SHOWN).map(picture));
}

const picture = ({ name, path }) => make("li", {}, thumbnail(path), make("span", { title: name }, ...breakable(name)));

/** Where a movement has filled the canvas the invitation goes, and what its colors mean is said. */
export function showLegend(filled) {
  const { symbols } = library();
  byId("draw-empty").hidden = filled;
  byId("draw-legend").hidden = !filled || !symbols.length;
  byId("view-draw").dataset.state = filled ? (symbols.length ? "drawn" : "first") : "empty";
}
