// Proposals: groups of movements without a name. All or some of them get one, or they are not a symbol.
import { get } from "../parts/api.js";
import { accept, assign, reject } from "../parts/changes.js";
import { button, byId, counted, fill, keepingFocus, make, write } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { tried } from "../parts/toasts.js";
import { memberButton } from "./members.js";

const FETCHED = 500; // movements without a name whose pictures are asked for
const SHOWN = 12; // of one proposal

/** Movements without a name, by id. */
async function unlabeled() {
  const all = new Map();
  while (all.size < Math.min(library().unlabeled, FETCHED)) {
    const { movements } = await get(`/api/library/movements?unlabeled=1&offset=${all.size}&limit=60`);
    if (!movements.length) break;
    for (const movement of movements) all.set(movement.id, movement);
  }
  return all;
}

function card({ id, medoid, members, name }, movements) {
  const chosen = new Set();
  const field = make("input", {
    ...{ type: "text", list: "names", maxlength: "200", placeholder: "Name", value: name ?? "" },
    ...{ "aria-label": "Name of these movements", "data-key": `proposal ${medoid}` },
  });
  const yes = make("button", { class: "button main", type: "submit" });
  const label = () => write(yes, chosen.size ? `Name the ${chosen.size} chosen` : `Name all ${members.length}`);
  label();
  const shown = [...new Set([medoid, ...members])].slice(0, SHOWN);
  const about = library().read_only ? "Its movements" : "Its movements; choose some to name those alone";
  const pictures = shown.map((id) => memberButton(movements.get(id) ?? { id }, chosen, label));
  const grid = make("div", { class: "members", role: "group", "aria-label": about }, ...pictures);
  const no = button("Not a symbol", () => reject(id), { class: "button quiet" });
  const onsubmit = (event) => {
    event.preventDefault();
    const name = field.value.trim();
    if (!name) return field.focus();
    return chosen.size ? assign([...chosen], name) : accept(id, name);
  };
  const form = library().read_only ? null : make("form", { class: "naming", onsubmit }, field, yes, no);
  return make("li", "card proposal", make("p", "soft small", counted(members.length, "alike movement")), grid, form);
}

function groups(count) {
  if (count > 1) return `${count} groups of them may be a symbol each.`;
  return count
    ? "One group of them may be a symbol."
    : "They form no clear groups yet; choose those that belong together under Show all.";
}

export async function showProposals() {
  const { unlabeled: count, version } = library();
  byId("proposals").hidden = count === 0;
  if (!count) return;
  const answers = await tried(Promise.all([get("/api/proposals"), unlabeled()]));
  if (!answers || version !== library().version) return;
  const [{ proposals }, movements] = answers;
  byId("proposals-text").textContent = `${counted(count, "movement")} without a name. ${groups(proposals.length)}`;
  keepingFocus(() => fill(byId("proposal-cards"), ...proposals.map((proposal) => card(proposal, movements))));
}
