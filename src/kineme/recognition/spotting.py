"""Spotting: find known movements in one long recording, with unknown motion between them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.segmentation.segment import as_recording, pieces_of
from kineme.movements.segmentation.table import Motion, Rows, observe
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.trajectory import MovementsLike, Trajectory
from kineme.recognition.compared_windows import (
    MIN_SAMPLES,
    N_POINTS,
    RESOLUTION,
    Candidates,
    ComparedWindows,
    Durations,
    Progress,
    Surroundings,
    Templates,
    Windows,
    candidate_windows,
    compare_candidates,
    compare_windows,
    resampled,
    size_and_slowness,
    surroundings,
)
from kineme.recognition.conformal import Calibration, check_error_rate, class_probabilities, distances
from kineme.recognition.edges import placed
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import References
from kineme.similarity.scores import nearest, nearest_each, score
from kineme.validation import Array, check_count

_REACH = 0.975  # nonconformity at which a window counts as far, in that which members exceed at the error rate
#: The same where levels of a gripper tell movements apart: an arm at work moves elsewhere each time, and few examples
#: show little of it. Of simulated work, three examples of each of six kinds, 0.6 of the movements are named right at
#: 0.975, 0.9 at 1.9. Of wiping that was not shown all stays unknown, of pressing 0.9 and 0.4: the rest are reaches.
_REACH_AT_WORK = 1.9
#: Costs of a duration, and of a size, e times what is expected, of a window. People change pace from one movement to
#: the next: at 0.4 for durations, 0.71 of single strokes at three speeds were found instead of 0.83, other costs alike.
_OF_WINDOWS = 0.05, 0.2
#: The same where levels of a gripper tell movements apart: arms at work keep their pace. Of eight simulated sets,
#: boundaries have a mean F1 of 0.912 with these costs and of 0.907 with those above.
_OF_WINDOWS_AT_WORK = 0.4, 0.2
_OF_CLASSES = 0.1, 0.05  # the same where the class of a window is chosen
_DEAD = 0.1  # logarithm of a ratio of durations that costs nothing while the tempo of the recording is unknown
_EDGE, _FAR_FROM_REST, _SPANNED = 0.14, 0.03, 0.02  # costs of what surrounds a window
_REST_INSIDE = 1.2  # cost of a share of rest beyond the demonstrated one
_PER_MOVEMENT = 0.165  # cost of one more movement, in typical durations
#: The same from rest to rest, in durations of the window, where that is less: a short window between rests is rather a
#: fast movement than a part of one. Of single strokes at three speeds 0.93 by others are found instead of 0.84.
_OF_REST_TO_REST = 0.2
_ALIKE = 0.9  # intersection over union from which two windows are about one movement

#: Shares of the duration that are cut off at the start and at the end: windows end at samples some hundredths apart.
_CUTS = ((0.03, 0.0), (0.0, 0.03), (0.03, 0.03))
_OF_EACH = 4  # demonstrations of a class that are cut, evenly spaced

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
    uncertainty : float
        Half of the 95 % interval of start and end [s], of the less certain one; see `kineme.recognition.edges`.
    """

    start: float
    end: float
    label: Label | None
    confidence: float
    p_known: float = math.nan  # of records that were stored without
    uncertainty: float = math.nan


def spot(
    templates: Templates, recording: MovementsLike, error_rate: float, max_pieces: int, progress: Progress | None = None
) -> list[Spotted]:
    """Find movements like the references in a recording; see `Recognizer.spot`.

    `progress` is called now and then, between long steps too, with the share of the windows that is compared; what it
    raises ends the search.
    """
    check_error_rate(error_rate)
    check_count("max_pieces", max_pieces, 1)
    tell: Progress = progress or (lambda share: None)
    templates = templates._replace(calibration=calibration_of_cut(templates))
    comparison, references, calibration, _ = templates
    tell(0.0)
    lasting = durations_of(references)
    timed = _as_timed(recording) if lasting is not None else as_recording(recording)
    timed = comparison.checked([timed], "a recording")[0]
    templates = templates.of(timed)
    durations = None if lasting is None else Durations(float(lasting.min()) / _FASTER, float(lasting.max()) * _SLOWER)
    windows = candidate_windows(timed, durations, max_pieces)
    tell(0.0)
    if not len(windows.bouts):  # nothing moves for as long as a movement takes
        return []
    chosen, best = _chosen(templates, windows, error_rate, tell)
    least = 0.0 if lasting is None else _LEAST_UNKNOWN * float(lasting.min())
    unknown = _left_over(chosen, windows.bouts, timed.times, least)
    rows = np.concatenate((chosen, unknown))
    longest = None if lasting is None else float(lasting.max())
    rows, doubts = placed(windows.motion, rows, np.arange(len(rows)) < len(best), templates.levels, longest)
    if not len(rows):
        return []
    away = templates.level_scores(windows.motion, rows - (0, 1)) * calibration.scales
    by_path = score(comparison, references, pieces_of(timed, rows), nearest, nearest_each)
    logs, similar = (each - 0.5 * away**2 for each in by_path)
    p_known = calibration.known_p_values(logs, error_rate)
    confidence = 1.0 - p_known
    confidence[: len(best)] = class_probabilities(similar, calibration.exponent)[np.arange(len(best)), best]
    classes = references.classes.tolist()
    labels = [*(classes[c] for c in best.tolist()), *([None] * (len(rows) - len(best)))]
    start, end = timed.times[rows - (0, 1)].T.tolist()
    certainties = np.column_stack((confidence, p_known, doubts)).tolist()
    return [
        Spotted(start[i], end[i], labels[i], *certainties[i]) for i in np.argsort(rows[:, 0], kind="stable").tolist()
    ]


def _as_timed(recording: MovementsLike) -> Trajectory:
    """Return the recording, whose time stamps are known, as those of the references are."""
    if not isinstance(recording, Trajectory):
        recording = Demonstrations.of(recording)
        if not _is_timed(recording):
            raise TrajectoryError(
                "expected time stamps, as the demonstrations have, got an array, which counts as one second; pass "
                "kineme.Trajectory(times, positions)"
            )
    return as_recording(recording)


def _chosen(
    templates: Templates, windows: Windows, error_rate: float, progress: Progress
) -> tuple[Rows, NDArray[np.intp]]:
    """Return samples of the known movements found, rows (n, 2), first and one past the last, and the class of each."""
    if not len(windows):
        return np.empty((0, 2), dtype=np.intp), np.empty(0, dtype=np.intp)
    at_work = templates.levels is not None  # the reach is wide then, and holds many windows that cannot be chosen
    motion, typical = windows.motion, expected(templates.references, at_work)
    reach, manner = far(error_rate, at_work), Manner()
    around = surroundings(motion, windows.bouts, windows.rows)

    def matters(compared: ComparedWindows) -> Array:
        return most_nonconformity(compared, typical, around, manner, reach)

    candidates = compare_candidates(templates, motion, windows.rows, reach, progress, matters if at_work else None)
    exact = matters(candidates.compared) if at_work else np.inf
    compared, chosen = candidates.weighted(), list[int]()
    for k in range(_PASSES):
        progress(1.0)
        scored = score_windows(compared, typical, around, manner, reach)
        chosen = _best_chain(compared.rows, scored.score)
        if k < _PASSES - 1:
            manner = manner_of(compared, typical, chosen, scored.best)
            doubtful = (compared.scores > exact) & (compared.scores < matters(compared))
            candidates = _completed(templates, motion, candidates, np.flatnonzero(doubtful.any(axis=1)))
            compared = candidates.weighted()
    spans = motion.times[compared.rows]
    alike = np.unique(np.concatenate((chosen, *alike_windows(spans, chosen)))).astype(np.intp)
    again = np.searchsorted(alike, chosen).tolist()
    away = _distances(templates, motion, compared.rows[alike])
    away /= reach * np.exp(np.log(templates.calibration.scales).mean())
    classes = closest_classes(compared.take(alike), away, typical, manner, spans[alike], again)
    return compared.rows[chosen] + (0, 1), classes


def _distances(templates: Templates, motion: Motion, rows: Rows) -> Array:
    """Return distances (n, C) of windows to each class, in each representation to its own nearest demonstration."""
    windows = Demonstrations.of_movements(resampled(motion, *motion.times[rows].T))
    (similar,) = score(templates.comparison, templates.references, windows, nearest_each)
    return np.hypot(distances(similar), templates.level_scores(motion, rows) * templates.calibration.scales)


def _completed(templates: Templates, motion: Motion, candidates: Candidates, chosen: NDArray[np.intp]) -> Candidates:
    """Return the candidates, the chosen ones of them compared with every reference."""
    partly = chosen[~candidates.completely[chosen]]
    if not len(partly):
        return candidates
    scores, completely = candidates.compared.scores.copy(), candidates.completely.copy()
    scores[partly] = compare_windows(templates, motion, candidates.compared.rows[partly]).scores
    completely[partly] = True
    return candidates._replace(compared=replace(candidates.compared, scores=scores), completely=completely)


def _best_chain(rows: Rows, score: Array) -> list[int]:
    """Return windows, rows (n, 2), that do not overlap, of largest summed score: dynamic programming."""
    boundaries = np.unique(np.append(0, rows))
    (first, last), n = np.searchsorted(boundaries, rows).T, len(boundaries)
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


def _left_over(movements: Rows, bouts: Rows, times: Array, least: float) -> Rows:
    """Return stretches of motion that no known movement holds, rows (n, 2), each at least `least` seconds long."""
    stretch = np.zeros(len(times) + 2, dtype=np.intp)  # 0 where there is none, also before and after all samples
    for i, (start, stop) in enumerate(bouts.tolist()):
        stretch[start + 1 : stop + 1] = i + 1
    for start, stop in movements.tolist():
        stretch[start + 1 : stop + 1] = 0
    edges = np.flatnonzero(np.diff(stretch))
    rows = np.column_stack((edges[:-1], edges[1:]))[stretch[edges[:-1] + 1] > 0]
    rows = rows[rows[:, 1] - rows[:, 0] >= MIN_SAMPLES]
    return rows[times[rows[:, 1] - 1] - times[rows[:, 0]] >= least]


def calibration_of_cut(templates: Templates) -> Calibration:
    """Return the calibration for movements that are cut out of a recording; kept with that for whole movements.

    The scale of a class is at least the mean distance of its demonstrations from themselves when 3 % of their
    duration is cut off at one end or both. A robot that repeats a movement exactly varies less than the cuts do, and
    whatever a search finds of it would be unknown. Scales of what people show are larger, and stay.
    """
    calibration: Calibration | None = vars(templates.calibration).get("_of_cut")
    if calibration is None:
        references = templates.references
        movements, away = references.all_movements(), np.zeros(len(references.classes))
        for c, own in enumerate(references.slices()):
            chosen = own.start + evenly_spaced(own.stop - own.start, _OF_EACH)
            long = [
                movement for movement in (movements[int(i)] for i in chosen) if len(movement.times) >= 2 * MIN_SAMPLES
            ]
            if long:  # else they are too short to be cut
                windows = [score(templates.comparison, references, _cut(movement), nearest)[0] for movement in long]
                away[c] = float(distances(np.concatenate(windows)[:, c]).mean())
        calibration = templates.calibration.with_least_scales(away)
        vars(templates.calibration)["_of_cut"] = calibration
    return calibration


def _cut(movement: Trajectory) -> Demonstrations:
    """Return a movement with a little cut off, as a window of a recording."""
    begin, end = (share * movement.duration for share in np.array(_CUTS).T)
    motion = observe(movement, RESOLUTION)
    return Demonstrations.of_movements(resampled(motion, movement.times[0] + begin, movement.times[-1] - end))


class Expected(NamedTuple):
    """Typical movements of C classes, each of shape (C,)."""

    log_durations: Array | None  # none where no time stamps were given
    log_sizes: Array
    slowness: Array  # share of the duration that is slow
    costs: tuple[float, float] = _OF_WINDOWS


@dataclass(frozen=True)
class Manner:
    """Differences of a recording from the demonstrations as a whole: logarithms of ratios; None while unknown."""

    tempo: float | None = None
    size: float | None = None


class ScoredWindows(NamedTuple):
    """Best class of each window and its score, (n,); above 0 where it counts as known."""

    best: NDArray[np.intp]
    score: Array


def durations_of(references: References) -> Array | None:
    """Return durations of the references; None where their arrays came without time stamps, so that none is known."""
    demos = references.all_movements()
    return demos.durations if _is_timed(demos) else None


def _is_timed(demos: Demonstrations) -> bool:
    """Tell whether movements have time stamps: arrays without count as one second each; even ones are not kept."""
    return demos.movements.times is not None or bool((demos.durations != 1.0).any())


def expected(references: References, at_work: bool = False) -> Expected:
    """Return medians over the references of each class, and what other durations and sizes than these cost."""
    demos = references.all_movements()
    sizes, slowness = size_and_slowness(relative_rows(demos, 0, len(demos), N_POINTS))
    lasting = durations_of(references)

    def medians(values: Array) -> Array:
        return np.array([np.median(values[rows]) for rows in references.slices()])

    log_durations = None if lasting is None else medians(np.log(lasting))
    return Expected(log_durations, medians(sizes), medians(slowness), _OF_WINDOWS_AT_WORK if at_work else _OF_WINDOWS)


def alike_windows(spans: Array, chosen: list[int]) -> list[NDArray[np.intp]]:
    """Return the windows that have nine tenths of the union with each chosen one, itself among them.

    `spans` (n, 2) are start and end of each [s], sorted by starts.
    """
    alike = []
    for i in chosen:
        start, end = spans[i]
        reach = (1.0 / _ALIKE - 1.0) * (end - start)
        first, last = np.searchsorted(spans[:, 0], (start - reach, start + reach), side="right")
        near = spans[first:last]
        shared = np.minimum(near[:, 1], end) - np.maximum(near[:, 0], start)
        union = np.maximum(near[:, 1], end) - np.minimum(near[:, 0], start)
        alike.append(first + np.flatnonzero(shared >= _ALIKE * union))
    return alike


def closest_classes(
    compared: ComparedWindows, distances: Array, typical: Expected, manner: Manner, spans: Array, chosen: list[int]
) -> NDArray[np.intp]:
    """Return class of each chosen window: the closest to it, or to a window that has nine tenths of the union with it.

    Which window is chosen depends on its duration, its size, and what surrounds it; these differ between people. The
    class is the nearest one by `NearestEach`, wherever exactly the movement starts and ends: the distance, not over the
    scale of the class, and small costs of duration and size.

    `compared`: n windows, sorted by starts; `distances` (n, C): to each class, in that at which a window counts as
    far; `spans` (n, 2): start and end of each window [s]; `chosen`: windows.
    """
    costs = distances + _manner_costs(compared, typical, manner, *_OF_CLASSES)
    return np.array([costs[near].min(axis=0).argmin() for near in alike_windows(spans, chosen)], dtype=np.intp)


def far(error_rate: float, at_work: bool = False) -> float:
    """Return the nonconformity at which a window counts as far; `at_work`: levels of a gripper are compared too."""
    return (_REACH_AT_WORK if at_work else _REACH) * math.sqrt(-4.0 / math.pi * math.log(error_rate))


def _manner_costs(compared: ComparedWindows, typical: Expected, manner: Manner, tempo: float, size: float) -> Array:
    """Return costs (n, C) of another duration, and another size, than those of the class in this recording."""
    costs = np.zeros(compared.scores.shape)
    if typical.log_durations is not None:
        ratio = compared.log_durations[:, None] - typical.log_durations
        if manner.tempo is None:
            costs += 0.5 * tempo * np.maximum(np.abs(ratio) - _DEAD, 0.0) ** 2
        else:
            costs += tempo * (ratio - manner.tempo) ** 2
    if manner.size is not None:
        costs += size * (compared.log_sizes[:, None] - typical.log_sizes - manner.size) ** 2
    return costs


def score_windows(
    compared: ComparedWindows, typical: Expected, around: Surroundings, manner: Manner, reach: float
) -> ScoredWindows:
    """Return scores of windows, such that a chain of windows is better the larger its sum.

    The cost of a window is its nonconformity to the class, in the `reach` at which a window counts as far, plus squared
    logarithms of the ratios of its duration and size to those expected, plus costs of ends in motion and of rests
    inside. The score is ``(1 - cost) * duration / typical duration`` where positive, less a cost per movement (less for
    a short one from rest to rest): so that a whole movement is preferred to its parts, and no part is one by chance.
    """
    others, counts, per_movement = _other_costs(compared, typical, around, manner)
    costs = compared.scores / reach + others
    best = costs.argmin(axis=1)
    closeness = np.maximum(1.0 - costs[np.arange(len(best)), best], 0.0)
    return ScoredWindows(best, closeness * counts - per_movement)


def most_nonconformity(
    compared: ComparedWindows, typical: Expected, around: Surroundings, manner: Manner, reach: float
) -> Array:
    """Return the nonconformity (n, C) from which on windows have no score above 0 as each class, see `score_windows`.

    The scores of the windows themselves have no part in it.
    """
    others, counts, per_movement = _other_costs(compared, typical, around, manner)
    return np.asarray(reach * (1.0 - others - (per_movement / counts)[:, None]))


def _other_costs(
    compared: ComparedWindows, typical: Expected, around: Surroundings, manner: Manner
) -> tuple[Array, Array, Array]:
    """Return costs (n, C) beside the nonconformity; durations, and costs of one more movement (n,), in typical ones."""
    costs = _manner_costs(compared, typical, manner, *typical.costs)
    costs += _REST_INSIDE * np.maximum(compared.slowness[:, None] - typical.slowness, 0.0)
    edges = _EDGE * around.edge_speeds + _FAR_FROM_REST * around.far_from_rest + _SPANNED * around.rests_inside
    lasting = compared.log_durations
    usual = float(np.median(lasting)) if typical.log_durations is None else float(np.median(typical.log_durations))
    counts = np.exp(lasting - (usual + (manner.tempo or 0.0)))
    short = np.where(around.far_from_rest == 0, _OF_REST_TO_REST * counts, np.inf)
    return costs + edges[:, None], counts, np.minimum(_PER_MOVEMENT, short)


def manner_of(compared: ComparedWindows, typical: Expected, chosen: list[int], best: NDArray[np.intp]) -> Manner:
    """Estimate the manner of a recording by the windows chosen; its tempo is shrunk towards the demonstrated one."""
    if not chosen:
        return Manner()
    classes = best[chosen]
    manner = Manner(size=shrunk_median(compared.log_sizes[chosen] - typical.log_sizes[classes], 0.0))
    if typical.log_durations is None:
        return manner
    return replace(manner, tempo=shrunk_median(compared.log_durations[chosen] - typical.log_durations[classes], 1.0))


def shrunk_median(log_ratios: Array, prior: float) -> float:
    """Return the median of logarithms of ratios (n,), towards 0 as if by so many more movements: n / (n + prior)."""
    return float(np.median(log_ratios)) * len(log_ratios) / (len(log_ratios) + prior)
