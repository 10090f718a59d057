// A canvas as sharp as the screen, drawn once per frame and only when something changed.

const boards = new Set();

export class Board {
  /** @param {(board: Board) => void} paint */
  constructor(canvas, paint) {
    this.canvas = canvas;
    this.paint = paint;
    this.context = canvas.getContext("2d");
    this.width = 0;
    this.height = 0;
    this.frame = 0;
    this.resized = null; // what follows when the canvas has another size
    this.running = null;
    boards.add(this);
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.fit();
  }

  fit() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    const sharp = Math.min(window.devicePixelRatio || 1, 3);
    this.width = clientWidth;
    this.height = clientHeight;
    this.canvas.width = Math.round(clientWidth * sharp);
    this.canvas.height = Math.round(clientHeight * sharp);
    this.context.setTransform(sharp, 0, 0, sharp, 0, 0);
    this.resized?.();
    this.draw();
  }

  /** Paint in the next frame. */
  draw() {
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = 0;
      this.now();
    });
  }

  /** Call in each frame with the seconds since now, until that is false or another run begins. */
  run(step) {
    const began = performance.now();
    const next = (now) => {
      if (this.running === next && step(Math.max(now - began, 0) / 1000)) requestAnimationFrame(next);
    };
    this.running = next;
    requestAnimationFrame(next);
  }

  /** Paint at once. */
  now() {
    if (!this.width) return;
    this.context.clearRect(0, 0, this.width, this.height);
    this.paint(this);
  }
}

const colors = new Map();

/** The color that a token has now. */
export function color(token) {
  if (!colors.has(token)) colors.set(token, getComputedStyle(document.documentElement).getPropertyValue(token).trim());
  return colors.get(token);
}

/** Paint the board of a canvas with another context, in the colors of paper. */
export function paintOnPaper(canvas, contextOf) {
  const board = [...boards].find((other) => other.canvas === canvas);
  const rules = /** @type {CSSStyleRule[]} */ ([...document.styleSheets].flatMap(({ cssRules }) => [...cssRules]));
  const { style } = rules.find((rule) => rule.selectorText === ":root");
  for (const token of style) colors.set(token, style.getPropertyValue(token).trim());
  const screen = board.context;
  const context = contextOf(screen);
  board.context = context;
  board.paint(board);
  board.context = screen;
  recolor();
  return context;
}

/** Paint again, after tokens have other colors. */
export function recolor() {
  colors.clear();
  for (const board of boards) board.draw();
}
window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolor);
