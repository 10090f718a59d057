// A phone draws: the studio listens for it on the local network, once the person has asked for that.
import { get, post, remove } from "../parts/api.js";
import { byId, write } from "../parts/elements.js";
import { library } from "../parts/library_state.js";
import { canvasHeight } from "./scale.js";

const PATH = "/api/wand";

let asked; // last: the answer to an earlier question may come later

/** The address is none where the studio does not listen. */
async function showAddress(answer) {
  asked = answer;
  const { address, picture, fingerprint, error } = await answer.catch((error) => ({ error }));
  if (asked !== answer) return;
  write(byId("phone-problem"), error?.message ?? "");
  if (error) return;
  byId("phone-ask").hidden = Boolean(address);
  byId("phone-code").hidden = !address;
  byId("phone-picture").setAttribute("src", picture ?? "data:,");
  write(byId("phone-address"), address ?? "");
  write(byId("phone-fingerprint"), fingerprint ?? "");
  write(byId("phone-go"), address ? "Disconnect" : "Connect a phone");
}

export function offerPhone() {
  const dialog = byId("phone");
  byId("draw-phone").onclick = () => {
    dialog.showModal();
    showAddress(get(PATH));
  };
  byId("phone-close").onclick = () => dialog.close();
  byId("phone-form").onsubmit = (event) => {
    event.preventDefault();
    if (byId("phone-ask").hidden) return showAddress(remove(PATH));
    const where = { host: byId("phone-host").value.trim() || null, height: canvasHeight() };
    showAddress(post(PATH, { ...where, n_dims: library().n_dims === 3 ? 3 : 2 }));
  };
}
