// Movements as pictures that can be chosen, sixty at a time.
import { get } from "../parts/api.js";
import { button, counted, fill, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { thumbnail } from "../parts/thumbnails.js";
import { tried } from "../parts/toasts.js";

const PAGE = 60;

export function memberButton(movement, chosen, changed) {
  const { id, name, path, duration } = movement;
  const title = `${name ?? `Movement ${id}`}, ${(duration ?? 0).toFixed(1)} s`;
  const look = { class: "member", "aria-label": title, title };
  if (library().read_only) return make("div", { ...look, role: "img" }, thumbnail(path));
  const choose = () => {
    chosen.delete(id) || chosen.add(id);
    member.ariaPressed = String(chosen.has(id));
    changed();
  };
  const member = button("", choose, { ...look, "data-key": `movement ${id}` });
  member.ariaPressed = String(chosen.has(id));
  member.append(thumbnail(path));
  return member;
}

/** The members of a symbol, or the movements without one, with a button for more. */
export class Members {
  /** The query is `symbol=ID` or `unlabeled=1`. */
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
