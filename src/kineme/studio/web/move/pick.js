// What moves: the symbols as pictures in a row, one chosen.
import { breakable, byId, fill, keepingFocus, make } from "../parts/elements.js";
import { matching } from "../parts/find.js";
import { server } from "../parts/server.js";
import { thumbnail } from "../parts/thumbnails.js";

/** @param {string|null} chosen @param {(id: string) => void} choose */
export function showPick(chosen, choose) {
  const option = (/** @type {any} */ symbol) => {
    const radio = make("input", {
      type: "radio",
      name: "move",
      class: "away",
      checked: symbol.id === chosen,
      "data-key": `pick ${symbol.id}`,
      on: { change: () => choose(symbol.id) },
    });
    return make(
      "label",
      { class: "pick-one" },
      radio,
      make(
        "span",
        { class: "pick-face" },
        thumbnail(symbol.path),
        make("span", { class: "pick-name", title: symbol.name }, ...breakable(symbol.name)),
      ),
    );
  };
  const symbols = matching(
    byId("find-pick"),
    server.symbols().filter((/** @type {any} */ symbol) => symbol.path),
  );
  keepingFocus(() => fill(byId("move-pick"), ...symbols.map(option)));
  const at = byId("move-pick").querySelector(":checked")?.closest("label");
  const row = byId("move-pick");
  if (at) row.scrollLeft = at.offsetLeft - row.offsetLeft - row.clientWidth / 2;
}
