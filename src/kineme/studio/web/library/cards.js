// The symbols as cards: a picture, a name, how many movements; a box to choose several.
import { breakable, button, byId, counted, fill, keepingFocus, make } from "../parts/elements.js";
import { matching } from "../parts/find.js";
import { library } from "../parts/library_state.js";
import { thumbnail } from "../parts/thumbnails.js";

/** Ids of the symbols that are chosen to be merged. */
export const chosen = new Set();

function card({ id, name, path, n_members: n }, page) {
  const onchange = ({ target }) => {
    if (target.checked) chosen.add(id);
    else chosen.delete(id);
    page.chose();
  };
  const state = { checked: chosen.has(id), "aria-label": `Choose ${name}`, "data-key": `choose ${id}`, onchange };
  const current = id === page.opened ? "true" : null;
  const look = { class: "card-open", "aria-current": current, "data-key": `open ${id}` };
  const open = button("", () => page.open(id), look);
  const words = make("span", { class: "card-name", title: name }, ...breakable(name));
  open.append(thumbnail(path), words, make("span", "soft small", counted(n, "movement")));
  return make("li", "card", open, make("input", { type: "checkbox", class: "choose changes", ...state }));
}

/** The page opens symbols, knows which one is opened, and is told when others are chosen. */
export function showCards(page) {
  const { symbols } = library();
  for (const id of chosen) if (!symbols.some((symbol) => symbol.id === id)) chosen.delete(id);
  const shown = matching(byId("find-symbol"), symbols);
  byId("none-found").textContent =
    symbols.length && !shown.length ? "No symbol has these words in its name or description." : "";
  keepingFocus(() => fill(byId("cards"), ...shown.map((symbol) => card(symbol, page))));
}
