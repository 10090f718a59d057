// What the type checker knows of the records of the runtime, which lies in javascript/. No browser loads it.

/** Everything of a snapshot that is no array. */
interface Header {
  calibration: Calibration;
  early: { numbers: EarlyNumbers; pauses: PauseRule; rule: RotationRule; shapes: PairRule; [name: string]: any };
  [name: string]: any;
}

interface Snapshot {
  header: Header;
  arrays: Record<string, any>;
}

interface TimedPositions {
  /** [s], rising */
  times: Float64Array;
  /** T samples of d numbers, one after the other. */
  positions: Float64Array;
  d: number;
}

/** How pauses are cut short; see kineme.movements.preparation.pauses. */
interface PauseRule {
  /** Median steps, and as many times neighbors and what the length of a step takes: longer ones are gaps. */
  gap: number;
  /** Of the time in motion: a gap, by neighbors and length, or a rest counts at most as much. */
  pause: number;
  /** Of the reach: a rest after the start counts as at most the time that this takes at the mean speed. */
  rest: number;
  /** Of the time in motion: a rest at the end counts at most as much. */
  last_rest: number;
  /** Of the reach from the first sample: so near to where a window begins a rest stays. */
  radius: number;
  /** Samples of a window, at least. */
  shortest: number;
  /** In a movement. */
  windows: number;
  /** Steps that a rest is left, at least. */
  fewest: number;
  rounds: number;
  /** Ratio of times that is rounding. */
  equal: number;
  /** Difference of counts that is rounding. */
  same_count: number;
  glitches: GlitchRule;
}

/** How glitches are taken out; see kineme.movements.preparation.glitches. */
interface GlitchRule {
  /** Samples of a glitch, at most. */
  length: number;
  /** Its distance, in steps of the path beside it and in typical ones, at least. */
  steps: number;
  /** Share of its distance within which the path goes on after a value that was held apart. */
  return: number;
  /** Movements with no longer step, in mean ones, are not searched. */
  mean_steps: number;
}

/** How movements are rotated. */
interface RotationRule {
  /** Of each point. */
  n_dims: number;
  /** J, which turn together. */
  n_points: number;
  /** Weights of the points, or columns, that are compared pair by pair; null for all. */
  mixing: number[][] | null;
  max_angle: number;
  /** F of the matrix Fisher density, row by row; null for none. */
  prior: number[] | null;
}

/** m movements as they are compared. */
interface Stored {
  m: number;
  /** Of each block, one movement after the other. */
  rows: Float32Array[];
  /** Their squared norms, (m,) of each block. */
  squares: Float64Array[];
  shapes: Shapes | null;
  details: Shapes | null;
}

/** Segments and points of m movements. */
interface Shapes {
  /** Numbers of a vector. */
  d: number;
  /** m times K times (tangent, midpoint, turning angle / pi) */
  segments: Float32Array;
  /** m times P times (point, turning angle / pi, tangent) */
  points: Float32Array;
  /** K */
  n_segments: number;
  /** P */
  n_points: number;
}

/** How segments and points are compared. */
interface PairRule {
  n_segments: number;
  band: number;
  n_points: number;
  position_weight: number;
  /** Of segments. */
  turning_weight: number;
  /** Of points. */
  cloud_turning_weight: number;
  line_weight: number;
}

/** Writes three squares: of number j of the others, each point of which R brings onto the one movement. */
type WritePairDistances = (others: Shapes, j: number, R: Float64Array | null, squares: Float64Array) => void;

/** G beginnings of each of n movements, S samples along their arc lengths. */
interface Prefixes {
  /** Centered, of norm 1. */
  rows: Float32Array;
  /** Of their norms. */
  squares: Float64Array;
  /** Time of each sample as a share of the beginning's, over the root of S. */
  timing: Float64Array;
  sizes: Float64Array;
  lengths: Float64Array;
  /** As a share of the movement's time. */
  elapsed: Float64Array;
  /** Logarithms. */
  endSpeeds: Float64Array;
  shapes: Shapes;
}

/** What classes are told apart by. */
type Recognizer = Snapshot & { stored: Stored };

/** In the form of `kineme.recognition.Answer.to_dict`. */
interface Answer {
  /** null: unknown */
  label: string | null;
  certainty: "sure" | "probably" | "looks like" | "new";
  confidence: number;
  p_known: number;
  /** class, pooled, strangers or guess */
  rule: string;
  promise: string;
  calibrated: boolean;
  /** The best first. */
  ranked: { label: string; probability: number | null; p_value: number | null }[];
  /** By their ids where they have some. */
  nearest: { index: number; name: string | null; similarity: number }[];
  /** null: the runtime computes none */
  transform: object | null;
  responsibilities: Record<string, number>;
}

interface Primitive {
  /** d rows of N, times the scale of the formulation. */
  weights: ArrayLike<number>;
  start: number[];
  goal: number[];
  /** Per second. */
  velocity: number[];
  /** [s] */
  duration: number;
  extents: number[];
  formulation: string;
}

/** With an end velocity the goal is met exactly, as with via points. */
interface Wish {
  start?: number[];
  goal?: number[];
  duration?: number;
  via?: [number, number[]][];
  endVelocity?: number[];
  samples?: number;
}

/** In the header, beside other numbers. */
interface Calibration {
  /** Smallest distance that counts, in kernel widths. */
  least: number;
  /** Of a log similarity: no distance. */
  rounding: number;
  /** Of the typical distance between classes: how far people differ at the most. */
  reach_of_strangers: number;
  /** Of the distance to the next class. */
  reach_to_next: number;
  /** In which members of a class vary, about; even. */
  dimensions: number;
  /** Of normal vectors in these. */
  mean_length: number;
  /** Rules that promise nothing. */
  guesses: string[];
  /** Of each rule, in a sentence. */
  promises: Record<string, string>;
}

/** Those of kineme.recognition.early, in the header. */
interface EarlyNumbers {
  /** Hypotheses compared pair by pair, and the best one of each class. */
  compared: number;
  /** Widths of positions where they choose those. */
  widened: number;
  /** Weight of the rotation prior. */
  rotation: number;
  /** Of the logarithm of the speed at the end. */
  speed_spread: number;
  /** Exponent of the density of progress. */
  progress: number;
  /** Of the similarity of whole movements. */
  power: number;
  /** Without its exp(-negligible) of the largest evidence a movement is not compared whole. */
  negligible: number;
  /** Logarithm of the odds that a movement is over before its speed is known. */
  prior_odds: number;
  most_odds: number;
  /** Logarithm of the evidence for an unknown movement. */
  log_unknown: number;
  /** Exponent of the shares. */
  temper: number;
  /** A movement explains a beginning at about one in so many values of progress. */
  explaining: number;
  /** Share of a beginning's time in which the speed at its end is measured. */
  last: number;
  least_speed: number;
}
