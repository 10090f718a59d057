// What the type checker knows of the studio's JavaScript: records, and the elements of its pages. No browser loads it.

/** Elements by their ids that are more than an HTMLElement. */
type Elements = Record<
  | "add-obstacle" | "add-span" | "add-via" | "ask-yes" | "clear" | "draw-clear" | "draw-move" | "draw-replay"
  | "draw-save" | "episodes-before" | "episodes-next" | "export" | "help" | "learn-file" | "learn-spans" | "merge"
  | "move-play" | "move-redo" | "move-reset" | "move-undo" | "naming-learn" | "play" | "play-recording" | "read-as"
  | "redo-span" | "reset" | "robot-free" | "robot-go" | "robot-save" | "save" | "save-corrections" | "save-spans"
  | "show-unlabeled" | "spot" | "spot-page" | "undo" | "undo-span" | "zoom-in" | "zoom-out",
  HTMLButtonElement
> &
  Record<
    | "canvas" | "draw-canvas" | "map" | "move-canvas" | "nearest" | "plot-acceleration" | "plot-speed" | "shape"
    | "stage" | "timeline-canvas" | "wand-canvas",
    HTMLCanvasElement
  > &
  Record<
    "confusion" | "history" | "live-source" | "mirror" | "move-advanced" | "pick-part" | "robot-preflight" | "why",
    HTMLDetailsElement
  > &
  Record<"ask" | "importing" | "keys" | "phone", HTMLDialogElement> &
  Record<"channels" | "formulations" | "manner" | "styles", HTMLFieldSetElement> &
  Record<
    | "ask-name" | "duration" | "episodes-from" | "file" | "find" | "find-pick" | "find-symbol" | "name"
    | "naming-name" | "own-video" | "phone-host" | "playhead" | "robot-dragged" | "robot-size" | "robot-slow"
    | "style-mix" | "tilt" | "time" | "turn" | "video-start",
    HTMLInputElement
  > &
  Record<
    "camera" | "export-format" | "formulation" | "robot-arm" | "robot-format" | "robot-what" | "save-format" | "tables",
    HTMLSelectElement
  > &
  Record<"confusion-table" | "importing-rows" | "spans", HTMLTableElement> &
  Record<"video", HTMLVideoElement>;

type ElementOf<Id extends string> = Id extends keyof Elements ? Elements[Id] : HTMLElement;

interface Window {
  /** The viewer of an arm, or what is open in the page of a snapshot. */
  kineme: any;
}

/** What is looked for by more than a tag is never SVG. */
interface ParentNode {
  querySelector<Tag extends keyof HTMLElementTagNameMap>(selectors: Tag): HTMLElementTagNameMap[Tag] | null;
  querySelector<Tag extends keyof SVGElementTagNameMap>(selectors: Tag): SVGElementTagNameMap[Tag] | null;
  querySelector(selectors: string): HTMLElement | null;
  querySelectorAll(selectors: "input" | "input:checked" | "[type=number]"): NodeListOf<HTMLInputElement>;
  querySelectorAll<Tag extends keyof HTMLElementTagNameMap>(selectors: Tag): NodeListOf<HTMLElementTagNameMap[Tag]>;
  querySelectorAll(selectors: string): NodeListOf<HTMLElement>;
}

// --- the library

interface LibrarySymbol {
  id: string;
  name: string;
  path: number[][] | null;
  description?: string | null;
  n_members?: number;
  duration?: number;
}

interface Library {
  folder: string;
  version: number;
  n_movements: number;
  n_dims: number | null;
  channels: Channel[] | null;
  read_only: boolean;
  can_undo: boolean;
  symbols: LibrarySymbol[];
  unlabeled: number;
}

interface Movement {
  times: number[];
  positions: number[][];
}

/** A movement under way; its states come where they are heard. */
interface Following {
  /** A new movement begins. */
  reset(): void;
  /** Each sample is a time and coordinates. */
  push(samples: number[][]): void;
  /** The movement is over; tells whether its answer comes by itself. */
  finish(): boolean;
}

/** A library in five functions: of a server, or of a snapshot. What they answer may be a promise. */
interface Backend {
  symbols(): LibrarySymbol[];
  recognize(movement: Movement): any;
  explain(movement: Movement, answer: any): any;
  follow(hear: (message: any) => any): Following;
  generate(question: any): any;
}

// --- Draw, and parts

/** What hears a pen. The canvas is 1 high, y points up. */
interface Hearer {
  /** Tells whether one may draw. */
  begins(kind: string): boolean;
  /** Each sample is a time [s], x and y. */
  goes(samples: number[][]): void;
  ends(): void;
  /** Where the pen is that a keyboard or a gamepad moves. */
  pen?(at: number[] | null): void;
}

interface Naming {
  /** Names that the movement may have are offered. */
  allow(may: boolean, names?: string[]): void;
  empty(): void;
  focus(): void;
}

/** A program that sends movements. */
interface Source {
  id: number;
  name: string;
  movement: number;
  samples: number[][];
  state: any;
  ended: any;
  hand?: Landmarks;
  gone?: boolean;
}

/** Of a hand, as /api/live takes them; y points down. */
interface Landmarks {
  points: number[][];
  time: number;
  aspect: number;
}

interface DrawSession {
  picture: import("./web/draw/picture.js").Picture;
  panel: import("./web/parts/answer_panel.js").AnswerPanel;
  sending: import("./web/parts/sending.js").Sending;
  naming: Naming | null;
  /** The pen is down. */
  drawing: boolean;
  /** The movement is over, and its answer is still to come. */
  pending: boolean;
  /** That is over: it can be learned. */
  movement: Movement | null;
  /** From this drawing; so many had the name then. */
  learned: { movement: Movement; name: string | null; members: number } | null;
  /** What draws: mouse, pen, touch, keyboard or program. */
  pointer: string;
  /** Of the canvas, in the units of the library. */
  height: number;
  label: string | null;
  /** The program whose movement is shown. */
  source: Source | null;
  /** The movement of a program that is not shown again. */
  dismissed: string;
}

type Board = import("./web/parts/canvas.js").Board;
type Camera = import("./web/parts/camera.js").Camera;
type Sources = import("./web/draw/sources.js").Sources;

// --- Move

type MoveSession = import("./web/move/session.js").Session;

interface ViaPoint {
  at: number;
  point: number[];
}

interface Obstacle {
  center: number[];
  radius: number;
}

interface Plan {
  symbol: string;
  start: number[];
  goal: number[];
  path: number[][];
  /** The demonstrated way from start to goal. */
  reach: number[];
  /** The demonstrated duration [s]. */
  usual: number;
  /** By which the duration is stretched. */
  share: number;
  style: number[] | null;
  /** The formulation of the style. */
  styled?: string;
  via: ViaPoint[];
  obstacles: Obstacle[];
}

/** A point of a plan, a field of its owner; `list` is what it can be removed from. */
interface PlanPoint {
  key: string;
  kind: string;
  name: string;
  owner: any;
  field: string;
  list?: object[];
}

/** What hears of points that changed, or went away. */
interface PointsPage {
  changed(): void;
  removed(list: object[], point: object): void;
}

interface Handle {
  key: string;
  kind: string;
  name: string;
  remove?: () => void;
  at(): number[];
  move(point: number[]): void;
}

interface Grip {
  handle: Handle;
  button: HTMLButtonElement;
}

interface Curve {
  times: number[];
  values: number[];
  look: { color: string; dash: number[] };
}

// --- Recordings

interface Channel {
  name: string;
  kind: string;
  unit: string | null;
  columns: string[];
}

interface Table {
  name: string;
  channels: Channel[];
  duration: number;
  rate: number | null;
  label: string | null;
}

/** What the server says of a recording. */
interface Recording {
  recording: string;
  tables: Table[];
  plots: any[];
  problems: string[];
  preview: any;
  command: string;
  episode?: any;
  videos?: Video[];
  chosen?: string[];
}

interface Video {
  camera: string;
  start: number;
  codec: string | null;
  address: string;
  own?: boolean;
}

interface Span {
  begin: number;
  end: number;
  label: string | null;
  p?: number | null;
  confidence?: number | null;
  certainty?: string | null;
}

interface Shape {
  times: number[];
  path: number[][];
  flat?: number[][];
}

interface TimelinePage {
  timeline: { moveEdge(which: "begin" | "end", time: number): void };
  choose(k: number): void;
  /** By the person. */
  changed(): void;
  add(): void;
  remove(k: number): void;
  seek(time: number): void;
  /** For the playhead. */
  key(event: KeyboardEvent): void;
}

// --- the page of a snapshot

/** A place in the middle, and how far is seen from there. */
interface Box {
  center: number[];
  half: number;
}

type OpenedSnapshot = Backend & { runtime: ReturnType<typeof import("./javascript/runtime.js").open> };
