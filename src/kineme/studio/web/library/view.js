// Library: symbols, those that are proposed, the map, the history.
import { merge } from "../parts/changes.js";
import { ask } from "../parts/dialogs.js";
import { byId, counted, keyed } from "../parts/elements.js";
import { startFinding } from "../parts/find.js";
import { library, symbolOf } from "../parts/library_state.js";
import { onShow } from "../parts/views.js";
import { chosen, showCards } from "./cards.js";
import { showConfusion } from "./confusion.js";
import { showHistory } from "./history.js";
import { MovementMap } from "./map.js";
import { showProposals } from "./proposals.js";
import { SymbolPanel } from "./symbol.js";

let shown = -1; // version

async function mergeChosen() {
  const ids = [...chosen];
  const names = ids.map((id) => symbolOf(id).name);
  const title = `Merge ${counted(ids.length, "symbol")}`;
  const into = await ask({ title, text: names.join(", "), yes: "Merge", name: names[0] });
  if (!into) return;
  chosen.clear();
  await merge(ids, into);
}

export function startLibrary() {
  const panel = new SymbolPanel((id) => {
    marked(null);
    keyed(`open ${id}`)?.focus();
  });
  const map = new MovementMap((id) => open(id));
  const chose = () => {
    byId("merging").hidden = library().symbols.length < 2;
    byId("chosen-count").textContent =
      chosen.size > 1 ? `${chosen.size} chosen` : chosen.size ? "1 chosen; tick another" : "Tick two or more";
    byId("merge").disabled = chosen.size < 2 || library().read_only;
  };
  const cards = () => showCards({ open, opened: panel.opened, chose });
  function marked(id) {
    for (const card of document.querySelectorAll(".card-open"))
      card.ariaCurrent = String(card.dataset.key === `open ${id}`);
  }
  function open(id) {
    panel.open(id, true);
    marked(id);
  }
  const all = () => {
    if (shown === library().version) return;
    shown = library().version;
    const nothing = library().n_movements === 0;
    byId("library-empty").hidden = library().symbols.length > 0;
    const advice = nothing ? "Draw one and name it, or drop recordings." : "Name movements that are here, or draw one.";
    byId("library-empty-text").textContent =
      `A symbol is a movement with a name. ${library().read_only ? "This library holds none." : advice}`;
    byId("library-head").hidden = !library().symbols.length;
    byId("history").hidden = byId("symbol").hidden = nothing;
    panel.show();
    cards();
    chose();
    map.load();
    showProposals();
    byId("confusion").hidden = library().symbols.length < 2;
    showConfusion();
    showHistory();
  };
  startFinding(byId("find-symbol"), cards, () => document.querySelector(".card-open"));
  byId("merge").onclick = mergeChosen;
  byId("show-unlabeled").onclick = () => open("");
  byId("history").ontoggle = showHistory;
  byId("confusion").ontoggle = showConfusion;
  onShow("library", all);
}
