// A file from the person to the server: dropped on the page or chosen.
import { request } from "../parts/api.js";
import { byId, counted } from "../parts/elements.js";
import { currentView, show } from "../parts/views.js";
import { askHow } from "./importing.js";

/**
 * @param {File} file
 * @param {AbortSignal} signal
 * @returns {Promise<any>} What the server read; undefined where it did not.
 */
async function send(file, signal) {
  byId("drop-state").textContent = `Reading ${file.name} …`;
  byId("drop-state").classList.remove("went-wrong");
  const headers = { "X-File-Name": encodeURIComponent(file.name), "Content-Type": "application/octet-stream" };
  try {
    const response = await request("/api/recordings", { method: "POST", body: file, headers, signal });
    byId("drop-state").textContent = "";
    return await response.json();
  } catch (error) {
    if (signal.aborted) return undefined;
    byId("drop-state").textContent =
      error.status === undefined
        ? `${file.name} cannot be sent: expected a file, not a folder. The command kineme learn reads folders.`
        : error.message;
    byId("drop-state").classList.add("went-wrong");
    return undefined;
  }
}

/** @param {(recording: any, name: string) => void} read @param {(file: File) => boolean} film Takes a video. */
export function startDropping(read, film) {
  let sending = new AbortController();
  const take = async (/** @type {FileList|undefined} */ files) => {
    const file = files?.[0];
    if (!file || (file.type.startsWith("video/") && film(file))) return;
    sending.abort(); // only the last file is wanted
    sending = new AbortController();
    let recording = await send(file, sending.signal);
    if (recording?.unclear) {
      const clear = await askHow(recording, file.name);
      if (!clear && !recording.tables.length) byId("drop-state").textContent = `${file.name} was not opened.`;
      recording = clear ?? (recording.tables.length ? recording : undefined);
    }
    if (recording) read(recording, file.name);
    if (recording && files.length > 1)
      byId("drop-state").textContent =
        `One file at a time: ${file.name} is shown, ${counted(files.length - 1, "other")} not read.`;
  };
  byId("file").addEventListener("change", (/** @type {any} */ event) =>
    take(event.target.files).finally(() => (event.target.value = "")),
  );
  const over = (/** @type {DragEvent} */ event) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault(); // else the browser leaves the studio for the file
    byId("drop").classList.toggle("over", event.type === "dragover");
    if (event.type === "dragover" && currentView() !== "recordings") show("recordings");
  };
  for (const name of ["dragover", "dragleave"]) document.addEventListener(name, /** @type {any} */ (over));
  document.addEventListener("drop", (event) => {
    over(event);
    if (event.dataTransfer?.files.length) take(event.dataTransfer.files);
  });
}
