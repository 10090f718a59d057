// Draw movements in a cell of a notebook: each gets the name that is in the field.

import { followKeys } from "../web/draw/keyboard_pen.js";
import { Board, color } from "../web/parts/canvas.js";
import { breakable, byId, counted, fill, make, write } from "../web/parts/elements.js";
import { line, mark } from "../web/parts/lines.js";
import { followPointer } from "../web/parts/stroke.js";
import { thumbnail } from "../web/parts/thumbnails.js";
import { hearNotebook, tell } from "./telling.js";

const FEWEST = 4; // samples of a movement
const SHOWN = 24; // drawings, the last ones

let [stroke, pen] = [[], null];
const board = new Board(byId("stage"), ({ context, height }) => {
  const points = stroke.map(([, x, y]) => [x * height, (1 - y) * height]);
  line(context, points, { color: color("--ink"), width: 4 });
  if (points.length) mark(context, points[0], "dot", 6, color("--ink"));
  if (pen) mark(context, [pen[0] * height, (1 - pen[1]) * height], "ring", 9, color("--text"));
});

/** @type {import("../web/parts/stroke.js").Hearer} */
const hearer = {
  begins: () => {
    stroke = [];
    write(byId("hint"), "");
    return true;
  },
  goes: (samples) => {
    stroke.push(...samples.map((sample) => sample.map((value) => Number(value.toFixed(5)))));
    board.draw();
  },
  ends: () => {
    if (stroke.length < FEWEST) write(byId("hint"), "That was too short: press, draw, and let go at the end");
    else tell({ drawn: [byId("name").value.trim() || null, stroke] });
  },
  pen: (at) => {
    pen = at;
    board.draw();
  },
};

/** Show the drawings that the notebook has. */
hearNotebook(({ drawn }) => {
  write(byId("count"), drawn.length ? counted(drawn.length, "drawing") : "No drawing yet");
  const items = drawn.slice(-SHOWN).map(([name, samples]) => {
    const words = name === null ? ["no name"] : breakable(name);
    return make("li", {}, thumbnail(samples.map(([, ...point]) => point)), make("span", {}, ...words));
  });
  fill(byId("symbols"), ...items.reverse());
  byId("undo").disabled = byId("clear").disabled = !drawn.length;
  byId("undo").onclick = () => tell({ undo: 1 });
  byId("clear").onclick = () => tell({ undo: drawn.length });
});
followPointer(byId("stage"), hearer);
followKeys(byId("stage"), hearer);
