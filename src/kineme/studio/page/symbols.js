// The symbols: small pictures as buttons, one of them chosen; many are found by words of their names.

import { breakable, byId, make } from "../web/parts/elements.js";
import { matching, startFinding } from "../web/parts/find.js";
import { boxOf, Stage } from "./stage.js";

/** List the symbols in the view of the snapshot. */
export function createSymbols(symbols, view, choose) {
  const items = symbols.map(({ name, path }) => {
    const picture = make("canvas", { class: "picture", "aria-hidden": "true" });
    const act = { type: "button", title: name, onclick: () => choose(name) };
    const button = make("button", act, picture, make("span", {}, ...breakable(name)));
    const item = make("li", {}, button);
    byId("symbols").append(item);
    const stage = new Stage(picture, view, boxOf(path), () => {
      stage.line(path, "--ink", { width: 2 });
      stage.dot(path.at(-1), "--goal", { radius: 3.5, edge: 0.5 });
    });
    return { name, item, button, stage };
  });
  const find = () => {
    const names = new Set(matching(byId("find"), symbols).map((symbol) => symbol.name));
    for (const { name, item } of items) item.hidden = !names.has(name);
  };
  startFinding(byId("find"), find, () => items.find(({ item }) => !item.hidden)?.button ?? null);
  find();
  return {
    /** Mark the one of that name; none for null. */
    select: (chosen) => {
      for (const { name, button } of items) button.ariaPressed = String(name === chosen);
    },
    /** Turn and tilt the pictures by angles [degrees]. */
    turn: (angles) => {
      for (const { stage } of items) stage.turn(angles);
    },
  };
}
