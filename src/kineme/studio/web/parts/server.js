// The library of a server, in five functions; the page without a server has the same of a snapshot.
import { post } from "./api.js";
import { library } from "./library_state.js";
import { Sending } from "./sending.js";

/** @satisfies {Backend} */
export const server = {
  symbols: () => library().symbols,
  recognize: (movement) => post("/api/recognize", movement),
  explain: (movement) => post("/api/why", movement),
  follow: (send) => new Sending(send),
  generate: (question) => post("/api/rollout", question),
};
