// The symbols as cards: a picture, a name, how many movements; a box to choose several.
import { breakable, byId, counted, fill, keepingFocus, make } from "../parts/elements.js";
import { matching } from "../parts/find.js";
import { library } from "../parts/library_state.js";
import { thumbnail } from "../parts/thumbnails.js";

/** @type {Set<string>} Ids of the symbols that are chosen to be merged. */
export const chosen = new Set();

/** @param {{open: (id: string) => void, opened: string|null, chose: () => void}} page */
function card(symbol, page) {
  const box = make("input", {
    type: "checkbox",
    class: "choose changes",
    "aria-label": `Choose ${symbol.name}`,
    checked: chosen.has(symbol.id),
    "data-key": `choose ${symbol.id}`,
  });
  box.addEventListener("change", () => {
    if (box.checked) chosen.add(symbol.id);
    else chosen.delete(symbol.id);
    page.chose();
  });
  const open = make(
    "button",
    {
      class: "card-open",
      type: "button",
      "aria-current": symbol.id === page.opened ? "true" : null,
      "data-key": `open ${symbol.id}`,
      on: { click: () => page.open(symbol.id) },
    },
    thumbnail(symbol.path),
    make("span", { class: "card-name", title: symbol.name }, ...breakable(symbol.name)),
    make("span", "soft small", counted(symbol.n_members, "movement")),
  );
  return make("li", "card", open, box);
}

/** @param {{open: (id: string) => void, opened: string|null, chose: () => void}} page */
export function showCards(page) {
  const { symbols } = library();
  for (const id of chosen) if (!symbols.some((symbol) => symbol.id === id)) chosen.delete(id);
  const shown = matching(byId("find-symbol"), symbols);
  byId("none-found").textContent =
    symbols.length && !shown.length ? "No symbol has these words in its name or description." : "";
  keepingFocus(() => fill(byId("cards"), ...shown.map((symbol) => card(symbol, page))));
}
