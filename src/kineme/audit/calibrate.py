"""Calibration of checks: evidence that an episode is unusual in its set, with a stated rate of false alarms.

1. Each value of each check is compared with those of the other episodes of its task, or, where a task has too few, with
   those of all such tasks, each about the median of its own. Above their median m, values of good episodes fall about
   exponentially: the evidence ``e = log 2 + (v - m) / t`` is minus the logarithm of their share, with ``t`` from the
   value q that a fifth exceeds, ``t = (1 + 1 / sqrt(n)) (q - m) / log(5 / 2)``. Up to a fifth of the episodes may be
   bad before that changes much.
2. The evidence of a check is its largest one over channels, and that of an episode its largest one over checks, each
   put on this scale again: how many there are, and how they depend on each other, makes no difference.
3. An episode has ``p = #{evidence >= its own} / n`` among the n that do not contradict themselves: that of conformal
   prediction, with itself left out. Good episodes have p <= e in a share of at most e, whatever their law: it holds
   where the exponential does not. "Outlying" are those that the procedure of Benjamini and Hochberg lists by that law.
   Where these are more than the share e, good episodes cannot be all of them: they are set aside, and the rest is
   ranked, so that bad episodes do not hide each other. The good ones among those set aside then come on top: where
   values have far heavier tails than exponential ones, more than the share e is flagged.

Sources: Y. Benjamini, Y. Hochberg, "Controlling the False Discovery Rate", J. R. Stat. Soc. B 57(1), 1995; V. Vovk,
A. Gammerman, G. Shafer, "Algorithmic Learning in a Random World", Springer 2005.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.recognition.outliers import listed
from kineme.sampling import evenly_spaced
from kineme.validation import Array

FEWEST_OF_TASK = 5  # episodes: with fewer, nobody can tell what is usual for the task
#: Episodes of a task, with fewer of which the spread of values is taken from all such tasks: where it depends on what
#: is done, as ranges do, and where it is one of sensors and hands.
ENOUGH = {True: 40, False: 100}
_MIDDLE, _UPPER = 0.5, (0.8, 0.9)  # quantiles that tell the law
_TOGETHER = 0.8  # of all checks together
_UNIT = math.log((1 - _MIDDLE) / (1 - _TOGETHER))  # difference of these, where the slope is 1
#: Share of the others whose distance counts, and how many at least and at most: fewer that are wrong alike would vouch
#: for each other.
_NEAREST, _FEWEST_NEAREST, _MOST_NEAREST = 0.1, 3, 10
_COMPARED = 200  # episodes of a task that each is compared with, at most, evenly spaced
_ELSEWHERE = 20  # episodes of each other task, at most
_BLOCK = 256  # episodes that are compared at once
_TIES = 1e-4  # of the sum of evidence: counts are often equal, and equal ones are all flagged or none
_ROUNDED = 1e-9  # evidence

Groups = list[NDArray[np.intp]]


class Ranking(NamedTuple):
    """Episodes compared with each other."""

    evidence: Array  # (n,), minus the logarithm of the share of good episodes that are as unusual, about
    p_values: Array  # (n,), 1 where nothing could be compared
    outlying: NDArray[np.bool_]  # (n,), beyond what good episodes do
    by_chance: int  # good episodes that are flagged by rank, at most


def tasks_of(tasks: Sequence[str | None]) -> Groups:
    """Return the episodes of each task."""
    _, numbers = np.unique([task or "" for task in tasks], return_inverse=True)
    order = np.argsort(numbers, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)


def groups_of(tasks: Groups, fewest: int) -> Groups:
    """Return groups of episodes that are compared: tasks with at least `fewest`, and all others together."""
    large = [rows for rows in tasks if len(rows) >= fewest]
    small = [rows for rows in tasks if len(rows) < fewest]
    return [*large, np.concatenate(small)] if small else large


def centered(values: Array, tasks: Groups) -> Array:
    """Return values (n, k) less the median of their task, where it has at least five, or of all."""
    result = np.empty_like(values)
    common = _quantiles(values, 0.5)
    for rows in tasks:
        usual = _quantiles(values[rows], 0.5) if len(rows) >= FEWEST_OF_TASK else common
        result[rows] = values[rows] - np.where(np.isnan(usual), common, usual)
    return result


def evidence_of(values: Array, groups: Groups, least: float, upper: tuple[float, ...] = _UPPER) -> Array:
    """Return the evidence (n, k) of values, the larger the more unusual; 0 where there is no value.

    `least` is a difference that means nothing, whatever the spread; `upper` are the quantiles that tell this.
    """
    result = np.zeros(values.shape)
    for rows in groups:
        middle, slopes = _quantiles(values[rows], _MIDDLE), []
        for share in upper:
            away = np.maximum(_quantiles(values[rows], share) - middle, least)
            slopes.append(away / math.log((1 - _MIDDLE) / (1 - share)))
        step = np.max(slopes, axis=0) * (1 + len(rows) ** -0.5)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(values[rows] > middle, (values[rows] - middle) / np.maximum(step, 1e-12), 0.0)
        result[rows] = np.where(ratio > 0, math.log(2) + ratio, 0.0)
    return np.nan_to_num(result, nan=0.0, posinf=1e12)


def rank(evidence: Array, comparable: NDArray[np.bool_], error_rate: float) -> Ranking:
    """Rank episodes by their evidence (n, checks), see 2. and 3. of this file.

    Not `comparable` are those that contradict themselves: they are no measure of others, and have p = 1 here.
    """
    n = len(evidence)
    largest = evidence.max(axis=1, initial=0.0) + _TIES * evidence.sum(axis=1)
    p_values, outlying, rows = np.ones(n), np.zeros(n, dtype=np.bool_), np.flatnonzero(comparable)
    by_chance = 0
    if len(rows):
        # Many episodes may be bad together, though few by each check; its slope is 1 where each check's law holds.
        law = evidence_of(largest[rows, None], [np.arange(len(rows))], _UNIT, (_TOGETHER,))[:, 0]
        outlying[rows[listed(np.exp(-law), error_rate)]] = True
        aside = outlying.sum() > error_rate * len(rows)
        among = np.sort(largest[rows[~outlying[rows]]] if aside else largest[rows])
        as_large = len(among) - np.searchsorted(among, largest[rows] - _ROUNDED)
        p_values[rows] = np.maximum(as_large, 1) / max(len(among), 1)
        by_chance = int(error_rate * len(among) + 1e-9)
    return Ranking(largest, p_values, outlying, by_chance)


def unlike(
    read: Callable[[NDArray[np.intp]], Array], extents: Array, tasks: Groups, n: int, progress: Callable[[int], object]
) -> Array:
    """Return how far the way of each of n episodes is from those of its task, and from those of others: logs (n, 2).

    The distance of two ways is the root of the mean square, over samples and channels, of their difference in
    multiples of the channel's usual `extents` (d,). The first column is the log of the mean distance to the nearest, a
    tenth, three to ten, of up to 200 others of the task; the second is this, less the log of that to the nearest of up
    to 20 of each other task. NaN where there are too few. `read` returns the ways (m, d, 64) of some episodes.
    """
    result = np.full((n, 2), np.nan)
    weights = np.where(extents > 0, 1 / np.where(extents > 0, extents, 1.0), 0.0)[:, None]

    def flat(rows: NDArray[np.intp]) -> Array:
        return np.asarray((read(rows) * weights).reshape(len(rows), -1) / math.sqrt(max(1, weights.size * 64)))

    chosen = [rows[evenly_spaced(len(rows), _ELSEWHERE)] for rows in tasks if len(rows) >= FEWEST_OF_TASK]
    elsewhere = np.concatenate(chosen)[evenly_spaced(sum(map(len, chosen)), 4 * _COMPARED)] if chosen else np.array([])
    foreign = flat(elsewhere) if len(elsewhere) else np.empty((0, 0))
    for rows in tasks:
        if len(rows) >= FEWEST_OF_TASK:
            own = rows[evenly_spaced(len(rows), _COMPARED)]
            ways, others = flat(own), foreign[~np.isin(elsewhere, rows)]
            k = min(max(_FEWEST_NEAREST, min(_MOST_NEAREST, int(_NEAREST * len(own)))), len(own) - 1)
            for first in range(0, len(rows), _BLOCK):
                some = rows[first : first + _BLOCK]
                compared = flat(some)
                away = _distances(compared, ways)
                away[some[:, None] == own] = np.inf
                near = np.log(np.partition(away, k - 1, axis=1)[:, :k].mean(axis=1) + 1e-9)
                result[some, 0] = near
                if len(others):
                    result[some, 1] = near - np.log(_distances(compared, others).min(axis=1) + 1e-9)
        progress(len(rows))
    return result


def _distances(ways: Array, others: Array) -> Array:
    """Return Euclidean distances between rows."""
    squares = (ways**2).sum(axis=1)[:, None] + (others**2).sum(axis=1) - 2 * ways @ others.T
    return np.sqrt(np.maximum(squares, 0.0))


def _quantiles(values: Array, share: float) -> Array:
    """Return quantiles (k,) of columns without their missing values; NaN where all are missing."""
    ordered = np.sort(values, axis=0)  # NaN last
    n = np.isfinite(ordered).sum(axis=0)
    at = np.maximum(n - 1, 0) * share
    low = np.floor(at).astype(np.intp)
    columns = np.arange(values.shape[1])
    lower, upper = ordered[low, columns], ordered[np.minimum(low + 1, np.maximum(n - 1, 0)), columns]
    return np.asarray(np.where(n > 0, lower + (upper - lower) * (at - low), np.nan))
