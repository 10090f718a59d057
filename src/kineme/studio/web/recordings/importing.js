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
  /** @type {string[]} */
  const heads = preview.heads;
  /** @type {(head: string, cells: any[]) => HTMLTableRowElement} */
  const row = (head, cells) =>
    make("tr", {}, make("th", { scope: "row" }, head), ...cells.map((cell) => make("td", {}, cell)));
  /** @type {(type: string, name: string, chosen: string[], value: string, k?: number) => HTMLElement} */
  const box = (type, name, chosen, value, k) => {
    const disabled = preview.numbers[k] === false;
    return make("input", {
      type,
      name,
      value,
      disabled,
      checked: chosen.includes(value),
      "aria-label": `${name} ${value}`,
    });
  };
  const time = preview.time ?? "";
  const times = row(
    "Time",
    heads.map((head, k) => box("radio", "time", [time], head, k)),
  );
  times.cells[0].append(make("label", { class: "soft" }, " ", box("radio", "time", [time], ""), " none"));
  const columns = heads.map((head, k) => box("checkbox", "columns", preview.columns, head, k));
  fill(table.tHead, row("Column", heads));
  fill(table.tBodies[0], times, row("Coordinates", columns));
  for (const [k, cells] of preview.rows.entries()) table.tBodies[0].append(row(`Row ${k + 1}`, cells));
  /** @type {any} */
  const fields = form.elements;
  for (const key of ["units", "rate"]) fields[key].value = preview[key] ?? "";
  fields.measured_in.disabled = preview.measured_in !== null; // the file says it
  byId("importing-title").textContent = `How is ${name} read?`;
  byId("importing-text").textContent = `${unclear} Say which column is what; what is chosen is a guess.`;
  byId("importing-wrong").textContent = "";
  if (!dialog.open) dialog.showModal();
  return new Promise((done) => {
    form.onsubmit = async (event) => {
      if (!(/** @type {any} */ (event.submitter).value)) return;
      event.preventDefault();
      const data = new FormData(form);
      const said = Object.fromEntries([...data].filter(([, value]) => value));
      try {
        done(await post(`/api/recordings/${recording}/read`, { ...said, columns: data.getAll("columns") }));
        dialog.close();
      } catch (error) {
        byId("importing-wrong").textContent = error.message;
      }
    };
    dialog.onclose = () => done(null);
  });
}
