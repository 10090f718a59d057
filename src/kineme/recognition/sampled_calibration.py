"""Calibration of very many movements: a sample is compared with all."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from kineme.recognition.conformal import Calibration, between_classes, least_scale
from kineme.recognition.left_out import (
    REACH,
    REACH_OF_OTHERS,
    ClassDistances,
    comparable_groups,
    distances,
    finite,
    score_classes,
    typical_scale,
)
from kineme.sampling import evenly_spaced
from kineme.similarity.bounds import log_bounds
from kineme.similarity.described import Described
from kineme.similarity.references import Rows, StoredReferences
from kineme.similarity.similarity import AveragedSimilarity
from kineme.validation import Array

_CLASSES = 1000  # classes sampled, at most, evenly spaced
_CALIBRATED = 100  # movements of a class, at most
_BUDGET = 4000  # movements in all, as far as four of each class allow
_FEWEST = 4
_SIZES = np.array([1, 2, 3, 4, 6, 8, 12, 16])  # classes of up to 16 are compared with others cut to as many, or less
_NEAREST = 8  # by their bounds, compared exactly: the nearest of all nine times in ten, else one 5 to 8 % farther
_TOGETHER = 4  # movements in one product
_OTHERS = 64  # of the largest bounds, among which the nearest movement of another class is
_BOUNDED = 8  # movements whose bounds to all members are in memory at once
_MORE = 16  # the same among all, where shapes differ
_AT_ONCE = 64  # classes whose movements are read together


def calibrate_sample(
    similarity: AveragedSimilarity, stored: StoredReferences, groups: Rows | None = None
) -> Calibration:
    """Calibrate for movements that are stored elsewhere; `groups` are the numbers (m,) of the members' groups.

    As `conformal.calibrate`, with five differences: novelties are the scores of members, as other classes are not
    compared with, so that somewhat fewer than the error rate are called unknown; the exponent is not fitted; up to a
    hundred movements of a class calibrate it, but only about 4000 in all and of a thousand classes, so that above 200
    classes the scores of all classes count; classes of more than 16 are compared as if they were equally large; and
    the nearest movement is the nearest of the eight with the largest bounds. Distances are to the whole class, not to
    the sample.
    """
    n_classes = len(stored.first)
    sampled = evenly_spaced(n_classes, _CLASSES)
    most = int(np.clip(_BUDGET // len(sampled), _FEWEST, _CALIBRATED))
    blank = ClassDistances(np.full((1, 1), np.inf), np.zeros(1, dtype=np.intp))
    windows, wholes = [blank] * n_classes, [blank] * n_classes
    groups = comparable_groups(groups)
    for c, window, to_all in _measured(similarity, stored, groups, sampled, most):
        windows[c], wholes[c] = window, to_all
    to_others, typical = _impostors(similarity, stored), 0.0
    if not any(np.isfinite(window.distances).any() for window in windows):
        typical = typical_scale(to_others, REACH if groups is None else REACH_OF_OTHERS)
    levels = np.where(stored.counts > _SIZES[-1], 0, _SIZES[np.searchsorted(_SIZES, stored.counts, side="right") - 1])
    by_level = {int(s): score_classes(windows if s else wholes, int(s) or most + 1, typical) for s in np.unique(levels)}
    scales = np.array([by_level[int(level)].scales[c] for c, level in enumerate(levels)])
    own = [np.empty(0)] * n_classes
    for c in sampled:
        if stored.counts[c] > 1:
            own[c] = finite(wholes[c].nearest(wholes[c].distances.shape[1])[0] / scales[c])
    pooled = {level: scored.pooled() for level, scored in by_level.items()}
    novelties = {level: scored.pooled_novelties() for level, scored in by_level.items()}
    calibration = Calibration(
        scales,
        tuple(own),
        tuple(pooled[int(level)] for level in levels),
        tuple(own),
        tuple(novelties[int(level)] for level in levels),
        between_classes(to_others, windows, groups),
    )
    return calibration.with_least_scales(np.full(n_classes, least_scale(to_others)))


def _measured(
    similarity: AveragedSimilarity, stored: StoredReferences, groups: Rows | None, classes: Rows, most: int
) -> Iterator[tuple[int, ClassDistances, ClassDistances]]:
    """Measure, for each class, distances of its calibrating movements to some others, and to the nearest of the others.

    With groups, to the nearest of each group among the others.
    """
    group_of = np.arange(len(stored.members)) if groups is None else groups
    for start in range(0, len(classes), _AT_ONCE):
        chosen = classes[start : start + _AT_ONCE]
        shuffled = [
            np.random.default_rng(int(c)).permutation(_positions(stored, int(c)))[: most + _SIZES[-1]] for c in chosen
        ]
        proposed = [
            _proposed(similarity, stored, group_of, int(c), some[:most])
            for c, some in zip(chosen, shuffled, strict=True)
        ]
        compared = np.concatenate([*shuffled, *(some.ravel() for some in proposed)])
        described = stored.described(similarity, stored.members[compared])
        begin, later = 0, sum(map(len, shuffled))
        for c, some, more in zip(chosen, shuffled, proposed, strict=True):
            own = described.take(slice(begin, begin + len(some)))
            others = described.take(slice(later, later + more.size))
            begin, later = begin + len(some), later + more.size
            k = min(most, len(some))
            calibrating, by = own.take(slice(0, k)), group_of[some[:k], None]
            away = distances(similarity.log_average(calibrating, own))
            away[by == group_of[some]] = np.inf
            window = ClassDistances(away, np.arange(k), None if groups is None else groups[some])
            beyond = np.column_stack((away[:, k:], _to_own(similarity, calibrating, others)))
            which = group_of[np.column_stack((np.broadcast_to(some[k:], (k, len(some) - k)), more))]
            beyond[by == which] = np.inf
            yield int(c), window, _whole(window, beyond, which) if beyond.size else window


def _whole(window: ClassDistances, beyond: Array, which: Rows) -> ClassDistances:
    """Return distances to the k calibrating movements, and to the nearest `beyond` them, with groups to each one's."""
    k, shown_by = len(window.distances), window.groups
    if shown_by is None:
        nearest = beyond.min(axis=1)
        return ClassDistances(np.column_stack((window.distances[:, :k], nearest)), window.indices)
    each = np.unique(which)
    columns = [np.where(which == group, beyond, np.inf).min(axis=1) for group in each]
    away = np.column_stack((window.distances[:, :k], *columns))
    return ClassDistances(away, window.indices, np.concatenate((shown_by[:k], each)))


def _to_own(similarity: AveragedSimilarity, movements: Described, others: Described) -> Array:
    """Return distances of each movement to its own eight others, which may be none; a few movements in one product."""
    if not len(others):
        return np.empty((len(movements), 0))
    away = np.empty((len(movements), _NEAREST))
    for start in range(0, len(away), _TOGETHER):
        some = movements.take(slice(start, start + _TOGETHER))
        theirs = others.take(slice(_NEAREST * start, _NEAREST * (start + _TOGETHER)))
        k = np.arange(len(some))
        every = distances(similarity.log_average(some, theirs)).reshape(len(k), len(k), _NEAREST)
        away[start : start + _TOGETHER] = every[k, k]
    return away


def _positions(stored: StoredReferences, c: int) -> Rows:
    """Return positions of a class among the members."""
    return stored.first[c] + np.arange(stored.counts[c])


def _proposed(
    similarity: AveragedSimilarity, stored: StoredReferences, group_of: Rows, c: int, positions: Rows
) -> Rows:
    """Return (k, 8) other members of a large class, nearest by their bounds: of other groups, not among the k."""
    if stored.counts[c] <= _CALIBRATED + _SIZES[-1]:
        return np.empty((len(positions), 0), dtype=np.intp)
    own = np.setdiff1d(_positions(stored, c), positions)
    both = (stored.reduced_at(stored.members[some]) for some in (positions, own))
    bounds = log_bounds(similarity, *both)
    bounds[group_of[positions, None] == group_of[own]] = -np.inf
    return np.asarray(own[np.argpartition(-bounds, _NEAREST - 1, axis=1)[:, :_NEAREST]])


def _impostors(similarity: AveragedSimilarity, stored: StoredReferences) -> Array:
    """Return distances of some movements to the nearest of other classes."""
    positions = evenly_spaced(len(stored.members), _CALIBRATED)
    shown = np.repeat(np.arange(len(stored.first)), stored.counts)
    parts = (positions[start : start + _BOUNDED] for start in range(0, len(positions), _BOUNDED))
    near = np.concatenate([_near_impostors(similarity, stored, shown, some) for some in parts])
    impostors = np.empty(len(positions))
    for i, members in enumerate(near):
        movement = stored.described(similarity, stored.members[positions[i : i + 1]])
        others = stored.described(similarity, stored.members[members])
        away = distances(similarity.log_average(movement, others))
        impostors[i] = away[:, shown[members] != shown[positions[i]]].min(initial=np.inf)
    return impostors


def _near_impostors(similarity: AveragedSimilarity, stored: StoredReferences, shown: Rows, positions: Rows) -> Rows:
    """Return (k, 64) members with the largest bounds for k movements; of their own class only if others lack."""
    bounds = stored.bounds(similarity, stored.reduced_at(stored.members[positions]))
    bounds[shown[positions, None] == shown] = -np.inf
    n_near = max(1, min(_OTHERS, len(stored.members) - 1))
    np.negative(bounds, out=bounds)
    return np.argpartition(bounds, n_near - 1, axis=1)[:, :n_near]
