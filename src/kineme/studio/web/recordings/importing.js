// A table that does not say how it is read: its first rows, what each column is, and the unit of time or the rate.
import { post } from "../parts/api.js";
import { byId, fill, make } from "../parts/elements.js";

const ROLES = ["leave out", "coordinate", "time"];

/**
 * Ask how a table is read, and read it so.
 * @param {any} sent What the server says of the file.
 * @param {string} name
 * @returns {Promise<any>} The recording; null if the person gave up.
 */
export function askHow({ recording, preview, unclear }, name) {
  const dialog = byId("importing");
  if (dialog.open) dialog.close("no");
  const roles = preview.heads.map((/** @type {string} */ head, /** @type {number} */ k) => {
    const at = head === preview.time ? 2 : preview.columns.includes(head) ? 1 : 0;
    return make(
      "select",
      { "aria-label": `What ${head} is`, disabled: !preview.numbers[k], on: { change: () => chose(k) } },
      ...ROLES.map((role, value) => make("option", { value: String(value), selected: value === at }, role)),
    );
  });
  const heads = (/** @type {number} */ role) =>
    preview.heads.filter((/** @type {string} */ _, /** @type {number} */ k) => Number(roles[k].value) === role);
  const chose = (/** @type {number} */ k) => {
    for (const [other, role] of roles.entries())
      if (other !== k && roles[k]?.value === "2" && role.value === "2") role.value = "0";
    const timed = heads(2).length > 0;
    if (k >= 0) byId("importing-units").value = heads(2)[0] === preview.time ? (preview.units ?? "") : "";
    byId("importing-units-part").hidden = !timed;
    byId("importing-rate-part").hidden = timed;
    byId("importing-rate").disabled = timed;
    byId("importing-open").disabled = !heads(1).length;
  };
  byId("importing-title").textContent = `How is ${name} read?`;
  byId("importing-text").textContent =
    `${unclear} These are its first rows. Say which column is what; what is chosen is a guess.`.trim();
  byId("importing-wrong").textContent = "";
  byId("importing-rate").value = String(preview.rate);
  byId("importing-units").value = preview.units ?? "";
  byId("importing-measured").value = "";
  byId("importing-measured-part").hidden = preview.measured_in !== null; // the file says it
  const cells = (/** @type {string} */ tag, /** @type {any[]} */ row) =>
    make("tr", {}, ...row.map((cell) => make(/** @type {"td"} */ (tag), {}, cell)));
  const [top, body] = [byId("importing-rows").tHead, byId("importing-rows").tBodies[0]];
  fill(top, cells("td", roles), cells("th", preview.heads));
  fill(body, ...preview.rows.map((/** @type {string[]} */ row) => cells("td", row)));
  chose(-1);
  dialog.returnValue = "no";
  dialog.showModal();
  return new Promise((done) => {
    const read = async (/** @type {SubmitEvent} */ event) => {
      if (/** @type {any} */ (event.submitter)?.value !== "yes") return;
      event.preventDefault();
      byId("importing-open").disabled = true;
      const [time = null] = heads(2);
      try {
        const answer = await post(`/api/recordings/${recording}/read`, {
          time,
          units: (time !== null && byId("importing-units").value) || null,
          rate: time === null ? byId("importing-rate").valueAsNumber : null,
          columns: heads(1),
          measured_in: byId("importing-measured").value || null,
        });
        done(answer);
        dialog.close("yes");
      } catch (error) {
        byId("importing-wrong").textContent = error.message;
      }
      byId("importing-open").disabled = false;
    };
    dialog.addEventListener("submit", read);
    dialog.addEventListener(
      "close",
      () => {
        dialog.removeEventListener("submit", read);
        done(null);
      },
      { once: true },
    );
  });
}
