// One symbol: its name, its description, its movements, and what can be done with them.
import { get, path } from "../parts/api.js";
import * as changes from "../parts/changes.js";
import { ask } from "../parts/dialogs.js";
import { breakable, button, byId, counted, fill, make } from "../parts/elements.js";
import { library, symbolOf } from "../parts/library_state.js";
import { Overlay } from "../parts/overlay.js";
import { thumbnail } from "../parts/thumbnails.js";
import { tried } from "../parts/toasts.js";
import { show } from "../parts/views.js";
import { chooseToMove } from "../parts/chosen.js";
import { Members } from "./members.js";

const action = (text, act, kind = "") => button(text, act, { class: `button ${kind}`, "data-key": `symbol ${text}` });

async function rename(symbol) {
  const name = await ask({ title: `Rename ${symbol.name}`, yes: "Rename", name: symbol.name });
  if (name && name !== symbol.name) await changes.rename(symbol.id, name);
}

async function forget(symbol) {
  const text = "Its movements stay in the library without a name. This can be undone.";
  if (await ask({ title: `Delete ${symbol.name}?`, text, yes: "Delete", danger: true }))
    await changes.forget(symbol.id, symbol.name);
}

function description(symbol) {
  const placeholder = "What it means, for people and planners";
  const onchange = ({ target }) => changes.describe(symbol.id, target.value);
  const field = make("textarea", { rows: 2, maxlength: "2000", placeholder, onchange }, symbol.description);
  return make("label", "field", make("span", {}, "Description"), field);
}

/** What can be done with chosen movements of a symbol, or of none. @param {Members} members */
function actions(symbol, members) {
  const ids = () => members.ids();
  const some = () => counted(ids().length, "movement");
  const named = (title, text, yes) => ask({ title, text: `${some()} ${text}`, yes, name: "" });
  const give = async () => {
    const text = "chosen. A name that exists is that symbol, another one is a new symbol.";
    const to = await named("Which name?", text, "Give the name");
    if (to) await changes.assign(ids(), to);
  };
  const split = async () => {
    const to = await named(`Split ${symbol.name}`, "become a symbol of their own.", "Split");
    if (to) await changes.split(symbol.id, ids(), to);
  };
  const drop = async () => {
    const question = { title: `Delete ${some()}?`, text: "This can be undone.", yes: "Delete", danger: true };
    if (await ask(question)) await changes.deleteMovements(ids());
  };
  const unname = () => changes.assign(ids(), null);
  const buttons = symbol
    ? [action("Split off", split), action("Give another name", give), action("Remove the name", unname)]
    : [action("Give a name", give, "main")];
  return [...buttons, action("Delete", drop, "danger")];
}

/**
 * The side panel of a symbol, or of the movements without one; in a narrow window a sheet at the lower edge, which
 * closes.
 */
export class SymbolPanel {
  constructor(closed) {
    this.closed = closed;
    this.hint = byId("symbol").firstElementChild;
    byId("symbol").addEventListener("keydown", ({ key }) => key === "Escape" && this.close());
    this.opened = null; // id; "" for the movements without a symbol
    this.version = -1;
  }

  open(id, focus = false) {
    this.opened = id;
    this.version = -1;
    this.show();
    byId("symbol").scrollTop = 0;
    if (focus) byId("symbol").focus({ preventScroll: true });
  }

  close() {
    const id = this.opened ?? "";
    this.clear();
    this.closed(id);
  }

  show() {
    const panel = byId("symbol");
    const symbol = this.opened ? symbolOf(this.opened) : null;
    if (!symbol && (this.opened !== "" || !library().unlabeled)) return this.clear();
    if (this.version === library().version) return;
    this.version = library().version;
    panel.classList.add("opened");
    const hint = `Choose two to compare, or some to ${symbol ? "change" : "name"}.`;
    const count = make("p", { class: "soft small", role: "status" }, hint);
    const canvas = make("canvas", { role: "img", "aria-label": "Both, one over the other" });
    const words = make("figcaption", { class: "small", role: "status" });
    const compared = make("figure", { class: "compared", hidden: true }, canvas, words);
    const overlay = new Overlay(canvas);
    const members = new Members(symbol ? path`symbol=${symbol.id}` : "unlabeled=1", async () => {
      const ids = members.ids();
      for (const act of acts) act.disabled = !ids.length;
      count.textContent = ids.length ? `${counted(ids.length, "movement")} chosen` : hint;
      compared.hidden = true;
      if (ids.length !== 2) return;
      const both = await tried(get(`/api/compare?first=${ids[0]}&second=${ids[1]}`));
      if (!both || String(members.ids()) !== String(ids)) return; // others are chosen by now
      words.textContent = `${both.in_words}.`;
      compared.hidden = false;
      overlay.show({ ...both.nearest, drawn: both.path });
    });
    const acts = library().read_only ? [] : actions(symbol, members);
    for (const act of acts) act.disabled = true;
    const bar = make("div", { class: "row", role: "group", "aria-label": "Chosen movements" }, ...acts);
    const close = { class: "button quiet square sheet-close", "aria-label": "Close" };
    fill(
      panel,
      button("×", () => this.close(), close),
      ...(symbol ? this.head(symbol) : [make("h2", {}, "Without a name")]),
      make("h3", {}, counted(symbol ? symbol.n_members : library().unlabeled, "movement")),
      ...(acts.length ? [count, bar] : []),
      members.element,
      compared,
    );
  }

  head(symbol) {
    const moveIt = () => {
      chooseToMove(symbol.id);
      show("move", true);
    };
    const { read_only: readOnly } = library();
    const facts = symbol.duration ? `${symbol.duration.toFixed(1)} s` : "";
    const words = make("div", {}, make("h2", {}, ...breakable(symbol.name)), make("p", "soft", facts));
    const acts = [
      action("Move it", moveIt, "main"),
      action("Rename", () => rename(symbol)),
      action("Delete symbol", () => forget(symbol), "danger"),
    ];
    return [
      make("div", "symbol-head", thumbnail(symbol.path), words),
      make("div", "row", ...acts.slice(0, readOnly ? 1 : 3)),
      readOnly ? symbol.description && make("p", {}, symbol.description) : description(symbol),
    ];
  }

  /** Say what can be done here. */
  clear() {
    this.opened = null;
    byId("symbol").classList.remove("opened");
    fill(byId("symbol"), this.hint);
  }
}
