"""Spotting: find known movements in one long recording, with unknown motion between them."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.comparison import Comparison
from kineme.comparison.references import References
from kineme.comparison.scores import nearest, score
from kineme.errors import TrajectoryError
from kineme.movements.segmentation.bouts import Rows
from kineme.movements.segmentation.motion import Motion, observe
from kineme.movements.segmentation.rest import Rest
from kineme.movements.segmentation.segment import as_recording, moving
from kineme.movements.segmentation.segmentation import pieces_of
from kineme.movements.segmentation.speed_minima import SpeedMinima
from kineme.movements.trajectories.labels import Label
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.conformal import Calibration, check_error_rate
from kineme.validation import Array, check_count

_MIN_SAMPLES = 8
_TEMPO = 1.5  # one standard deviation of the ratio of durations, for one person's movements of one class
_MAX_TEMPO = 3.0  # largest ratio of durations that is considered
_IMPOSTOR = -4.0  # log similarity of a typical impostor: the kernels' width is 0.35 of its distance
_PER_MOVEMENT = 0.5  # cost in typical durations: positive scores from half way to an impostor on


class Spotted(NamedTuple):
    """One stretch of motion: from when to when, what it is (None: unknown), and how sure.

    Attributes
    ----------
    start, end : float
        Time stamps [s].
    label : label or None
    confidence : float
        1 minus the largest p-value of what was not answered: of the other classes, or, for None, of all.
    """

    start: float
    end: float
    label: Label | None
    confidence: float


def spot(
    comparison: Comparison,
    references: References,
    calibration: Calibration,
    recording: MovementsLike,
    error_rate: float,
    max_pieces: int,
) -> list[Spotted]:
    """Find movements like the references in a recording; see `Recognizer.spot`."""
    check_error_rate(error_rate)
    check_count("max_pieces", max_pieces, 1)
    whole = as_recording(recording)
    if whole.n_dims != comparison.n_dims:
        raise TrajectoryError(
            f"expected a recording of {comparison.n_dims} dimensions as in fit, got {whole.n_dims}; "
            "select the dimensions"
        )
    atoms, bout = _atoms(whole)
    if not len(atoms):  # nothing moves for as long as a movement takes
        return []
    first, last = _unions(len(atoms), max_pieces)
    rows = np.column_stack((atoms[first, 0], atoms[last, 1]))
    long_enough = rows[:, 1] - rows[:, 0] >= _MIN_SAMPLES
    first, last, rows = first[long_enough], last[long_enough], rows[long_enough]
    if not len(rows):
        return []
    best, p, scores = _recognized(comparison, references, calibration, whole, rows, error_rate)
    chosen = _best_chain(first, last, scores, len(atoms))
    classes = references.classes.tolist()
    found = [
        (first[c], last[c], classes[best[c]], 1.0 - float(np.delete(p[c], best[c]).max(initial=0.0))) for c in chosen
    ]
    unknown = _left_over(first, last, chosen, bout)
    p_of = {(a, b): float(row.max()) for a, b, row in zip(first.tolist(), last.tolist(), p, strict=True)}
    found += [(a, b, None, 1.0 - p_of.get((a, b), 0.0)) for a, b in unknown]
    t = whole.times
    return [
        Spotted(float(t[atoms[a, 0]]), float(t[atoms[b, 1] - 1]), *answer)
        for a, b, *answer in sorted(found, key=_start)
    ]


def _start(found: tuple[Any, ...]) -> int:
    return int(found[0])


def _atoms(recording: Trajectory) -> tuple[Rows, NDArray[np.intp]]:
    """The smallest pieces, rows (n, 2), and which stretch between rests each is from."""
    rest, minima = Rest(), SpeedMinima(depth=0.5)
    motion: Motion = observe(recording, min(rest.resolution, minima.resolution))
    bouts = moving(motion, rest.pieces(motion), rest.resolution)
    if not len(bouts):
        return bouts, np.empty(0, dtype=np.intp)
    cuts = minima.inner_cuts(motion)
    of = np.searchsorted(bouts[:, 0], cuts, side="right") - 1
    inside = (of >= 0) & (cuts - _MIN_SAMPLES > bouts[of, 0]) & (cuts + _MIN_SAMPLES < bouts[of, 1])
    starts = np.sort(np.concatenate((bouts[:, 0], cuts[inside])))
    stops = np.sort(np.concatenate((bouts[:, 1], cuts[inside])))
    return np.column_stack((starts, stops)), np.searchsorted(bouts[:, 0], starts, side="right") - 1


def _unions(n: int, longest: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last piece of every run of at most `longest` neighbors."""
    first, length = np.meshgrid(np.arange(n), np.arange(min(longest, n)), indexing="ij")
    last = first + length
    return first[last < n], last[last < n]


def _recognized(
    comparison: Comparison,
    references: References,
    calibration: Calibration,
    whole: Trajectory,
    rows: Rows,
    error_rate: float,
) -> tuple[NDArray[np.intp], Array, Array]:
    """Best class, p-values (n, C), and score of each candidate; the score is positive where it counts as known."""
    candidates = pieces_of(whole, rows)
    (logs,) = score(comparison, references, candidates, nearest)
    durations = whole.times[rows[:, 1] - 1] - whole.times[rows[:, 0]]
    far = _log_tempo(references, durations)
    p = calibration.p_values(logs, error_rate)
    logs = logs - 0.5 * (far / np.log(_TEMPO)) ** 2
    plausible = far <= np.log(_MAX_TEMPO)
    p, logs = np.where(plausible, p, 0.0), np.where(plausible, logs, -np.inf)
    best = logs.argmax(axis=1)
    one = np.arange(len(rows))
    closeness = np.maximum(1.0 - logs[one, best] / _IMPOSTOR, 0.0)
    demonstrated = _durations(references)
    typical = float(np.median(durations if demonstrated is None else demonstrated))
    gain = closeness * durations - _PER_MOVEMENT * typical
    return best, p, np.where(p[one, best] > error_rate, gain, 0.0)


def _durations(references: References) -> Array | None:
    """Durations of the references; None where their arrays came without time stamps, so that none is known."""
    demos = references.all_movements()
    return None if demos.movements.times is None else demos.durations


def _log_tempo(references: References, durations: Array) -> Array:
    """Logarithmic distance of each duration from the demonstrated ones of each class, shape (n, C)."""
    known = _durations(references)
    if known is None:
        return np.zeros((len(durations), len(references.classes)))
    demonstrated = np.log(known)
    low, high = (which.reduceat(demonstrated, references.first) for which in (np.minimum, np.maximum))
    own = np.log(durations)[:, None]
    return np.asarray(np.maximum(np.maximum(low - own, own - high), 0.0))


def _best_chain(first: NDArray[np.intp], last: NDArray[np.intp], score: Array, n: int) -> list[int]:
    """Candidates that do not overlap, of largest summed score: dynamic programming over the pieces."""
    total = np.zeros(n + 1)  # of the best chain within the first j pieces
    taken = np.full(n + 1, -1)
    ending = np.split(np.argsort(last, kind="stable"), np.cumsum(np.bincount(last, minlength=n))[:-1])
    for j, here in enumerate(ending):
        values = total[first[here]] + score[here]
        total[j + 1] = total[j]
        if len(here) and values.max() > total[j]:
            total[j + 1], taken[j + 1] = values.max(), here[values.argmax()]
    chain, j = [], n
    while j > 0:
        if taken[j] < 0:
            j -= 1
        else:
            chain.append(int(taken[j]))
            j = int(first[taken[j]])
    return chain[::-1]


def _left_over(
    first: NDArray[np.intp], last: NDArray[np.intp], chosen: list[int], bout: NDArray[np.intp]
) -> list[tuple[int, int]]:
    """Runs of pieces that no chosen candidate holds, each from one stretch between rests."""
    free = np.ones(len(bout), dtype=bool)
    for c in chosen:
        free[first[c] : last[c] + 1] = False
    run = np.where(free, bout, -1)
    edges = np.flatnonzero(np.diff(np.concatenate(([-1], run, [-1]))))
    return [(int(a), int(b) - 1) for a, b in pairwise(edges) if run[a] >= 0]
