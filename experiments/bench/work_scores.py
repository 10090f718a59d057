"""Scores of names, boundaries and bad episodes against the truth."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_WITHIN = 0.25  # s
_JOINED = 0.1  # s, an end and a start that are nearer are one boundary

Segment = tuple[float, float, str | None]  # start, end [s], name


class Boundaries(NamedTuple):
    """Counts over episodes, from which precision, recall and F1 follow."""

    hits: int
    found: int
    true: int

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall."""
        return 2.0 * self.hits / max(1, self.found + self.true)


class Names(NamedTuple):
    """Counts of segments of the truth, each beside the found one that shares most of the union with it."""

    true: int
    right: int  # the name is right
    matched: int  # half of the union or more is shared
    matched_right: int
    confused: Counter[tuple[str, str]]  # (true, given) -> how often; "unknown" for None, "missed" where none overlaps

    @property
    def accuracy(self) -> float:
        """Share of all true segments that are named right."""
        return self.right / max(1, self.true)


def boundaries_of(segments: Iterable[Segment]) -> NDArray[np.float64]:
    """Return sorted starts and ends [s]; those nearer than 0.1 s are one, at their mean."""
    times = np.sort(np.array([time for start, end, _ in segments for time in (start, end)], dtype=float))
    if not len(times):
        return times
    groups = np.cumsum(np.append(0, np.diff(times) > _JOINED))
    return np.asarray(np.bincount(groups, times) / np.bincount(groups))


def score_boundaries(truth: Sequence[Sequence[Segment]], found: Sequence[Sequence[Segment]]) -> Boundaries:
    """Match boundaries of each episode one to one, within 0.25 s, as many as possible (in the order of time)."""
    hits = n_found = n_true = 0
    for true, segments in zip(truth, found, strict=True):
        a, b = boundaries_of(true).tolist(), boundaries_of(segments).tolist()
        n_found, n_true, i, j = n_found + len(b), n_true + len(a), 0, 0
        while i < len(a) and j < len(b):  # on a line, matching the earliest that fit is optimal
            if abs(a[i] - b[j]) <= _WITHIN:
                hits, i, j = hits + 1, i + 1, j + 1
            elif a[i] < b[j]:
                i += 1
            else:
                j += 1
    return Boundaries(hits, n_found, n_true)


def score_names(truth: Sequence[Sequence[Segment]], found: Sequence[Sequence[Segment]]) -> Names:
    """Compare the name of each true segment with that of the found one that shares most of the union with it."""
    matched = right = matched_right = total = 0
    confused: Counter[tuple[str, str]] = Counter()
    for true, segments in zip(truth, found, strict=True):
        for start, end, name in true:
            total += 1
            shares = [_shared(start, end, a, b) for a, b, _ in segments]
            best = int(np.argmax(shares)) if shares else -1
            if best < 0 or shares[best] <= 0.0:
                confused[str(name), "missed"] += 1
                continue
            given = segments[best][2] or "unknown"
            confused[str(name), given] += 1
            right += given == name
            matched += shares[best] >= 0.5
            matched_right += shares[best] >= 0.5 and given == name
    return Names(total, right, matched, matched_right, confused)


def edges_within(
    truth: Sequence[Sequence[Segment]], found: Sequence[Sequence[Segment]], uncertainties: Sequence[Sequence[float]]
) -> tuple[int, int]:
    """Count starts and ends of found segments that are within their uncertainty [s] of the true ones, and all of them.

    Those are of the true segment of the same name that shares half of the union or more; others do not count.
    """
    inside = total = 0
    for true, segments, doubts in zip(truth, found, uncertainties, strict=True):
        for (start, end, name), doubt in zip(segments, doubts, strict=True):
            for a, b, given in true:
                if given == name and _shared(start, end, a, b) >= 0.5:
                    inside += (abs(start - a) <= doubt) + (abs(end - b) <= doubt)
                    total += 2
    return inside, total


def auroc(scores: Sequence[float], bad: Sequence[bool]) -> float:
    """Return the probability that a bad episode scores above a good one, ties counting half."""
    from scipy.stats import rankdata

    labels, ranks = np.asarray(bad, bool), rankdata(scores)
    n_bad, n_good = int(labels.sum()), int((~labels).sum())
    return float((ranks[labels].sum() - 0.5 * n_bad * (n_bad + 1)) / (n_bad * n_good))


def rate(hits: int, of: int, level: float = 0.95) -> tuple[float, float, float]:
    """Return a rate and its confidence interval, exact after Clopper and Pearson."""
    from scipy.stats import beta

    tail = 0.5 * (1.0 - level)
    low = float(beta.ppf(tail, hits, of - hits + 1)) if hits else 0.0
    high = float(beta.ppf(1.0 - tail, hits + 1, of - hits)) if hits < of else 1.0
    return hits / of, low, high


def _shared(start: float, end: float, other_start: float, other_end: float) -> float:
    """Intersection of two stretches over their union."""
    both = min(end, other_end) - max(start, other_start)
    return max(0.0, both) / max(1e-9, max(end, other_end) - min(start, other_start))
