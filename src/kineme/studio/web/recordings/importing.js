// A table that does not say how it is read: its first rows, what each column is, and the unit of time or the rate.
import { post } from "../parts/api.js";
import { byId, fill, make } from "../parts/elements.js";

/**
 * Ask how a table is read, and read it so.
 * @param {any} sent What the server says of the file.
 * @param {string} name
 * @returns {Promise<any>} The recording; null if the person gave up.
 */
export function askHow({ recording, preview, unclear }, name) {
  const [dialog, table] = [byId("importing"), byId("importing-rows")];
  const form = /** @type {HTMLFormElement} */ (dialog.firstElementChild);
  form.reset();
  const row = (/** @type {string} */ head, /** @type {any[]} */ cells) =>
    make("tr", {}, make("th", { scope: "row" }, head), ...cells.map((cell) => make("td", {}, cell)));
  /** @type {(type: string, key: string, chosen: (head: string) => boolean) => HTMLElement[]} */
  const boxes = (type, key, chosen) =>
    preview.heads.map((/** @type {string} */ value, /** @type {number} */ k) =>
      make("input", {
        ...{ type, name: key, value, "aria-label": `${value} is ${type === "radio" ? "the time" : "a coordinate"}` },
        ...{ checked: chosen(value), disabled: !preview.numbers[k] },
      }),
    );
  const none = make("input", { type: "radio", name: "time", value: "", checked: preview.time === null });
  const times = row(
    "Time",
    boxes("radio", "time", (head) => head === preview.time),
  );
  times.cells[0].append(make("label", { class: "soft" }, " ", none, " none"));
  fill(table.tHead, row("", preview.heads));
  fill(
    table.tBodies[0],
    times,
    row(
      "Coordinates",
      boxes("checkbox", "columns", (head) => preview.columns.includes(head)),
    ),
    ...preview.rows.map((/** @type {string[]} */ cells, /** @type {number} */ k) => row(k ? "" : "First rows", cells)),
  );
  for (const key of ["units", "rate"]) form.elements[key].value = preview[key] ?? "";
  byId("importing-title").textContent = `How is ${name} read?`;
  byId("importing-text").textContent = `${unclear} Say which column is what; what is chosen is a guess.`.trim();
  byId("importing-wrong").textContent = "";
  byId("importing-measured-part").hidden = preview.measured_in !== null; // the file says it
  dialog.returnValue = "no";
  if (!dialog.open) dialog.showModal();
  return new Promise((done) => {
    form.onsubmit = async (event) => {
      if (/** @type {any} */ (event.submitter)?.value !== "yes") return;
      event.preventDefault();
      const data = new FormData(form);
      const said = Object.fromEntries([...data].filter(([, value]) => value));
      const body = { ...said, columns: data.getAll("columns") };
      try {
        done(await post(`/api/recordings/${recording}/read`, body));
        dialog.close("yes");
      } catch (error) {
        byId("importing-wrong").textContent = error.message;
      }
    };
    dialog.onclose = () => done(null);
  });
}
