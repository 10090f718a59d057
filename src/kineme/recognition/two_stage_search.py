"""Recognition among very many movements, in two stages: bounds from reduced features, then the averaged kernel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.answer import Answer, Verdict, verdicts_of, with_transforms
from kineme.recognition.classifiers import Nearest
from kineme.recognition.conformal import Calibration, check_error_rate
from kineme.recognition.left_out import distances
from kineme.runtime.parallel import single_threaded_blas
from kineme.similarity.bounds import ReducedFeatures, Single, reduce_features
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import describe_tile, recorded_paths
from kineme.similarity.described import Described
from kineme.similarity.references import HeldReferences, OnDemand, References, Rows, StoredReferences
from kineme.similarity.scores import Compared
from kineme.similarity.specification import LOG_MEANS
from kineme.validation import Array

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
            some = demos[start : start + step] if len(demos) > step else demos
            tile = describe_tile(some, 0, len(some), self.comparison, self.comparison.procrustes)
            with single_threaded_blas():  # held once, not for each of many small products
                verdicts = self._verdicts(tile.described, held, error_rate)
            every = OnDemand(np.arange(held.n_rows), self.stored.movements)
            answers += with_transforms(verdicts, self.comparison, every, some, recorded_paths(some, tile.paths))
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
            near = tuple(replace(other, index=int(rows[other.index])) for other in verdict.nearest)
            verdicts.append(verdict._replace(nearest=near))
        return verdicts

    def reduced(self, described: Described) -> tuple[ReducedFeatures, ...]:
        """Return reduced features of described movements."""
        rows = tuple(
            np.concatenate((block.rows.real, block.rows.imag), axis=1) if np.iscomplexobj(block.rows) else block.rows
            for block in described.blocks
        )
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
