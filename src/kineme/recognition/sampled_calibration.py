"""Calibration where not every movement can be compared with every other one: on a sample, against the whole."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.bounds import log_bounds
from kineme.comparison.sampling import evenly_spaced
from kineme.kernels.procrustes import Prepared
from kineme.recognition.conformal import Calibration, ClassDistances, distances, score_classes, typical_scale
from kineme.recognition.recognizer import Recognizer
from kineme.recognition.two_stage_search import Rows, Stored
from kineme.validation import Array

_CLASSES = 1000  # classes sampled, at most, evenly spaced
_CALIBRATED = 100  # movements of a class, at most
_BUDGET = 4000  # movements in all, as far as four of each class allow
_FEWEST = 4
_SIZES = np.array([1, 2, 3, 4, 6, 8, 12, 16])  # classes of up to 16 are compared with others cut to as many, or less
_NEAREST = 4  # by their codes, compared exactly
_AT_ONCE = 64  # classes whose movements are read together


def calibrate_sample(recognizer: Recognizer, stored: Stored) -> Calibration:
    """The `Calibration` of a recognizer whose movements are stored elsewhere.

    As `conformal.calibrate`, with three differences: up to a hundred movements of a class calibrate it, but only about
    4000 in all and of a thousand classes, so that above 200 classes the scores of all classes count; classes of
    more than 16 are compared as if they were equally large; and the nearest movement is the nearest of four that the
    codes propose. Distances are to the whole class, not to the sample.
    """
    n_classes = len(stored.first)
    sampled = evenly_spaced(n_classes, _CLASSES)
    most = int(np.clip(_BUDGET // len(sampled), _FEWEST, _CALIBRATED))
    blank = ClassDistances(np.full((1, 1), np.inf), np.zeros(1, dtype=np.intp))
    windows, wholes = [blank] * n_classes, [blank] * n_classes
    for c, window, whole in _measured(recognizer, stored, sampled, most):
        windows[c], wholes[c] = window, whole
    several = any(len(one.distances) > 1 for one in windows)
    typical = 0.0 if several else typical_scale(_impostors(recognizer, stored))
    levels = np.where(stored.counts > _SIZES[-1], 0, _SIZES[np.searchsorted(_SIZES, stored.counts, side="right") - 1])
    known = {int(s): score_classes(windows if s else wholes, int(s) or most + 1, typical) for s in np.unique(levels)}
    scales = np.array([known[int(level)][0][c] for c, level in enumerate(levels)])
    own = [np.empty(0)] * n_classes
    for c in sampled:
        if stored.counts[c] > 1:
            own[c] = wholes[c].nearest(most + _SIZES[-1] + 1)[0] / scales[c]
    return Calibration(scales, tuple(own), tuple(known[int(level)][1] for level in levels))


def _measured(
    recognizer: Recognizer, stored: Stored, classes: NDArray[np.intp], most: int
) -> Iterator[tuple[int, ClassDistances, ClassDistances]]:
    """For each class, distances of its calibrating movements to some others of it, and to the nearest of the others."""
    for start in range(0, len(classes), _AT_ONCE):
        chosen = classes[start : start + _AT_ONCE]
        shuffled = [
            np.random.default_rng(int(c)).permutation(_rows(stored, int(c)))[: most + _SIZES[-1]] for c in chosen
        ]
        proposed = [
            _proposed(recognizer, stored, int(c), rows[:most]) for c, rows in zip(chosen, shuffled, strict=True)
        ]
        views = _views(recognizer, stored, np.concatenate([*shuffled, *(rows.ravel() for rows in proposed)]))
        place, later = 0, sum(map(len, shuffled))
        for c, rows, more in zip(chosen, shuffled, proposed, strict=True):
            seen = tuple(one.take(slice(place, place + len(rows))) for one in views)
            others = tuple(one.take(slice(later, later + more.size)) for one in views)
            place, later = place + len(rows), later + more.size
            k = min(most, len(rows))
            asked = tuple(one.take(slice(0, k)) for one in seen)
            away = distances(recognizer.similarity_.log_average(asked, seen))
            np.fill_diagonal(away, np.inf)
            rest = away[:, k:].min(axis=1, initial=np.inf)
            if more.size:
                rest = np.minimum(rest, _to_own(recognizer, asked, others))
            places = np.arange(k)
            whole = np.column_stack((away[:, :k], rest)) if len(rows) > k else away
            yield int(c), ClassDistances(away, places), ClassDistances(whole, places)


def _to_own(recognizer: Recognizer, asked: tuple[Prepared, ...], others: tuple[Prepared, ...]) -> Array:
    """Distance of each movement to the nearest of its own four others; a few movements in one product."""
    nearest = np.empty(len(asked[0].rows))
    for start in range(0, len(nearest), _NEAREST):
        some = tuple(one.take(slice(start, start + _NEAREST)) for one in asked)
        theirs = tuple(one.take(slice(_NEAREST * start, _NEAREST * (start + _NEAREST))) for one in others)
        k = np.arange(len(some[0].rows))
        away = distances(recognizer.similarity_.log_average(some, theirs)).reshape(len(k), len(k), _NEAREST)
        nearest[start : start + _NEAREST] = away[k, k].min(axis=1)
    return nearest


def _rows(stored: Stored, c: int) -> Rows:
    return stored.members[stored.first[c] : stored.first[c] + stored.counts[c]]


def _views(recognizer: Recognizer, stored: Stored, rows: Rows) -> tuple[Prepared, ...]:
    return tuple(map(recognizer.procrustes_.prepare, stored.views(rows)))


def _proposed(recognizer: Recognizer, stored: Stored, c: int, asked: Rows) -> Rows:
    """For each row asked, (k, 4) others of a large class, nearest by their codes, that are not asked themselves."""
    if stored.counts[c] <= _CALIBRATED + _SIZES[-1]:
        return np.empty((len(asked), 0), dtype=np.intp)
    own = np.setdiff1d(_rows(stored, c), asked)
    bounds = log_bounds(recognizer.similarity_, stored.codes_at(asked), stored.codes_at(own))
    return np.asarray(own[np.argpartition(-bounds, _NEAREST - 1, axis=1)[:, :_NEAREST]])


def _impostors(recognizer: Recognizer, stored: Stored) -> Array:
    """Distances of some movements to the nearest other one, where each is a class of its own."""
    asked = evenly_spaced(len(stored.members), _CALIBRATED)
    bounds = stored.bounds(recognizer.similarity_, stored.codes_at(stored.members[asked]))
    bounds[np.arange(len(asked)), asked] = -np.inf
    near = np.argpartition(-bounds, _NEAREST, axis=1)[:, :_NEAREST]
    found = np.empty(len(asked))
    for i, rows in enumerate(near):
        one = _views(recognizer, stored, stored.members[asked[i : i + 1]])
        others = _views(recognizer, stored, stored.members[rows])
        found[i] = distances(recognizer.similarity_.log_average(one, others)).min()
    return found
