"""Recognition with the movements of a library: with all of a small one, in two stages in a large one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.stored_references import StoredReferences
from kineme.library.recognition.calibration_cache import calibrated, calibrated_once, sample_comparison
from kineme.library.recognition.members import Members, described_references, members_of
from kineme.library.recognition.reduced_features_cache import ReducedMovements, open_cache, updated
from kineme.library.storage import read
from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.recognition.answer import Answer, Neighbor, is_one
from kineme.recognition.conformal import calibrate
from kineme.recognition.known_classes import Calibrates, KnownClasses, fit_known_classes
from kineme.recognition.two_stage_search import TwoStageSearch

#: Movements up to which every one is compared: the answer is then the recognizer's own. Processor time of 2000
#: movements of 26 classes in space: 2.2 s until the first answer and 1.4 ms for each (two stages: 1.0 s, 3.4 ms).
EXHAUSTIVE = 2500


@dataclass(eq=False)
class LibraryRecognizer:
    """The recognizer of a library; created on first use, and again after a change."""

    store: Store
    exhaustive: int = EXHAUSTIVE
    _version: int | None = None
    _reduced: ReducedMovements | None = None
    _ids: Ids = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    _model: KnownClasses | TwoStageSearch | None = None

    def recognize(self, X: MovementsLike, error_rate: float = 0.05) -> Answer | list[Answer]:
        """An `Answer` for one movement, a list for many; see `ActionLibrary.recognize`."""
        answers = self._named(self.model().recognize(X, error_rate))
        return answers[0] if is_one(X) else answers

    def model(self) -> KnownClasses | TwoStageSearch:
        """What recognizes the symbols as they are now: by all of their movements, or in two stages."""
        version = self.store.version
        if self._model is None or version != self._version:
            members = members_of(self.store)
            self._model = self._small(members) if len(members.ids) <= self.exhaustive else self._large(members)
            self._version = version
        return self._model

    def _small(self, members: Members) -> KnownClasses:
        self._ids = members.ids
        return known_members(self.store, members, partial(calibrated_once, self.store, members))

    def _large(self, members: Members) -> TwoStageSearch:
        self._reduced = open_cache(self.store) if self._reduced is None else updated(self.store, self._reduced)
        self._ids = self._reduced.ids
        return two_stages(self.store, self._reduced, members)

    def _named(self, answers: list[Answer]) -> list[Answer]:
        """The answers with ids and names of movements instead of rows."""
        ids = np.unique([self._ids[near.index] for answer in answers for near in answer.nearest])
        names = {one["id"]: one["name"] for one in read.records(self.store, ids)}

        def name(near: Neighbor) -> Neighbor:
            key = int(self._ids[near.index])
            return Neighbor(key, names[key], near.similarity)

        return [replace(answer, nearest=tuple(map(name, answer.nearest))) for answer in answers]


def known_members(store: Store, members: Members, calibrate_by: Calibrates = calibrate) -> KnownClasses:
    """What recognizes the symbols of a small library: all members, by their stored features."""
    how = store.specification
    references = described_references(store, members.ids, members.labels)
    references = replace(references, demonstrations=read.movements(store, members.ids))  # few: kept in memory
    return fit_known_classes(
        how.comparison, references, how.weights, how.classifier, members.groups, store.channels, calibrate_by
    )


def two_stages(store: Store, reduced: ReducedMovements, members: Members) -> TwoStageSearch:
    """The recognizer of a large library."""
    comparison = sample_comparison(store, members)
    how = comparison.specification
    kept = [store.specification.comparison.by_rows.index(one) for one in how.by_rows]
    ends = np.cumsum(store.specification.widths(store.n_dims or 0))

    def features(rows: NDArray[np.intp]) -> tuple[NDArray[Any], ...]:
        blocks = np.split(read.features(store, reduced.ids[rows]), ends[:-1], axis=1)
        return tuple(blocks[r] for r in kept)

    stored = StoredReferences(
        tuple(reduced.bases[r] for r in kept),
        tuple(tuple(block[r] for r in kept) for block in reduced.blocks),
        reduced.rows(members.ids),
        members.first,
        how,
        features,
        lambda rows: read.movements(store, reduced.ids[rows]),
    )
    calibration = calibrated(store, members, comparison.similarity, stored)
    return TwoStageSearch(comparison, calibration, members.names, stored)
