// A file from the person to the server: dropped on the page or chosen.
import { request } from "../parts/api.js";
import { byId, counted } from "../parts/elements.js";
import { currentView, show } from "../parts/views.js";
import { askHow } from "./importing.js";

function state(text, wrong = false) {
  byId("drop-state").textContent = text;
  byId("drop-state").classList.toggle("went-wrong", wrong);
}

/** What the server read, as the person says; undefined where it did not. */
async function send(file, signal) {
  state(`Reading ${file.name} …`);
  const headers = { "X-File-Name": encodeURIComponent(file.name), "Content-Type": "application/octet-stream" };
  try {
    const response = await request("/api/recordings", { method: "POST", body: file, headers, signal });
    const read = await response.json();
    state("");
    const clear = read.unclear ? await askHow(read, file.name) : read;
    if (clear || read.tables.length) return clear ?? read;
    state(`${file.name} was not opened.`);
  } catch (error) {
    const folder = `${file.name} cannot be sent: expected a file. The command kineme learn reads folders.`;
    if (!signal.aborted) state(error.status === undefined ? folder : error.message, true);
  }
}

/** A file that was read is opened; a video is added to what is. @param {import("./view.js").Recordings} page */
export function startDropping(page) {
  let sending = new AbortController();
  const take = async (files) => {
    const file = files?.[0];
    if (!file || (page.read && file.type.startsWith("video/") && page.player.add(file))) return;
    sending.abort(); // only the last file is wanted
    sending = new AbortController();
    const recording = await send(file, sending.signal);
    if (!recording) return;
    page.open(recording, file.name);
    const others = files.length - 1;
    if (others) state(`One file at a time: ${file.name} is shown, ${counted(others, "other")} not read.`);
  };
  byId("file").onchange = () => take(byId("file").files).finally(() => (byId("file").value = ""));
  const over = (event) => {
    if (!event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault(); // else the browser leaves the studio for the file
    byId("drop").classList.toggle("over", event.type === "dragover");
    if (event.type === "dragover" && currentView() !== "recordings") show("recordings");
  };
  for (const name of ["dragover", "dragleave"]) document.addEventListener(name, over);
  document.addEventListener("drop", (event) => {
    over(event);
    if (event.dataTransfer?.files.length) take(event.dataTransfer.files);
  });
}
