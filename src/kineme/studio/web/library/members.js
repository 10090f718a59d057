// Movements as pictures that can be chosen, sixty at a time.
import { get } from "../parts/api.js";
import { button, counted, fill, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { thumbnail } from "../parts/thumbnails.js";
import { tried } from "../parts/toasts.js";

const PAGE = 60;

export function memberButton(movement, chosen, changed) {
  const about = `${movement.name ?? `Movement ${movement.id}`}, ${Number(movement.duration ?? 0).toFixed(1)} s`;
  if (library().read_only)
    return make("div", { class: "member", role: "img", "aria-label": about, title: about }, thumbnail(movement.path));
  const choose = () => {
    chosen.has(movement.id) ? chosen.delete(movement.id) : chosen.add(movement.id);
    member.setAttribute("aria-pressed", String(chosen.has(movement.id)));
    changed();
  };
  const member = button("", choose, {
    ...{ class: "member", "aria-label": about, title: about, "data-key": `movement ${movement.id}` },
    "aria-pressed": String(chosen.has(movement.id)),
  });
  member.append(thumbnail(movement.path));
  return member;
}

/** The members of a symbol, or the movements without one, with a button for more. */
export class Members {
  /** @param {string} query As `symbol=ID` or `unlabeled=1`. @param {() => void} changed When others are chosen. */
  constructor(query, changed) {
    this.query = query;
    this.changed = changed;
    this.chosen = new Set();
    const label = library().read_only ? "Movements" : "Movements; choose some";
    this.grid = make("div", { class: "members", role: "group", "aria-label": label });
    this.more = button("Show more", () => this.load(), { class: "button quiet", hidden: true });
    this.element = make("div", "members-part", this.grid, this.more);
    this.shown = 0;
    this.loading = false;
    this.load();
  }

  /** The next ones; once, however often it is asked for. */
  async load() {
    if (this.loading) return;
    this.loading = true;
    const part = `offset=${this.shown}&limit=${PAGE}&version=${library().version}`;
    const answer = await tried(get(`/api/library/movements?${this.query}&${part}`));
    this.loading = false;
    if (!answer) return;
    if (this.shown === 0) fill(this.grid);
    for (const movement of answer.movements) this.grid.append(memberButton(movement, this.chosen, this.changed));
    this.shown += answer.movements.length;
    this.more.hidden = this.shown >= answer.total;
    this.more.textContent = `Show more of ${counted(answer.total, "movement")}`;
  }

  ids() {
    return [...this.chosen];
  }
}
