// A file from the person to the server: dropped on the page or chosen.
import { request } from "../parts/api.js";
import { byId } from "../parts/elements.js";
import { tried } from "../parts/toasts.js";
import { currentView } from "../parts/views.js";

/** @param {File} file @returns {Promise<any>} */
async function send(file) {
  byId("drop-state").textContent = `Reading ${file.name} …`;
  byId("drop").classList.add("busy");
  const response = await tried(() => request("/api/recordings", { method: "POST", body: file, headers: { "X-File-Name": encodeURIComponent(file.name), "Content-Type": "application/octet-stream" } }));
  byId("drop").classList.remove("busy");
  byId("drop-state").textContent = response ? "" : "It could not be read. The command kineme learn reads whole folders.";
  return response?.json();
}

/** @param {(recording: any, name: string) => void} read */
export function startDropping(read) {
  const take = async (/** @type {FileList|undefined} */ files) => {
    const file = files?.[0];
    if (!file) return;
    const recording = await send(file);
    if (recording) read(recording, file.name);
  };
  byId("file").addEventListener("change", (/** @type {any} */ event) => take(event.target.files).finally(() => (event.target.value = "")));
  const over = (/** @type {DragEvent} */ event) => {
    if (currentView() !== "recordings") return;
    event.preventDefault();
    byId("drop").classList.toggle("over", event.type === "dragover");
  };
  for (const name of ["dragover", "dragleave"]) document.addEventListener(name, /** @type {any} */ (over));
  document.addEventListener("drop", (event) => {
    over(event);
    if (currentView() === "recordings") take(event.dataTransfer?.files);
  });
}
