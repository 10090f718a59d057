// Which names are mixed up: each movement recognized by the others.
import { get } from "../parts/api.js";
import { byId, fill, make } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { tried } from "../parts/toasts.js";

let version = -1; // of the library that is shown

/** Once it is asked for: it takes seconds. */
export async function showConfusion() {
  if (!byId("confusion").open || version === library().version) return;
  version = library().version;
  byId("confusion-text").textContent = "Each movement is recognized by the others …";
  fill(byId("confusion-table"));
  const answer = await tried(get("/api/confusion"));
  const words = answer && `${answer.in_words}. Rows: names; columns: what they are taken for.`;
  byId("confusion-text").textContent = words ?? "";
  if (!answer) return;
  const { names, counts } = answer;
  const head = names.map((name) => make("th", { scope: "col" }, make("span", {}, name)));
  const rows = names.map((name, i) => {
    const sum = counts[i].reduce((a, b) => a + b, 0);
    const cells = counts[i].map((n, j) => {
      const cell = make("td", i === j ? "right" : "wrong", n || "");
      cell.style.setProperty("--share", String(n / sum));
      return cell;
    });
    return make("tr", {}, make("th", { scope: "row" }, name), ...cells);
  });
  fill(byId("confusion-table"), make("tr", {}, make("td"), ...head), ...rows);
}
