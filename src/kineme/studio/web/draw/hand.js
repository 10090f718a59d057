// A hand that a camera sees: its index finger draws while the thumb touches it.
import { distance } from "../parts/geometry.js";
import { currentView } from "../parts/views.js";

const INDEX = 8; // the tip of the index finger, among the 21 landmarks of a hand
const PINCH = [4, INDEX]; // tips of thumb and index finger
const PALM = [0, 9]; // its ends
const [CLOSED, OPEN] = [0.3, 0.45]; // distance from thumb to index finger, in lengths of the palm
const PATIENCE = 500; // without landmarks, after which the hand has gone [ms]

/** @param {Hearer} hear @returns What takes the landmarks of one moment. */
export function handPen(picture, hear) {
  const { board } = picture;
  let down = false;
  let first = 0;
  let timer = 0;

  const lift = () => {
    if (down) hear.ends();
    down = false;
  };
  const leave = () => {
    lift();
    picture.hand = null;
    board.draw();
  };
  return ({ points, time, aspect }) => {
    clearTimeout(timer);
    if (currentView() !== "draw") return leave();
    const middle = board.width / board.height / 2;
    const hand = points.map(([x, y]) => [middle + (x - 0.5) * aspect, 1 - y]);
    const [pinched, palm] = [PINCH, PALM].map(([a, b]) => distance(hand[a], hand[b]));
    const pinch = pinched / palm;
    if (pinch > OPEN) lift();
    if (pinch < CLOSED && !down) {
      down = hear.begins("hand");
      first = time;
    }
    if (down) hear.goes([[time - first, ...hand[INDEX]]]);
    picture.hand = hand;
    board.draw();
    timer = setTimeout(leave, PATIENCE);
  };
}
