// "Save picture": what a canvas shows, on white and with its name, as SVG or PNG.
import { paintOnPaper } from "./canvas.js";
import { byId, make } from "./elements.js";
import { svg } from "./thumbnails.js";

const HEAD = 40; // height of the name [px]
const SHARP = 2; // pixels of a PNG for one on the screen

/** A context that writes SVG: as much of one as the pictures use; circles are whole. */
class Drawing {
  items = [];
  saved = [];
  x = 0;
  y = 0;
  d = "";
  dash = "none";
  globalAlpha = 1;
  lineCap = "butt";
  lineJoin = "miter";
  lineWidth;
  strokeStyle;
  fillStyle;
  font;
  textAlign;
  constructor(screen) {
    this.screen = screen;
  }
  save() {
    this.saved.push({ ...this });
  }
  restore() {
    Object.assign(this, this.saved.pop());
  }
  translate(x, y) {
    this.x += x;
    this.y += y;
  }
  setLineDash(dash) {
    this.dash = dash.join(" ") || "none";
  }
  beginPath() {
    this.d = "";
  }
  moveTo(x, y, letter = "M") {
    this.d += `${letter}${x + this.x} ${y + this.y}`;
  }
  lineTo(x, y) {
    this.moveTo(x, y, this.d ? "L" : "M");
  }
  closePath() {
    this.d += "Z";
  }
  arc(x, y, r) {
    this.moveTo(x - r, y);
    this.d += `a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0`;
  }
  rect(x, y, w, h) {
    this.moveTo(x, y);
    this.d += `h${w}v${h}h${-w}Z`;
  }
  roundRect(x, y, w, h) {
    this.rect(x, y, w, h);
  }
  fillRect(...box) {
    this.beginPath();
    this.rect(...box);
    this.fill();
  }
  measureText(text) {
    this.screen.font = this.font;
    return this.screen.measureText(text);
  }
  stroke() {
    this.add("path", { d: this.d, ...this.pen() });
  }
  fill() {
    this.add("path", { d: this.d, fill: this.fillStyle });
  }
  strokeText(text, x, y) {
    this.text(text, x, y, this.pen());
  }
  fillText(text, x, y) {
    this.text(text, x, y, { fill: this.fillStyle });
  }
  text(text, x, y, look) {
    const anchor = { center: "middle", right: "end" }[this.textAlign] ?? "start";
    this.add("text", { x: x + this.x, y: y + this.y, "text-anchor": anchor, ...look }, text);
    this.items.at(-1).style.font = this.font;
  }
  pen() {
    const ends = { "stroke-linecap": this.lineCap, "stroke-linejoin": this.lineJoin };
    const line = { stroke: this.strokeStyle, "stroke-width": this.lineWidth, "stroke-dasharray": this.dash };
    return { fill: "none", ...line, ...ends };
  }
  add(tag, look, ...inside) {
    this.items.push(svg(tag, { opacity: this.globalAlpha, ...look }, ...inside));
  }
}

function drawn(canvas, name) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight + HEAD];
  const { items } = paintOnPaper(canvas, (screen) => new Drawing(screen));
  const look = { "font-family": "system-ui,sans-serif", "font-size": 18, "font-weight": 600 };
  return svg(
    "svg",
    { xmlns: "http://www.w3.org/2000/svg", width, height, viewBox: `0 ${-HEAD} ${width} ${height}` },
    svg("title", {}, name),
    svg("rect", { y: -HEAD, width, height, fill: "#fff" }),
    svg("text", { x: 16, y: -12, ...look }, name),
    ...items,
  );
}

/** Save a canvas, by its id, as svg or png, with the name that an element says. */
async function save(canvas, naming, kind) {
  const shown = byId(naming).textContent.trim();
  const name = /\p{L}|\p{N}/u.test(shown) ? shown : "Drawing";
  const picture = drawn(byId(canvas), name);
  let href = `data:image/svg+xml,${encodeURIComponent(new XMLSerializer().serializeToString(picture))}`;
  if (kind === "png") {
    const image = make("img", { src: href });
    await image.decode();
    const sheet = make("canvas", { width: SHARP * image.width, height: SHARP * image.height });
    sheet.getContext("2d").drawImage(image, 0, 0, sheet.width, sheet.height);
    href = sheet.toDataURL();
  }
  make("a", { href, download: `${name}.${kind}` }).click();
}

/** Listen to the control of each picture. */
export function startSaving() {
  for (const menu of document.querySelectorAll(".saving"))
    for (const choice of menu.querySelectorAll("button"))
      choice.onclick = () => {
        menu.removeAttribute("open");
        save(menu.dataset.picture, menu.dataset.name, choice.textContent.toLowerCase());
      };
}
