// Draw movements in a cell of a notebook: each gets the name that is in the field.

import { followKeys } from "../web/draw/keyboard_pen.js";
import { Picture } from "../web/draw/picture.js";
import { breakable, byId, counted, fill, make, write } from "../web/parts/elements.js";
import { followPointer } from "../web/parts/stroke.js";
import { thumbnail } from "../web/parts/thumbnails.js";
import { hearNotebook, tell, tellDrawn } from "./telling.js";

const FEWEST = 4; // samples of a movement
const SHOWN = 24; // drawings, the last ones
const picture = new Picture(byId("stage"));

/** @type {Hearer} */
const hearer = {
  begins: () => {
    picture.ink = [];
    write(byId("hint"), "");
    return true;
  },
  goes: (samples) => {
    picture.ink.push(...samples.map((sample) => sample.map((value) => Number(value.toFixed(5)))));
    picture.board.draw();
  },
  ends: () => {
    if (picture.ink.length >= FEWEST) tellDrawn([byId("name").value.trim() || null, picture.ink]);
    else write(byId("hint"), "Too short: press, draw, and let go at the end");
  },
  pen: (at) => {
    picture.pen = at;
    picture.board.draw();
  },
};
followPointer(byId("stage"), hearer);
followKeys(byId("stage"), hearer);

hearNotebook(({ drawn }) => {
  write(byId("count"), drawn.length ? counted(drawn.length, "drawing") : "No drawing yet");
  const items = drawn.slice(-SHOWN).map(([name, samples]) => {
    const path = samples.map((sample) => sample.slice(1));
    return make("li", {}, thumbnail(path), make("span", {}, ...breakable(name ?? "no name")));
  });
  fill(byId("symbols"), ...items.reverse());
  byId("undo").disabled = byId("clear").disabled = !drawn.length;
  byId("undo").onclick = () => tell({ drawn: drawn.slice(0, -1) });
  byId("clear").onclick = () => tell({ drawn: [] });
});
