"""Calibration of very many movements: a sample is compared with all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.bounds import log_bounds
from kineme.comparison.described import Described
from kineme.comparison.similarity import AveragedSimilarity
from kineme.comparison.stored_references import Rows, StoredReferences
from kineme.recognition.conformal import Calibration
from kineme.recognition.left_out import ClassDistances, distances, score_classes, typical_scale
from kineme.sampling import evenly_spaced
from kineme.validation import Array

_CLASSES = 1000  # classes sampled, at most, evenly spaced
_CALIBRATED = 100  # movements of a class, at most
_BUDGET = 4000  # movements in all, as far as four of each class allow
_FEWEST = 4
_SIZES = np.array([1, 2, 3, 4, 6, 8, 12, 16])  # classes of up to 16 are compared with others cut to as many, or less
_NEAREST = 8  # by their bounds, compared exactly: the nearest of all nine times in ten, else one 5 to 8 % farther
_TOGETHER = 4  # movements in one product
_MORE = 16  # the same among all, where shapes differ
_AT_ONCE = 64  # classes whose movements are read together


def calibrate_sample(similarity: AveragedSimilarity, stored: StoredReferences) -> Calibration:
    """The `Calibration` of movements that are stored elsewhere.

    As `conformal.calibrate`, with four differences: novelties are the scores of members, as other classes are not
    compared with, so that somewhat fewer than the error rate are called unknown; up to a hundred movements of a class
    calibrate it, but only about 4000 in all and of a thousand classes, so that above 200 classes the scores of all
    classes count; classes of more than 16 are compared as if they were equally large; and the nearest movement is the
    nearest of the eight with the largest bounds. Distances are to the whole class, not to the sample.
    """
    n_classes = len(stored.first)
    sampled = evenly_spaced(n_classes, _CLASSES)
    most = int(np.clip(_BUDGET // len(sampled), _FEWEST, _CALIBRATED))
    blank = ClassDistances(np.full((1, 1), np.inf), np.zeros(1, dtype=np.intp))
    windows, wholes = [blank] * n_classes, [blank] * n_classes
    for c, window, whole in _measured(similarity, stored, sampled, most):
        windows[c], wholes[c] = window, whole
    several = any(len(one.distances) > 1 for one in windows)
    typical = 0.0 if several else typical_scale(_impostors(similarity, stored))
    levels = np.where(stored.counts > _SIZES[-1], 0, _SIZES[np.searchsorted(_SIZES, stored.counts, side="right") - 1])
    known = {int(s): score_classes(windows if s else wholes, int(s) or most + 1, typical) for s in np.unique(levels)}
    scales = np.array([known[int(level)].scales[c] for c, level in enumerate(levels)])
    own = [np.empty(0)] * n_classes
    for c in sampled:
        if stored.counts[c] > 1:
            own[c] = wholes[c].nearest(most + _SIZES[-1] + 1)[0] / scales[c]
    pooled = {level: scored.pooled() for level, scored in known.items()}
    novelties = {level: scored.pooled_novelties() for level, scored in known.items()}
    return Calibration(
        scales,
        tuple(own),
        tuple(pooled[int(level)] for level in levels),
        tuple(own),
        tuple(novelties[int(level)] for level in levels),
    )


def _measured(
    similarity: AveragedSimilarity, stored: StoredReferences, classes: NDArray[np.intp], most: int
) -> Iterator[tuple[int, ClassDistances, ClassDistances]]:
    """For each class, distances of its calibrating movements to some others of it, and to the nearest of the others."""
    for start in range(0, len(classes), _AT_ONCE):
        chosen = classes[start : start + _AT_ONCE]
        shuffled = [
            np.random.default_rng(int(c)).permutation(_rows(stored, int(c)))[: most + _SIZES[-1]] for c in chosen
        ]
        proposed = [
            _proposed(similarity, stored, int(c), rows[:most]) for c, rows in zip(chosen, shuffled, strict=True)
        ]
        described = stored.described(similarity, np.concatenate([*shuffled, *(rows.ravel() for rows in proposed)]))
        begin, later = 0, sum(map(len, shuffled))
        for c, rows, more in zip(chosen, shuffled, proposed, strict=True):
            own = described.take(slice(begin, begin + len(rows)))
            others = described.take(slice(later, later + more.size))
            begin, later = begin + len(rows), later + more.size
            k = min(most, len(rows))
            asked = own.take(slice(0, k))
            away = distances(similarity.log_average(asked, own))
            np.fill_diagonal(away, np.inf)
            nearest = away[:, k:].min(axis=1, initial=np.inf)
            if more.size:
                nearest = np.minimum(nearest, _to_own(similarity, asked, others))
            indices = np.arange(k)
            whole = np.column_stack((away[:, :k], nearest)) if len(rows) > k else away
            yield int(c), ClassDistances(away, indices), ClassDistances(whole, indices)


def _to_own(similarity: AveragedSimilarity, asked: Described, others: Described) -> Array:
    """Distance of each movement to the nearest of its own eight others; a few movements in one product."""
    nearest = np.empty(len(asked))
    for start in range(0, len(nearest), _TOGETHER):
        some = asked.take(slice(start, start + _TOGETHER))
        theirs = others.take(slice(_NEAREST * start, _NEAREST * (start + _TOGETHER)))
        k = np.arange(len(some))
        away = distances(similarity.log_average(some, theirs)).reshape(len(k), len(k), _NEAREST)
        nearest[start : start + _TOGETHER] = away[k, k].min(axis=1)
    return nearest


def _rows(stored: StoredReferences, c: int) -> Rows:
    return stored.members[stored.first[c] : stored.first[c] + stored.counts[c]]


def _proposed(similarity: AveragedSimilarity, stored: StoredReferences, c: int, asked: Rows) -> Rows:
    """For each row asked, (k, 8) others of a large class, nearest by their bounds, that are not asked themselves."""
    if stored.counts[c] <= _CALIBRATED + _SIZES[-1]:
        return np.empty((len(asked), 0), dtype=np.intp)
    own = np.setdiff1d(_rows(stored, c), asked)
    bounds = log_bounds(similarity, stored.reduced_at(asked), stored.reduced_at(own))
    return np.asarray(own[np.argpartition(-bounds, _NEAREST - 1, axis=1)[:, :_NEAREST]])


def _impostors(similarity: AveragedSimilarity, stored: StoredReferences) -> Array:
    """Distances of some movements to the nearest other one, where each is a class of its own."""
    asked = evenly_spaced(len(stored.members), _CALIBRATED)
    bounds = stored.bounds(similarity, stored.reduced_at(stored.members[asked]))
    bounds[np.arange(len(asked)), asked] = -np.inf
    n_near = max(1, min(_MORE, len(stored.members) - 1))
    near = np.argpartition(-bounds, n_near - 1, axis=1)[:, :n_near]
    found = np.empty(len(asked))
    for i, rows in enumerate(near):
        one = stored.described(similarity, stored.members[asked[i : i + 1]])
        others = stored.described(similarity, stored.members[rows])
        found[i] = distances(similarity.log_average(one, others)).min()
    return found
