"""Recognition among very many movements, in two stages: bounds from codes, then the averaged kernel on a few."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.bounds import Code, Single, encode, log_bounds
from kineme.kernels.procrustes import Prepared
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.recognition.answer import Answer, answers_to
from kineme.recognition.conformal import Calibration, check_error_rate, distances
from kineme.validation import Array

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer

Rows = NDArray[np.intp]

_LEADING, _BEST = 3, 16  # classes, and movements of each, compared first
_CLASSES = 64  # classes that an answer speaks of
_MOST = 4096  # movements compared afterwards, where bounds leave doubt about the nearest of all
_OF_CLASSES = 256  # and about the nearest of each class
_ASKED = 16  # questions whose bounds are computed in one matrix product


@dataclass(frozen=True, eq=False)
class Stored:
    """Movements that are not held in memory: their codes, and where to get the rest.

    Attributes
    ----------
    bases : tuple of R ndarrays (S, k)
    codes : tuple of tuples of R Code
        One or several blocks, one after the other.
    members : ndarray of shape (m,)
        Rows of the codes that belong to a class, ordered by class.
    first : ndarray of shape (C,)
        Where in `members` each class begins.
    views : callable
        From rows of the codes to their full rows per representation, as `views.view` gives them.
    movements : callable
        From rows of the codes to `Demonstrations`.
    """

    bases: tuple[Array, ...]
    codes: tuple[tuple[Code, ...], ...]
    members: Rows
    first: Rows
    views: Callable[[Rows], tuple[NDArray[Any], ...]]
    movements: Callable[[Rows], Demonstrations]

    @cached_property
    def counts(self) -> Rows:
        """Members of each class, (C,)."""
        return np.diff(self.first, append=len(self.members))

    def bounds(self, similarity: Any, asked: tuple[Code, ...]) -> Single:
        """Bounds (n, m) of the log similarity to every member."""
        every = [log_bounds(similarity, asked, block) for block in self.codes]
        return np.asarray(np.concatenate(every, axis=1)[:, self.members])

    def codes_at(self, rows: Rows) -> tuple[Code, ...]:
        """Codes of some rows, in their order."""
        ends = np.cumsum([len(block[0].values) for block in self.codes])
        which = np.searchsorted(ends, rows, side="right")
        order = np.argsort(np.argsort(which, kind="stable"))
        parts = [
            tuple(code.take(rows[which == b] - (ends[b - 1] if b else 0)) for code in block)
            for b, block in enumerate(self.codes)
        ]
        return tuple(
            Code(*(np.concatenate(fields)[order] for fields in zip(*same, strict=True)))
            for same in zip(*parts, strict=True)
        )


@dataclass(frozen=True, eq=False)
class Shortlist:
    """A recognizer of which only the comparison is in memory.

    `recognizer` is fitted, to a sample: it holds widths, weights and calibration of all classes (`classes` in order).
    The best-ranked class is that of an exhaustive search as long as no more than 4096 movements are in doubt, their
    bound above the similarity to the nearest one known. P-values are given for the 64 classes whose could be largest;
    they are exact as long as no more than 256 others could be the nearest of their class, else not too small for
    the nearest classes, and possibly too small for those far away.

    On bent handwriting (bench/library.py; two busy cores), of 500 movements asked among 200,000 in the plane and of 40
    among 20,000 in space, all were ranked as by comparing all; an answer took 20 ms and 33 ms of processor time.
    """

    recognizer: Recognizer
    classes: NDArray[Any]
    stored: Stored

    def recognize(self, X: Any, error_rate: float = 0.05) -> list[Answer]:
        """An answer for each movement; ``nearest[k].index`` is a row of the codes, and names are left out."""
        check_error_rate(error_rate)
        demos = Demonstrations.of(X)
        found: list[Answer] = []
        for start in range(0, len(demos), _ASKED):
            tile = demos[start : start + _ASKED] if len(demos) > _ASKED else demos
            seen = self.recognizer.look_at(tile)
            bounds = self.stored.bounds(self.recognizer.similarity_, self.codes_of(seen))
            for i in range(len(tile)):
                one = tuple(rows.take(slice(i, i + 1)) for rows in seen)
                places, _, views = self.compare(one, bounds[i])
                small = self._over(places, views)
                answer = answers_to(small, tile[i : i + 1], one, error_rate)[0]
                rows = self.stored.members[places]
                near = tuple(replace(other, index=int(rows[other.index])) for other in answer.nearest)
                found.append(replace(answer, nearest=near))
        return found

    def codes_of(self, seen: tuple[Prepared, ...]) -> tuple[Code, ...]:
        """Codes of movements that the recognizer looked at."""
        rows = tuple(
            np.concatenate((one.rows.real, one.rows.imag), axis=1) if np.iscomplexobj(one.rows) else one.rows
            for one in seen
        )
        return encode(self.stored.bases, rows, self.recognizer.n_dims_)

    def compare(self, one: tuple[Prepared, ...], bounds: Single) -> tuple[Rows, Array, tuple[Prepared, ...]]:
        """Places among the members, ascending, that one movement was compared with; log similarities; their views.

        First the most promising of all and of each class; then whoever could still be nearer than the nearest of its
        class found so far or, in a class not looked at, than the nearest of all.
        """
        places = self._promising(bounds)
        views, logs = self._exact(one, places)
        near = np.full(len(self.classes), logs.max())
        owners = np.searchsorted(self.stored.first, places, side="right") - 1
        begins = np.flatnonzero(np.diff(owners, prepend=-1))
        near[owners[begins]] = np.maximum.reduceat(logs, begins)
        doubtful = bounds > np.repeat(near, self.stored.counts)
        doubtful[places] = False
        more = np.flatnonzero(doubtful)
        decisive = int(np.count_nonzero(bounds[more] > logs.max()))
        n_more = min(decisive, _MOST) + _OF_CLASSES
        if len(more) > n_more:
            more = np.sort(more[np.argpartition(-bounds[more], n_more)[:n_more]])
        if not len(more):
            return places, logs, views
        others, other_logs = self._exact(one, more)
        order = np.argsort(np.concatenate((places, more)), kind="stable")
        joined = tuple(
            Prepared(np.concatenate((a.rows, b.rows))[order], np.concatenate((a.squares, b.squares))[order])
            for a, b in zip(views, others, strict=True)
        )
        return np.concatenate((places, more))[order], np.concatenate((logs, other_logs))[order], joined

    def _promising(self, bounds: Single) -> Rows:
        first, counts = self.stored.first, self.stored.counts
        tops = np.maximum.reduceat(bounds, first)
        best = []
        for c in np.argsort(-tops, kind="stable")[:_LEADING]:
            of_class = bounds[first[c] : first[c] + counts[c]]
            n_best = min(_BEST, len(of_class))
            best.append(first[c] + np.argpartition(-of_class, n_best - 1)[:n_best])
        scores = distances(tops) / self.recognizer.calibration().scales
        n_classes = min(_CLASSES, len(first))
        classes = np.argpartition(scores, n_classes - 1)[:n_classes]
        top = [first[c] + int(bounds[first[c] : first[c] + counts[c]].argmax()) for c in classes]
        return np.unique(np.concatenate([*best, top]))

    def _exact(self, one: tuple[Prepared, ...], places: Rows) -> tuple[tuple[Prepared, ...], Array]:
        prepare = self.recognizer.procrustes_.prepare
        views = tuple(map(prepare, self.stored.views(self.stored.members[places])))
        return views, self.recognizer.similarity_.log_average(one, views)[0]

    def _over(self, places: Rows, views: tuple[Prepared, ...]) -> Recognizer:
        """An ordinary recognizer of the movements compared, with the calibration of their classes."""
        owners = np.searchsorted(self.stored.first, places, side="right") - 1
        chosen = np.unique(owners)
        whole = self.recognizer.calibration()
        own, pooled = ([part[c] for c in chosen] for part in (whole.own, whole.pooled))
        calibration = Calibration(whole.scales[chosen], tuple(own), tuple(pooled))
        stored = _OnDemand(self.stored.members[places], self.stored.movements)
        return self.recognizer.over(stored, self.classes[owners], views, calibration)


@dataclass(frozen=True, eq=False)
class _OnDemand:
    """Movements that are read when one is looked at."""

    rows: Rows
    movements: Callable[[Rows], Demonstrations]
    names: None = None

    def __getitem__(self, chosen: Rows) -> Demonstrations:
        return self.movements(self.rows[chosen])

    def __len__(self) -> int:
        return len(self.rows)
