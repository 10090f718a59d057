// An arm draws along: its tip goes where the hand is on the canvas, while the hand is there.
import { get, post } from "./api.js";
import { openArm } from "./arm_frame.js";
import { byId } from "./elements.js";

let send = null; // to the frame of the arm, once there is one
const state = { robot: "", hand: [0, 0], joints: null };
let [asking, newer] = [false, false];

/** The newest place of the hand is asked for, one at a time. */
async function follow() {
  newer = true;
  if (asking) return;
  asking = true;
  while (newer) {
    newer = false;
    const answer = await post("/api/robots/follow", state).catch(() => null);
    if (!answer) continue;
    state.joints = answer.joints;
    send({ posture: state.joints });
  }
  asking = false;
}

/** A sample of the canvas, which is 1 high, is a time, across and up. */
export function mirror([, x, y]) {
  const { width, height } = byId("draw-canvas").getBoundingClientRect();
  const half = Math.min(width / height, 1) / 2;
  state.hand = [(x - width / height / 2) / half, (y - 0.5) / half];
  if (send && byId("mirror").open) follow();
}

export function startMirror() {
  byId("mirror").ontoggle = async () => {
    if (!byId("mirror").open || send) return;
    const arms = await get("/api/robots").catch((error) => ({ why: error.message }));
    byId("mirror-note").textContent = arms.why ?? "Its tip goes where you draw.";
    if (!arms.available) return;
    [state.robot] = arms.robots;
    const [to, { scene }] = await Promise.all([
      openArm(byId("mirror-arm"), "/arm.html?mini", () => {}),
      get(`/api/robots/${state.robot}`),
    ]);
    to({ scene, joints: [] });
    send = to;
  };
}
