// How sure an answer is, in one of four words, as kineme.recognition.answer says it; thresholds are the snapshot's.

/**
 * The word; `least` is the least confidence that each takes.
 * @returns {"sure"|"probably"|"looks like"|"new"}
 */
export function certainty(least, confidence, { isNew, isGuess = false }) {
  if (isNew) return "new";
  if (isGuess || !(confidence >= least.probably)) return "looks like";
  return confidence >= least.sure ? "sure" : "probably";
}
