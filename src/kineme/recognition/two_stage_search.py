"""Recognition among very many movements, in two stages: bounds from reduced features, then the averaged kernel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.answer import Answer, Verdict, answers_of, verdicts_of
from kineme.recognition.classifiers import Nearest
from kineme.recognition.conformal import (
    Calibration,
    ClassDistances,
    between_classes,
    check_error_rate,
    comparable_groups,
    distances,
    finite,
    least_scale,
    score_classes,
    typical_scale,
)
from kineme.runtime.parallel import single_threaded_blas
from kineme.sampling import evenly_spaced
from kineme.similarity.bounds import ReducedFeatures, Single, log_bounds, reduce_features
from kineme.similarity.comparison import Comparison, HeldReferences, OnDemand, References, Rows, StoredReferences
from kineme.similarity.describe import Described, describe_tile
from kineme.similarity.scores import Compared
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import LOG_MEANS
from kineme.validation import Array

_SAMPLED_CLASSES = 1000  # classes sampled, at most, evenly spaced
_CALIBRATED = 100  # movements of a class, at most
_BUDGET = 4000  # movements in all, as far as four of each class allow
_FEWEST = 4
_SIZES = np.array([1, 2, 3, 4, 6, 8, 12, 16])  # classes of up to 16 are compared with others cut to as many, or less
_NEAREST = 8  # by their bounds, compared exactly: the nearest of all nine times in ten, else one 5 to 8 % farther
_TOGETHER = 4  # movements in one product
_OTHERS = 64  # of the largest bounds, among which the nearest movement of another class is
_BOUNDED = 8  # movements whose bounds to all members are in memory at once
_AT_ONCE = 64  # classes whose movements are read together

_LEADING, _BEST = 3, 16  # classes, and movements of each, compared first
_CLASSES = 64  # classes with p-values in an answer
_MOST = 4096  # movements compared afterwards, where bounds leave doubt about the nearest of all
_OF_CLASSES = 256  # and about the nearest of each class
_ASKED, _MOST_ASKED = 16, 256  # movements whose bounds are computed in one matrix product: least, most
_BOUNDS = 1_000_000  # bounds at a time, where that is more than the least


@dataclass(frozen=True, eq=False)
class TwoStageSearch:
    """Recognition by the nearest reference where only the reduced features of the references are in memory.

    Without representations that are compared pair by pair, the best-ranked class is that of an exhaustive search as
    long as no more than 4096 movements are in doubt, their bound above the similarity to the nearest one known. With
    them, as by default, it is the best among the most promising movements of all and of each class and some 256 more,
    in the order of the bounds of the other representations. P-values are given for the 64 classes whose could be
    largest; they are exact as long as no more than 256 others could be the nearest of their class, else not too small
    for the nearest classes, and possibly too small for those far away.

    On bent handwriting (``python -m bench --only library``; one busy core), of 100 movements asked among 40,000 in the
    plane and of 40 among 10,000 in space, all got the class of comparing all; an answer took 8 ms and 10 ms of
    processor time.
    """

    comparison: Comparison  # fitted to a sample
    calibration: Calibration  # of all classes
    classes: NDArray[Any]  # (C,)
    stored: StoredReferences

    def recognize(self, X: MovementsLike, error_rate: float = 0.05) -> list[Answer]:
        """Return an answer for each movement; ``nearest[k].index`` is a row of the features, and names are left out."""
        check_error_rate(error_rate)
        demos = self.comparison.checked(X)
        answers: list[Answer] = []
        held = HeldReferences(self.stored, self.comparison.similarity)
        step = max(_ASKED, min(_MOST_ASKED, _BOUNDS // len(self.stored.members)))
        for start in range(0, len(demos), step):
            some = demos[start : start + step]
            described = describe_tile(some, 0, len(some), self.comparison, self.comparison.procrustes)
            with single_threaded_blas():  # held once, not for each of many small products
                verdicts = self._verdicts(described, held, error_rate)
            every = OnDemand(np.arange(held.n_rows), self.stored.movements)
            answers += answers_of(verdicts, self.comparison, every, some)
            _ = answers[-1].transform  # of all of these, while what is stored can still be read
        return answers

    def _verdicts(self, described: Described, held: HeldReferences, error_rate: float) -> list[Verdict]:
        """Tell what each movement is; ``nearest[k].index`` is a row of the features."""
        bounds = self.stored.bounds(self.comparison.similarity, self.reduced(described))
        promising = [self._promising(bound) for bound in bounds]
        held.described(self.stored.members[np.unique(np.concatenate(promising))])
        verdicts = []
        for i in range(len(described)):
            movement = described.take(slice(i, i + 1))
            chosen, _, compared = self.compare(movement, bounds[i], held, promising[i])
            owners = np.searchsorted(self.stored.first, chosen, side="right") - 1
            verdict = verdicts_of(compared, Nearest(), self.calibration.select(np.unique(owners)), error_rate)[0]
            rows = self.stored.members[chosen]
            near = tuple(replace(other, index=int(rows[other.index])) for other in verdict.answer.nearest)
            examples = tuple((label, int(rows[index]), similarity) for label, index, similarity in verdict.examples)
            verdicts.append(verdict._replace(answer=replace(verdict.answer, nearest=near), examples=examples))
        return verdicts

    def reduced(self, described: Described) -> tuple[ReducedFeatures, ...]:
        """Return reduced features of described movements."""
        rows = tuple(
            np.concatenate((block.rows.real, block.rows.imag), axis=1) if np.iscomplexobj(block.rows) else block.rows
            for block in described.blocks
        )
        rows = tuple(self.comparison.procrustes.by_points(block) for block in rows)
        return reduce_features(self.stored.bases, rows, self.comparison.n_dims)

    def compare(
        self, movement: Described, bounds: Single, held: HeldReferences | None = None, promising: Rows | None = None
    ) -> tuple[Rows, Array, Compared]:
        """Return the members one movement was compared with, ascending; log similarities; the comparison with them.

        First the most promising of all and of each class; then whoever could still be nearer than the nearest of its
        class found so far or, in a class not compared with yet, than the nearest of all.
        """
        held = held or HeldReferences(self.stored, self.comparison.similarity)
        chosen = self._promising(bounds) if promising is None else promising
        squares, logs = self._exact(movement, held.described(self.stored.members[chosen]))
        near = np.full(len(self.classes), logs.max())
        owners = np.searchsorted(self.stored.first, chosen, side="right") - 1
        begins = np.flatnonzero(np.diff(owners, prepend=-1))
        near[owners[begins]] = np.maximum.reduceat(logs, begins)
        in_pairs = bool(self.comparison.specification.by_pairs)  # what they add to the others is not bounded
        doubtful = np.ones(len(bounds), bool) if in_pairs else bounds > np.repeat(near, self.stored.counts)
        doubtful[chosen] = False
        more = np.flatnonzero(doubtful)
        decisive = 0 if in_pairs else int(np.count_nonzero(bounds[more] > logs.max()))
        n_more = min(decisive, _MOST) + _OF_CLASSES
        if len(more) > n_more:
            more = np.sort(more[np.argpartition(-bounds[more], n_more)[:n_more]])
        if len(more):
            others, other_logs = self._exact(movement, held.described(self.stored.members[more]))
            chosen = np.concatenate((chosen, more))
            order = np.argsort(chosen, kind="stable")
            squares = np.concatenate((squares, others), axis=2)[:, :, order]
            chosen, logs = chosen[order], np.concatenate((logs, other_logs))[order]
        return chosen, logs, self._compared(movement, chosen).with_squares(squares)

    def _promising(self, bounds: Single) -> Rows:
        first, counts = self.stored.first, self.stored.counts
        tops = np.maximum.reduceat(bounds, first)
        best = []
        for c in np.argsort(-tops, kind="stable")[:_LEADING]:
            of_class = bounds[first[c] : first[c] + counts[c]]
            n_best = min(_BEST, len(of_class))
            best.append(first[c] + np.argpartition(-of_class, n_best - 1)[:n_best])
        scores = distances(tops) / self.calibration.scales
        n_classes = min(_CLASSES, len(first))
        classes = np.argpartition(scores, n_classes - 1)[:n_classes]
        top = [first[c] + int(bounds[first[c] : first[c] + counts[c]].argmax()) for c in classes]
        return np.unique(np.concatenate([*best, top]))

    def _exact(self, movement: Described, others: Described) -> tuple[Array, Array]:
        """Return squared distances (R, 1, k) and log similarities (k,) of one movement to others."""
        squares = self.comparison.similarity.squared_distances(movement, others)
        return squares, LOG_MEANS[self.comparison.mean](self.comparison.similarity.logs_at(squares))[0]

    def _compared(self, movement: Described, chosen: Rows) -> Compared:
        """Return one movement and the members that it was compared with: these are described no more."""
        rows = self.stored.members[chosen]
        owners = np.searchsorted(self.stored.first, chosen, side="right") - 1
        demonstrations = OnDemand(rows, self.stored.movements)
        first = np.flatnonzero(np.diff(owners, prepend=-1))
        none, labels = movement.take(slice(0, 0)), self.classes[owners]
        references = References(demonstrations, none, labels, labels[first], first)
        return Compared(self.comparison, references, movement)


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
    sampled = evenly_spaced(n_classes, _SAMPLED_CLASSES)
    most = int(np.clip(_BUDGET // len(sampled), _FEWEST, _CALIBRATED))
    blank = ClassDistances(np.full((1, 1), np.inf), np.zeros(1, dtype=np.intp))
    windows, wholes = [blank] * n_classes, [blank] * n_classes
    groups = comparable_groups(groups)
    for c, window, to_all in _measured(similarity, stored, groups, sampled, most):
        windows[c], wholes[c] = window, to_all
    to_others, typical = _impostors(similarity, stored), 0.0
    if not any(np.isfinite(window.distances).any() for window in windows):
        typical = typical_scale(to_others, groups)
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
