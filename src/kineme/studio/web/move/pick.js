// What moves: the symbols as pictures in a row, one chosen.
import { breakable, byId, fill, keepingFocus, make } from "../parts/elements.js";
import { matching } from "../parts/find.js";
import { server } from "../parts/server.js";
import { thumbnail } from "../parts/thumbnails.js";

export function showPick(chosen, choose) {
  const option = ({ id, name, path }) => {
    const state = { checked: id === chosen, "data-key": `pick ${id}`, onchange: () => choose(id) };
    const radio = make("input", { type: "radio", name: "move", class: "away", ...state });
    const words = make("span", { class: "pick-name", title: name }, ...breakable(name));
    return make("label", "pick-one", radio, make("span", "pick-face", thumbnail(path), words));
  };
  const movable = server.symbols().filter(({ path }) => path);
  const row = byId("move-pick");
  keepingFocus(() => fill(row, ...matching(byId("find-pick"), movable).map(option)));
  const at = row.querySelector(":checked")?.closest("label");
  if (at) row.scrollLeft = at.offsetLeft - row.offsetLeft - row.clientWidth / 2;
}
