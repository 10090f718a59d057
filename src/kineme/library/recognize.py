"""Recognition with the movements of a library: with all of a small one, in two stages in a large one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.styles.parameters import as_primitives, without_turns
from kineme.errors import SpecificationError
from kineme.library.calibration_cache import calibrated, calibrated_once, sample_comparison
from kineme.library.members import Members, described_references, groups_of, members_of, some_of_each
from kineme.library.reduced_features_cache import ReducedMovements, open_cache
from kineme.library.storage import read
from kineme.library.storage.read import Ids
from kineme.library.storage.store import Store
from kineme.movements.channels.coordinates import turns_beyond
from kineme.movements.trajectories.trajectory import MovementsLike, Trajectory
from kineme.recognition.answer import Answer, Calibrates, KnownClasses, Neighbor, fit_known_classes, is_one
from kineme.recognition.classifiers import by_kernels
from kineme.recognition.conformal import calibrate
from kineme.recognition.early.hypotheses import Early, Hypotheses, as_early, hypotheses
from kineme.recognition.early.stream import Decision, Live
from kineme.recognition.monitor import Monitor, corridor, jitter
from kineme.recognition.two_stage_search import TwoStageSearch
from kineme.sampling import evenly_spaced
from kineme.similarity.comparison import StoredReferences, fit_to_references
from kineme.similarity.describe import with_values

#: Movements up to which every one is compared; up to 1000 the answer is the recognizer's own. Processor time of 2000
#: movements of 26 classes in space: 2.2 s until the first answer and 1.4 ms for each (two stages: 1.0 s, 3.4 ms).
EXHAUSTIVE = 2500
_MOST = 1000  # movements that recordings, and in a large library movements under way, are compared with
_OF_EACH = 10  # of each symbol, evenly spaced; more take longer
_ERROR_RATE = 0.05
_MONITORED = 500  # movements of a symbol that an execution is compared with, evenly spaced


class Current(NamedTuple):
    """The recognition of the symbols of one version, and the ids of its movements."""

    version: int
    ids: Ids
    model: KnownClasses | TwoStageSearch


@dataclass(eq=False)
class LibraryRecognizer:
    """The recognizer of a library; created on first use, and again after a change. Threads may share it."""

    store: Store
    exhaustive: int = EXHAUSTIVE
    _reduced: ReducedMovements | None = None
    _current: Current | None = None
    _begun: Begun | None = None
    _turn: Lock = field(default_factory=Lock)

    def recognize(self, X: MovementsLike, error_rate: float = 0.05) -> Answer | list[Answer]:
        """Return an `Answer` for one movement, a list for many; see `ActionLibrary.recognize`."""
        answers = self._answers(self.current(), X, error_rate)
        return answers[0] if is_one(X) else answers

    def stream(self, confidence: float = 0.9, patience: float = 0.05, early: Early | None = None) -> Live:
        """Recognize a movement while it is under way; see `ActionLibrary.stream`."""
        now = self.current()
        shared = self._beginnings(now, as_early(early))
        comparison, references = shared.classes.comparison, shared.classes.references
        return Live(
            comparison, references, shared.hypotheses, Decision(confidence, patience), partial(self._answer, now)
        )

    def current(self) -> Current:
        """Return the model of the symbols as they are now; one thread makes it, others wait."""
        with self._turn:
            version = self.store.version
            if self._current is None or version != self._current.version:
                members = members_of(self.store)
                if len(members.ids) <= self.exhaustive:
                    calibrate_by = partial(calibrated_once, self.store, members)
                    model = known_members(self.store, members, calibrate_by, kernels_alone=False)
                    self._current = Current(version, members.ids, model)
                else:
                    reduced = self._reduced = open_cache(self.store, self._reduced)
                    self._current = Current(version, reduced.ids, two_stages(self.store, reduced, members))
            return self._current

    def _beginnings(self, now: Current, early: Early) -> Begun:
        """Prepare those of all members of a small library, of some of a large one; stored for the next time."""
        with self._turn:
            shared = self._begun
            if shared is None or (shared.version, shared.early) != (now.version, early):
                classes = now.model if isinstance(now.model, KnownClasses) else some_of_each_symbol(self.store)
                prepared = hypotheses(classes.comparison, classes.references, early)
                shared = self._begun = Begun(now.version, early, classes, prepared)
            return shared

    def _answer(self, now: Current, movement: Trajectory) -> Answer:
        return self._answers(now, movement, _ERROR_RATE)[0]

    def _answers(self, now: Current, X: MovementsLike, error_rate: float) -> list[Answer]:
        """Return the answers with ids and names of movements instead of rows."""
        answers = now.model.recognize(X, error_rate)
        ids = np.unique([now.ids[near.index] for answer in answers for near in answer.nearest])
        names = {record["id"]: record["name"] for record in read.records(self.store, ids)}

        def name(near: Neighbor) -> Neighbor:
            key = int(now.ids[near.index])
            return Neighbor(key, names[key], near.similarity)

        return [replace(answer, nearest=tuple(map(name, answer.nearest))) for answer in answers]


def some_of_each_symbol(store: Store) -> KnownClasses:
    """Recognize symbols by at most ten members each, and 1000 in all or one of each."""
    members = members_of(store)
    return known_members(store, some_of_each(members, max(1, min(_OF_EACH, _MOST // len(members.names)))))


def known_members(
    store: Store,
    members: Members,
    calibrate_by: Calibrates = calibrate,
    in_memory: bool = True,
    kernels_alone: bool = True,
) -> KnownClasses:
    """Recognize symbols by these members, with their stored features; samples are read when asked for, or now.

    Unless it is by `kernels_alone`, all of "auto" recognizes them, as in `Recognizer`.
    """
    how = store.specification
    references = described_references(store, members.ids, members.labels)
    if in_memory:
        demos, features = read.movements(store, members.ids), references.described
        described = features if kernels_alone else with_values(features, demos, 0, len(demos), how.comparison)
        references = replace(references, demonstrations=demos, described=described)
    classifier = by_kernels(how.classifier) if kernels_alone else how.classifier
    fitted = fit_to_references(how.comparison, references, how.weights, store.channels)
    return fit_known_classes(*fitted, classifier, members.groups, calibrate_by)


def two_stages(store: Store, reduced: ReducedMovements, members: Members) -> TwoStageSearch:
    """Return the recognizer of a large library."""
    comparison = sample_comparison(store, members)
    how = comparison.specification
    columns = [store.specification.comparison.by_rows.index(representation) for representation in how.by_rows]
    stored = StoredReferences(
        tuple(reduced.bases[r] for r in columns),
        tuple(tuple(block[r] for r in columns) for block in reduced.blocks),
        np.searchsorted(reduced.ids, members.ids),
        members.first,
        how,
        lambda rows: read.feature_blocks(store, reduced.ids[rows], how.stored_rows),
        lambda rows: read.movements(store, reduced.ids[rows]),
    )
    calibration = calibrated(store, members, comparison.similarity, stored)
    return TwoStageSearch(comparison, calibration, members.names, stored)


class Begun(NamedTuple):
    """The beginnings of the movements of one version; any number of streams share them."""

    version: int
    early: Early
    classes: KnownClasses
    hypotheses: Hypotheses


def monitor(
    store: Store,
    ids: Ids,
    ends: tuple[ArrayLike | None, ArrayLike | None],
    error_rate: float,
    noise: float | None,
    stream: Callable[[], Live],
) -> Monitor:
    """Monitor by at most 500 of the movements; by their primitives' absolute paths if a start or a goal is given."""
    if not len(ids):
        raise SpecificationError("expected a symbol with movements to monitor by, got one without any")
    ids = ids[evenly_spaced(len(ids), _MONITORED)]
    demos, people = read.movements(store, ids), groups_of(store, ids)
    groups = None if people is None else people.tolist()
    noise = jitter(demos) if noise is None else noise
    if all(end is None for end in ends):
        return Monitor.of(demos, groups, error_rate=error_rate, noise=noise, stream=stream)
    primitives = as_primitives(read.primitives(store, ids))
    primitives = as_primitives(read.primitives(store, ids))
    about = primitives.recorded_as
    periods = None if about is None else about.periods(primitives.starts)
    if periods is not None:  # the start that is asked for, or the goal, may be in another turn
        begins = ends[0] is not None
        typical = np.median(primitives.starts if begins else primitives.goals, axis=0)
        asked = np.asarray(ends[0] if begins else ends[1], dtype=np.float64)
        if asked.shape == typical.shape:
            turns = np.broadcast_to(turns_beyond(typical[None], asked, periods), primitives.starts.shape)
            primitives = without_turns(primitives, turns)
    shown = corridor(primitives.rollout(*ends).positions, groups, error_rate, noise, relative=False)
    return Monitor(shown, store.channels, stream, periods)
