"""The comparison of movements: a specification with kernel widths and weights that are fitted to labeled movements."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.encode import check_movement
from kineme.dmp.recorded_as import RecordedAs
from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.rotation import RotationPrior
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.coordinates import mean_turn, turns_beyond, with_periods
from kineme.movements.preparation.resample import extents_of
from kineme.movements.trajectories.as_learned import as_learned
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import in_coordinates
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.runtime.parallel import single_threaded_blas
from kineme.similarity.bounds import ReducedFeatures, Single, log_bounds
from kineme.similarity.describe import Described, describe_as, prepare
from kineme.similarity.similarity import ALONE, WEIGHTS, AveragedSimilarity, given_weights, impostor_widths, own_weights
from kineme.similarity.specification import ComparisonSpecification, Normalization, Representation, rotating
from kineme.validation import Array, check_choice

Rows = NDArray[np.intp]

_HELD = 8192  # references that are held described, at most: some 50 MB in space


@dataclass(frozen=True, eq=False)
class Comparison:
    """Everything that is needed to describe and compare movements; made by `fit_comparison`.

    - `representations`: those with a weight above 0, and positions over arc length if pairs are rotated by them.
    - `channels`: what was recorded of the movements that it was fitted to; None if that is not known.
    - `turn`: where position counts, where the columns of these movements begin (d,), and what they wrap by (d,).
    """

    representations: tuple[Representation, ...]
    normalization: Normalization
    cutoff: float | None  # movements are smoothed below this many cycles each; None for not at all
    similarity: AveragedSimilarity  # with the distance, the widths, the weights and the average
    channels: Channels | None = None
    turn: tuple[Array, Array] | None = None

    @property
    def procrustes(self) -> Procrustes:
        """The distance between rows, and the best rotation of a pair."""
        return self.similarity.procrustes

    @property
    def n_dims(self) -> int:
        """Number of dimensions d of the movements."""
        return self.procrustes.n_columns

    @property
    def mean(self) -> str:
        """The A-average over representations."""
        return self.similarity.mean

    @cached_property
    def specification(self) -> ComparisonSpecification:
        """The same without widths and weights, so for other movements."""
        prior = self.procrustes.prior
        angle = self.procrustes.max_angle if prior is None else None
        return ComparisonSpecification(
            self.representations,
            self.normalization,
            self.cutoff,
            angle,
            self.mean,
            prior or RotationPrior(),
            self.procrustes.n_points,
        )

    def checked(self, movements: MovementsLike, what: str = "movements") -> Demonstrations:
        """Return the movements as `Demonstrations`, in the coordinates that were learned, and in their turn.

        See `as_learned`.

        `what` they are called in messages.

        Raises `TrajectoryError`: movements of another number of dimensions, or of channels of other kinds.
        """
        return _in_turn(as_learned(movements, self.channels, self.n_dims, what), self.turn)

    def turned(self, starts: Array) -> Array:
        """Return starts (n, d) in the turn of the movements that it was fitted to, where position counts."""
        return starts if self.turn is None else starts - turns_beyond(starts, *self.turn, most=0.5)

    def describe(self, movements: Demonstrations) -> Described:
        """Return movements in the coordinates that were learned, described as the references are."""
        return describe_as(movements, self, self.procrustes)

    def prepared(self, rows: tuple[NDArray[np.floating[Any]], ...]) -> Described:
        """Return feature rows, as from `feature_rows`, ready for comparison."""
        return prepare(rows, self, self.procrustes)

    def select(self, representations: NDArray[np.intp]) -> Comparison:
        """Return the comparison by some of the representations."""
        similarity = self.similarity
        weights = None if similarity.weights is None else similarity.weights[representations]
        similarity = replace(similarity, widths=similarity.widths[representations], weights=weights)
        return replace(
            self, representations=tuple(self.representations[r] for r in representations), similarity=similarity
        )


def fit_comparison(
    specification: ComparisonSpecification,
    demos: Demonstrations,
    labels: NDArray[Any],
    weights: str | Sequence[float] = "auto",
) -> tuple[Comparison, References]:
    """Describe movements, and estimate widths and weights from them.

    - `labels` (m,): the class of each.
    - `weights` ({"auto", "own", "equal", "fitted"} or sequence of R numbers, default "auto"): "own" takes the weights
      of the representations, "fitted" estimates them, see `fitted_weights`; "auto" does so where that can be.

    Returns `comparison`: with the representations that have a weight above 0, and with positions over arc length if any
    of them is compared pair by pair; `references`: the movements, ordered by class. Raises `SpecificationError`:
    weights that do not fit the specification, or movements that are all the same; `TrajectoryError`: one at rest.
    """
    demos = Demonstrations.of_movements(replace(in_coordinates(demos.movements), labels=labels), demos.steps)
    check_movement(demos, demos.positions[demos.offsets[:-1]], extents_of(demos, 0, len(demos)))
    specification = specification.with_points(demos.channels)
    channels = None if demos.channels is None else with_periods(demos.channels, demos.recorded)
    turn = None
    if demos.channels is not None and not specification.normalization.translation:
        starts = demos.positions[demos.offsets[:-1]]
        turn = mean_turn(starts, RecordedAs(demos.channels).periods(starts))
        demos = _in_turn(demos, turn)
    order = np.argsort(labels, kind="stable")
    demos, labels = demos[order], labels[order]
    with single_threaded_blas():  # products of few rows: a second thread mostly waits
        described = describe_as(demos, specification, specification.procrustes(demos.n_dims))
        references = References.of(demos, described, labels)
        comparison, references = fit_to_references(specification, references, weights, channels)
        return replace(comparison, turn=turn), references


def _in_turn(demos: Demonstrations, turn: tuple[Array, Array] | None) -> Demonstrations:
    """Return movements less whole turns: each is unwrapped from its own first sample."""
    turns = 0.0 if turn is None else turns_beyond(demos.positions[demos.offsets[:-1]], *turn, most=0.5)
    if not np.any(turns):
        return demos
    positions = demos.positions - np.repeat(turns, demos.lengths, axis=0)
    return Demonstrations.of_movements(replace(demos.movements, positions=positions), demos.steps)


def fit_to_references(
    specification: ComparisonSpecification,
    references: References,
    weights: str | Sequence[float] = "auto",
    channels: Channels | None = None,
) -> tuple[Comparison, References]:
    """Fit like `fit_comparison` to movements that are described already, in all representations of the specification.

    `channels` are what was recorded of them, where that is known.
    """
    described, labels = references.described, references.labels
    representations = specification.representations
    with single_threaded_blas():
        alone = len(references) == 1
        quantities = [representation.quantity for representation in representations]
        if alone:
            widths = np.array([ALONE[quantity] for quantity in quantities]) * described.sizes()
        else:
            widths = impostor_widths(described, labels)
        similarity = AveragedSimilarity(described.procrustes, widths, specification.mean)
        if isinstance(weights, str):
            check_choice("weights", weights, list(WEIGHTS))
            chosen = own_weights if alone else WEIGHTS[weights]  # nothing to fit to
            values = chosen(similarity, described, labels)
        else:
            if specification.mean != "arithmetic":
                raise SpecificationError(
                    f"expected weights with mean='arithmetic', got them with mean={specification.mean!r}"
                )
            values = given_weights(weights, len(representations))
    in_pairs = any(
        representation.in_pairs and value > 0 for representation, value in zip(representations, values, strict=True)
    )
    # Where movements are compared pair by pair, their rotation comes from their positions, even with a weight of 0.
    needed = np.arange(len(values)) == rotating(representations) if in_pairs else False
    selected = np.flatnonzero((values > 0) | needed)
    comparison = Comparison(
        specification.representations,
        specification.normalization,
        specification.cutoff,
        replace(similarity, weights=values),
        channels,
    )
    return comparison.select(selected), replace(references, described=described.select(selected))


class IndexedMovements(Protocol):
    """Movements by their indices: `Demonstrations`, or what reads them when asked."""

    @property
    def names(self) -> Sequence[str | None] | None:
        """Origin of each movement."""
        ...

    def __getitem__(self, index: NDArray[np.intp], /) -> Demonstrations: ...


@dataclass(frozen=True, eq=False)
class References:
    """Stored movements of C classes, ordered by class."""

    demonstrations: IndexedMovements
    described: Described  # their rows, ready for comparison
    labels: NDArray[Any]  # (m,), the class of each, sorted
    classes: NDArray[Any]  # (C,), the labels, each once, sorted
    first: NDArray[np.intp]  # (C,), index of the first movement of each class

    @classmethod
    def of(cls, demonstrations: IndexedMovements, described: Described, labels: NDArray[Any]) -> References:
        """Return movements whose labels are sorted."""
        classes, first = np.unique(labels, return_index=True)
        return cls(demonstrations, described, labels, classes, first)

    def __len__(self) -> int:
        return len(self.labels)

    def all_movements(self) -> Demonstrations:
        """Return the movements as `Demonstrations`; read, if they are not held in memory."""
        held = self.demonstrations
        return held if isinstance(held, Demonstrations) else held[np.arange(len(self))]

    @cached_property
    def counts(self) -> NDArray[np.intp]:
        """Movements of each class, (C,)."""
        return np.diff(self.first, append=len(self.labels))

    def slices(self) -> Iterator[slice]:
        """Return the slice of the movements of each class."""
        return (slice(int(start), int(start + count)) for start, count in zip(self.first, self.counts, strict=True))


@dataclass(frozen=True, eq=False)
class StoredReferences:
    """Movements of C classes that are not held in memory.

    `features`: from rows of the reduced features to their feature rows per representation, see `describe.feature_rows`.
    """

    bases: tuple[Array, ...]  # R of shape (S, k)
    reduced: tuple[tuple[ReducedFeatures, ...], ...]  # one or several blocks, one after the other
    members: Rows  # (m,), rows of the reduced features that belong to a class, ordered by class
    first: Rows  # (C,), where in `members` each class begins
    specification: ComparisonSpecification  # how the features are described
    features: Callable[[Rows], tuple[NDArray[Any], ...]]
    movements: Callable[[Rows], Demonstrations]  # from rows of the reduced features to `Demonstrations`

    @cached_property
    def counts(self) -> Rows:
        """Members of each class, (C,)."""
        return np.diff(self.first, append=len(self.members))

    def bounds(self, similarity: AveragedSimilarity, queries: tuple[ReducedFeatures, ...]) -> Single:
        """Return bounds (n, m) of the log similarity to every member."""
        every = [log_bounds(similarity, queries, block) for block in self.reduced]
        return np.asarray(np.concatenate(every, axis=1)[:, self.members])

    def reduced_at(self, rows: Rows) -> tuple[ReducedFeatures, ...]:
        """Return reduced features of some rows, in their order."""
        ends = np.cumsum([len(block[0].values) for block in self.reduced])
        which = np.searchsorted(ends, rows, side="right")
        order = np.argsort(np.argsort(which, kind="stable"))
        parts = [
            tuple(features.take(rows[which == b] - (ends[b - 1] if b else 0)) for features in block)
            for b, block in enumerate(self.reduced)
        ]
        return tuple(
            ReducedFeatures(*(np.concatenate(fields)[order] for fields in zip(*same, strict=True)))
            for same in zip(*parts, strict=True)
        )

    def described(self, similarity: AveragedSimilarity, rows: Rows) -> Described:
        """Return the movements of some rows, ready for comparison."""
        return prepare(self.features(rows), self.specification, similarity.procrustes)


class HeldReferences:
    """Stored references that are described once: movements asked about together are compared with many of the same."""

    def __init__(self, stored: StoredReferences, similarity: AveragedSimilarity) -> None:
        self._stored, self._similarity = stored, similarity
        self.n_rows = sum(len(block[0].values) for block in stored.reduced)
        self._at = np.zeros(self.n_rows, dtype=np.int32)  # 1 + where a row is held, 0 if it is not
        self._held: Described | None = None
        self._n_held = 0

    def described(self, rows: Rows) -> Described:
        """Return the movements of some rows, ready for comparison; those not held are read, all at once."""
        missing = np.unique(rows[self._at[rows] == 0])
        if self._n_held + len(missing) > _HELD:
            self._at[:], self._n_held, missing = 0, 0, np.unique(rows)
        if len(missing) > _HELD:
            return self._stored.described(self._similarity, rows)
        if len(missing):
            self._hold(missing)
        assert self._held is not None
        return self._held.take(self._at[rows] - 1)

    def _hold(self, missing: Rows) -> None:
        new = self._stored.described(self._similarity, missing)
        if self._held is None:
            self._held = new.empty(_HELD)
        self._held.put(self._n_held, new)
        self._at[missing] = np.arange(self._n_held, self._n_held + len(missing)) + 1
        self._n_held += len(missing)


@dataclass(frozen=True, eq=False)
class OnDemand:
    """Movements at some rows, without names, that are read when indexed."""

    rows: Rows
    movements: Callable[[Rows], Demonstrations]
    names: None = None

    def __getitem__(self, chosen: Rows) -> Demonstrations:
        return self.movements(self.rows[chosen])

    def __len__(self) -> int:
        return len(self.rows)
