"""Spotting: find known movements in one long recording, with unknown motion between them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.scores import nearest, nearest_each, score
from kineme.errors import TrajectoryError
from kineme.movements.segmentation.bouts import Rows
from kineme.movements.segmentation.motion import Motion
from kineme.movements.segmentation.segment import as_recording
from kineme.movements.segmentation.segmentation import pieces_of
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.candidate_windows import MIN_SAMPLES, Durations, Windows, candidate_windows, surroundings
from kineme.recognition.compared_windows import (
    Candidates,
    Progress,
    Templates,
    compare_candidates,
    compare_windows,
)
from kineme.recognition.confidence import class_probabilities
from kineme.recognition.conformal import check_error_rate
from kineme.recognition.cut_movements import calibration_of_cut
from kineme.recognition.window_scores import (
    Manner,
    ScoredWindows,
    alike_windows,
    closest_classes,
    durations_of,
    expected,
    far,
    manner_of,
    score_windows,
)
from kineme.validation import Array, check_count

_FASTER, _SLOWER = 2.0, 3.0  # times faster and slower than demonstrated that a movement may be
_PASSES = 3  # the tempo and size of a recording are estimated by what was found before
_LEAST_UNKNOWN = 0.1  # in shortest demonstrated durations: what is left over and shorter is not told


class Spotted(NamedTuple):
    """One stretch of motion: from when to when, what it is (None: unknown), how sure, and how usual.

    Attributes
    ----------
    start, end : float
        Time stamps [s].
    label : label or None
    confidence : float
        As `Answer.confidence`: the probability that the label is right if the stretch is a movement of a known class;
        for None, 1 minus `p_known`.
    p_known : float
        As `Answer.p_known`: share of movements of known classes that would be as novel or more. It may be below the
        error rate: a movement in a recording is cut by the search itself, which makes it somewhat more novel.
    """

    start: float
    end: float
    label: Label | None
    confidence: float
    p_known: float = math.nan  # of records that were stored without


def spot(
    known: Templates,
    recording: MovementsLike,
    error_rate: float,
    max_pieces: int,
    progress: Progress | None = None,
) -> list[Spotted]:
    """Find movements like the references in a recording; see `Recognizer.spot`.

    `progress` is called now and then, between long steps too, with the share of the windows that is compared; what it
    raises ends the search.
    """
    check_error_rate(error_rate)
    check_count("max_pieces", max_pieces, 1)
    tell: Progress = progress or _tell_nobody
    comparison, references, calibration = known = known._replace(calibration=calibration_of_cut(known))
    tell(0.0)
    lasting = durations_of(references)
    whole = _as_timed(recording) if lasting is not None else as_recording(recording)
    whole = comparison.checked([whole], "a recording")[0]
    durations = None if lasting is None else Durations(float(lasting.min()) / _FASTER, float(lasting.max()) * _SLOWER)
    windows = candidate_windows(whole, durations, max_pieces)
    tell(0.0)
    if not len(windows.bouts):  # nothing moves for as long as a movement takes
        return []
    chosen, best = _chosen(known, windows, error_rate, tell)
    least = 0.0 if lasting is None else _LEAST_UNKNOWN * float(lasting.min())
    unknown = _left_over(chosen, windows.bouts, whole.times, least)
    rows = np.concatenate((chosen, unknown))
    if not len(rows):
        return []
    logs, similar = score(comparison, references, pieces_of(whole, rows), nearest, nearest_each)
    p_known = calibration.known_p_values(logs, error_rate)
    confidence = 1.0 - p_known
    confidence[: len(best)] = class_probabilities(similar, calibration.exponent)[np.arange(len(best)), best]
    classes = references.classes.tolist()
    labels = [*(classes[c] for c in best.tolist()), *([None] * len(unknown))]
    t = whole.times
    return [
        Spotted(float(t[rows[i, 0]]), float(t[rows[i, 1] - 1]), labels[i], float(confidence[i]), float(p_known[i]))
        for i in np.argsort(rows[:, 0], kind="stable").tolist()
    ]


def _as_timed(recording: MovementsLike) -> Trajectory:
    """The recording, whose time stamps are known, as those of the references are."""
    if not isinstance(recording, Trajectory):
        recording = Demonstrations.of(recording)
        if recording.movements.times is None:
            raise TrajectoryError(
                "expected time stamps, as the demonstrations have, got an array, which counts as one second; pass "
                "kineme.Trajectory(times, positions)"
            )
    return as_recording(recording)


def _tell_nobody(share: float) -> None:
    """Nobody wants to know how far it is."""


def _chosen(known: Templates, windows: Windows, error_rate: float, progress: Progress) -> tuple[Rows, NDArray[np.intp]]:
    """Samples of the known movements found, rows (n, 2), first and one past the last, and the class of each."""
    if not len(windows):
        return np.empty((0, 2), dtype=np.intp), np.empty(0, dtype=np.intp)
    motion, typical = windows.motion, expected(known.references)
    candidates = compare_candidates(known, motion, windows.rows, far(error_rate), progress)
    compared = candidates.weighted()
    around = surroundings(motion, windows.bouts, compared.rows)
    manner = Manner()
    for _ in range(_PASSES - 1):
        progress(1.0)
        scored = score_windows(compared, typical, around, manner, error_rate)
        chosen = _best_windows(compared.rows, scored)
        manner = manner_of(compared, typical, chosen, scored.best)
    chosen = _best_windows(compared.rows, score_windows(compared, typical, around, manner, error_rate))
    rows = compared.rows[chosen]
    spans = motion.times[compared.rows]
    alike = np.unique(np.concatenate((chosen, *alike_windows(spans, chosen)))).astype(np.intp)
    distances = _complete_scores(known, motion, candidates, alike) * known.calibration.scales
    distances /= far(error_rate) * np.exp(np.log(known.calibration.scales).mean())
    again = np.searchsorted(alike, chosen).tolist()
    classes = closest_classes(compared.take(alike), distances, typical, manner, spans[alike], again)
    return np.column_stack((rows[:, 0], rows[:, 1] + 1)), classes


def _complete_scores(known: Templates, motion: Motion, candidates: Candidates, chosen: NDArray[np.intp]) -> Array:
    """Nonconformity of chosen windows to every class, (n, C)."""
    scores = candidates.compared.scores[chosen]
    partly = ~candidates.completely[chosen]
    scores[partly] = compare_windows(known, motion, candidates.compared.rows[chosen[partly]]).scores
    return scores


def _best_windows(rows: Rows, scored: ScoredWindows) -> list[int]:
    """The chain of windows of largest summed score."""
    boundaries = np.unique(np.append(0, rows))
    first, last = np.searchsorted(boundaries, rows).T
    return best_chain(first, last, scored.score, len(boundaries))


def best_chain(first: NDArray[np.intp], last: NDArray[np.intp], score: Array, n: int) -> list[int]:
    """Windows between n boundaries that do not overlap, of largest summed score: dynamic programming."""
    positive = np.flatnonzero(score > 0)
    ordered = positive[np.argsort(last[positive], kind="stable")]
    of = np.searchsorted(last[ordered], np.arange(n + 1)).tolist()
    total, taken = np.zeros(n), np.full(n, -1)
    for j in range(1, n):
        total[j] = total[j - 1]
        here = ordered[of[j] : of[j + 1]]
        if len(here):
            values = total[first[here]] + score[here]
            i = int(values.argmax())
            if values[i] > total[j]:
                total[j], taken[j] = values[i], here[i]
    chain, j = [], n - 1
    while j > 0:
        if taken[j] < 0:
            j -= 1
        else:
            chain.append(int(taken[j]))
            j = int(first[taken[j]])
    return chain[::-1]


def _left_over(known: Rows, bouts: Rows, times: Array, least: float) -> Rows:
    """Stretches of motion that no known movement holds, rows (n, 2), each at least `least` seconds long."""
    stretch = np.zeros(len(times) + 2, dtype=np.intp)  # 0 where there is none, also before and after all samples
    for i, (start, stop) in enumerate(bouts.tolist()):
        stretch[start + 1 : stop + 1] = i + 1
    for start, stop in known.tolist():
        stretch[start + 1 : stop + 1] = 0
    edges = np.flatnonzero(np.diff(stretch))
    rows = np.column_stack((edges[:-1], edges[1:]))[stretch[edges[:-1] + 1] > 0]
    rows = rows[rows[:, 1] - rows[:, 0] >= MIN_SAMPLES]
    return rows[times[rows[:, 1] - 1] - times[rows[:, 0]] >= least]
