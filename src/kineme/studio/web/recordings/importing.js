// A table that does not say how it is read: its first rows, what each column is, and the unit of time or the rate.
import { post } from "../parts/api.js";
import { byId, fill, make } from "../parts/elements.js";

/** Ask how a table is read, and read it so: the recording; null if the person gave up. @returns {Promise<any>} */
export function askHow({ recording, preview, unclear }, name) {
  const [dialog, table] = [byId("importing"), byId("importing-rows")];
  const form = dialog.querySelector("form");
  form.reset();
  const { heads } = preview;
  const row = (head, cells) =>
    make("tr", {}, make("th", { scope: "row" }, head), ...cells.map((cell) => make("td", {}, cell)));
  const box = (type, name, chosen) => (value, k) => {
    const state = { checked: chosen.includes(value), disabled: preview.numbers[k] === false };
    return make("input", { type, name, value, ...state, "aria-label": `${name} ${value}` });
  };
  const time = box("radio", "time", [preview.time ?? ""]);
  const times = row("Time", heads.map(time));
  times.cells[0].append(make("label", "soft", " ", time("", -1), " none"));
  const columns = row("Coordinates", heads.map(box("checkbox", "columns", preview.columns)));
  const rows = preview.rows.map((cells, k) => row(`Row ${k + 1}`, cells));
  fill(table.tHead, row("Column", heads));
  fill(table.tBodies[0], times, columns, ...rows);
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
      if (event.submitter.matches("[value='']")) return;
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
