"""The specification of a comparison: its parameters, without estimates from movements.

Kernels are averaged by their logarithms here; `kineme.kernels.table` has the same averages of the kernels themselves,
with what is proved of each.

Representations of movements: a quantity along a phase, compared sample by sample or pair by pair.

Before movements are compared, the normalization removes their translation and size.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from kineme.dmp.discrete.dmp import DMP
from kineme.dmp.discrete.operators import encoder, forcing_matrix
from kineme.dmp.discrete.specification import MOST_BASIS, MOST_POINTS
from kineme.errors import SpecificationError, TrajectoryError, warn
from kineme.kernels.pair_distances import CloudSpec, ElasticSpec
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.rotation import RotationPrior
from kineme.movements.channels.channel import Channels
from kineme.movements.channels.detect import point_names, points_apart
from kineme.movements.preparation.resample import resample_by_arc_length
from kineme.movements.preparation.smooth import Smooth, spline_matrix
from kineme.movements.tables.layout import listed
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array, check_choice, check_count, check_number, check_switch

SCALES = ("path", "per-dimension", "none")
SMALLEST, LARGEST = 1e-15, 1e15  # range of sizes of movements that keep their size
_OPERATIONS_PER_SAMPLE = 5
_FLAT = 1e-6  # share of the whole extent; flatter dimensions are not scaled up

#: Compared sample by sample: a movement is a row of numbers.
ROW_QUANTITIES = ("positions", "forcing")
#: Compared pair by pair, see `kineme.kernels.pair_distances`.
PAIR_QUANTITIES = ("elastic", "turning", "cloud")
QUANTITIES = ROW_QUANTITIES + PAIR_QUANTITIES

#: Quantity -> name of the representation.
PAIR_NAMES = {"elastic": "elastic path", "turning": "turning angles", "cloud": "point cloud"}

#: Detailed representations are smoothed below so many times as many cycles as the others, and are finer.
DETAIL = 4.0
DETAILED_ELASTIC, DETAILED_CLOUD = ElasticSpec(n_segments=66), CloudSpec(n_points=32)
#: Signals are compared by their values rather than their slopes, and in detail by their slopes: two that differ.
SIGNAL_ELASTIC = ElasticSpec(position_weight=2.0)
#: Weights of representations of signals, relative to those of paths, but for those in detail.
_OF_SIGNALS = {"positions": 0.5, "forcing": 1.0, "elastic": 3.0, "turning": 0.0, "cloud": 0.0}


@dataclass(frozen=True)
class Representation:
    """One way to describe an evenly sampled, smooth path: by a row of numbers, or by what pairs are compared by.

    A recognizer compares movements in several representations and averages the similarities: what misleads one of them,
    such as uneven timing or a deformed path, leaves another one unimpaired.

    Parameters
    ----------
    quantity : {"positions", "forcing", "elastic", "turning", "cloud"}
        Sample by sample: "positions", the path itself, or "forcing", the forcing term f of a bio-inspired DMP learned
        from it, which turns with the movement. The DMP is fitted to the path with a curvature penalty
        (``fit="trajectory"``), so that no noise is differentiated. Pair by pair: "elastic", dynamic time warping of
        tangents, positions and turning angles, "turning", of turning angles alone, or "cloud", points in any order, see
        `kineme.kernels.pair_distances`. They need positions over arc length beside them.
    arc_share : float, default 1.0
        The phase: 0 is time, 1 arc length, between them a blend; see `arc_length_phase`. Arc length is independent of
        timing; time distinguishes movements that differ in timing only. What is compared pair by pair takes arc length.
    n_points : int, default 100
        Samples along the phase.
    n_basis, stiffness, ridge
        Of the DMP; for "forcing" alone.
    weight : float, default 1.0
        Share in the average where no weights are given or fitted, relative to those of the others.
    detailed : bool, default False
        For what is compared pair by pair: in detail. The path is smoothed below four times as many cycles, and has
        twice as many segments (66) and more points (32); long movements, such as words, have more detail than ten
        cycles show. It is not rotated, since some movements differ by their direction alone, unless a `max_angle` or
        another prior than the default one says how movements are rotated.
    signal : bool, default True
        Compare movements of one dimension, which are signals, over time whatever `arc_share` says, by slopes where
        others have tangents, in detail with their rests. Turning angles and point clouds, which tell nothing of them,
        then have no weight of their own, elastic paths three times theirs, positions half of it. False describes them
        as paths, as libraries of earlier versions do.

    Raises
    ------
    SpecificationError
        A parameter out of its range; another phase than arc length for what is compared pair by pair, or `detailed`
        for what is not.
    """

    quantity: str
    arc_share: float = 1.0
    n_points: int = 100
    n_basis: int = 40
    stiffness: float = 100.0
    ridge: float = 1e-3
    weight: float = 1.0
    detailed: bool = False
    signal: bool = True

    def __post_init__(self) -> None:
        check_choice("quantity", self.quantity, QUANTITIES)
        check_number("arc_share", self.arc_share, least=0.0)
        if self.arc_share > 1:  # above 1 the phase could decrease
            raise SpecificationError(f"expected arc_share to be a share of at most 1, got {self.arc_share!r}")
        check_count("n_points", self.n_points, 2, most=MOST_POINTS)
        check_count("n_basis", self.n_basis, 3, most=MOST_BASIS)
        check_number("stiffness", self.stiffness, above=0.0)
        check_number("ridge", self.ridge, least=0.0)
        check_number("weight", self.weight, above=0.0)
        if self.in_pairs and self.arc_share != 1:
            raise SpecificationError(f"expected arc_share=1 with quantity={self.quantity!r}, got {self.arc_share!r}")
        check_switch("detailed", self.detailed)
        check_switch("signal", self.signal)
        if self.detailed and not self.in_pairs:
            raise SpecificationError(
                f"expected detailed=True with quantity elastic, turning or cloud, got it with {self.quantity!r}"
            )

    @property
    def in_pairs(self) -> bool:
        """True if movements are compared pair by pair, and not sample by sample."""
        return self.quantity in PAIR_QUANTITIES

    def own_weight(self, n_dims: int) -> float:
        """Return the weight, which is another one for signals: 0 for what tells nothing of them."""
        if n_dims > 1 or not self.signal or (self.detailed and self.quantity == "elastic"):
            return self.weight
        return _OF_SIGNALS[self.quantity] * self.weight

    @property
    def measure(self) -> int:
        """Number of what is compared pair by pair among the distances of pairs, those in detail last."""
        return PAIR_QUANTITIES.index(self.quantity) + len(PAIR_QUANTITIES) * self.detailed

    @property
    def name(self) -> str:
        """Name such as "forcing over arc length", "elastic path" or "elastic path in detail"."""
        if self.in_pairs:
            return PAIR_NAMES[self.quantity] + " in detail" * self.detailed
        phase = {0.0: "time", 1.0: "arc length"}.get(self.arc_share, f"{self.arc_share:g} arc length")
        return f"{self.quantity} over {phase}"

    def along(self, paths: Array) -> Array:
        """Return paths (n, d, T) at even values of the phase, (n, d, n_points)."""
        if self.arc_share == 0 or (self.signal and paths.shape[1] == 1):
            every, remainder = divmod(paths.shape[2] - 1, self.n_points - 1)
            return paths[:, :, ::every] if remainder == 0 else paths @ spline_matrix(paths.shape[2], self.n_points).T
        return resample_by_arc_length(paths, self.n_points, self.arc_share)

    def describe(self, paths: NDArray[Any], translation: bool = True) -> NDArray[Any]:
        """Return rows (n, d * n_points), dimension-major, of normalized paths (n, d, n_points) along the phase.

        For what is compared sample by sample; in the precision of the paths. Without `translation` the paths still have
        their position, and it is added to the forcing term: f itself does not depend on it, so that movements at other
        positions would be similar in that representation.
        """
        described = paths
        if self.quantity == "forcing":
            described = (paths.reshape(-1, self.n_points) @ forcing_operator(self, paths.dtype)).reshape(paths.shape)
            if not translation:
                described += paths.mean(axis=2, keepdims=True)
        return described.reshape(len(paths), -1)


#: What gives the rotation of a pair, and the points of which elastic paths and point clouds consist.
POSITIONS = Representation("positions", arc_share=1.0, weight=2.0)
#: Of what those in detail consist: positions from end to end of each segment.
DETAILED_POSITIONS = Representation("positions", arc_share=1.0, n_points=DETAILED_ELASTIC.n_segments + 1)
#: Representations that fail on different movements; in an average of kernels one that succeeds suffices. Those of the
#: whole shape count twice, those in detail six times. `python -m bench --only defaults` tells what each is worth.
DEFAULT_REPRESENTATIONS = (
    POSITIONS,
    Representation("forcing", arc_share=0.0),
    Representation("elastic", weight=2.0),
    Representation("turning"),
    Representation("cloud", weight=2.0),
    Representation("elastic", weight=6.0, detailed=True),
    Representation("cloud", weight=6.0, detailed=True),
)
#: Where position or size distinguishes movements: none of these takes it out by itself.
ROW_REPRESENTATIONS = (
    Representation("positions", arc_share=1.0),
    Representation("forcing", arc_share=1.0),
    Representation("forcing", arc_share=0.0),
)


def default_representations(normalization: Normalization) -> tuple[Representation, ...]:
    """Return those of a recognizer: of the whole shape, unless position or size distinguishes movements."""
    shape_alone = normalization.translation and normalization.scale != "none"
    return DEFAULT_REPRESENTATIONS if shape_alone else ROW_REPRESENTATIONS


def check_representations(representations: Any) -> tuple[Representation, ...]:
    """Refuse anything but one or several representations."""
    try:
        given = tuple(representations)
    except TypeError:
        given = ()
    if not given or not all(isinstance(item, Representation) for item in given):
        raise SpecificationError(
            "expected representations to be a tuple of kineme.similarity.specification.Representation, one or more, "
            f"or None for the default ones, got {representations!r}"
        )
    gives_rotation = any(item.quantity == "positions" and item.arc_share == 1 for item in given)
    if any(item.in_pairs for item in given) and not gives_rotation:
        raise SpecificationError(
            "expected Representation('positions', arc_share=1.0) beside those that are compared pair by pair, whose "
            "rotation it gives; add it"
        )
    in_pairs = [item for item in given if item.in_pairs]
    if in_pairs and len({item.signal for item in (*in_pairs, given[rotating(given)])}) > 1:
        raise SpecificationError(
            "expected one value of signal in positions over arc length and all that are compared pair by pair, which "
            "are made from these, got True and False; pass the same to each"
        )
    return tuple(sorted(given, key=lambda item: (item.in_pairs, item.detailed)))  # the order within each sort stays


def rotating(representations: tuple[Representation, ...]) -> int:
    """Find the one that gives the rotation to those compared pair by pair: the first of positions over arc length."""
    return next(r for r, item in enumerate(representations) if item.quantity == "positions" and item.arc_share == 1)


@lru_cache(maxsize=32)
def forcing_operator(representation: Representation, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return the matrix (T, T) from positions to f at as many points: subtract the start, encode, apply Eq. (2)."""
    dmp = DMP(
        "bio-inspired",
        n_basis=representation.n_basis,
        stiffness=representation.stiffness,
        fit="trajectory",
        ridge=representation.ridge,
        n_points=representation.n_points,
    )
    operator = encoder(dmp, representation.n_points).weights @ forcing_matrix(dmp, representation.n_points).T / dmp.K
    operator[0] -= operator.sum(axis=0)  # (x - x0) E = x E - x0 (sum of the rows of E)
    operator = operator.astype(dtype, copy=False)
    operator.setflags(write=False)
    return operator


@dataclass(frozen=True)
class Normalization:
    """Translation and scale; rotation belongs to the comparison, see `kernels.procrustes.Procrustes`.

    - `translation`: remove the position. Movements that differ only in their position become equal.
    - `scale` ({"path", "per-dimension", "none"}, default "path"): "path" divides by the root mean square distance from
      the center, one number for all dimensions: a dot and a circle become equal. "per-dimension" divides each dimension
      by its own: a circle and an ellipse become equal too. "none" keeps the size, which must be 1e-15 to 1e15 in the
      unit of the data: movements are compared in single precision, where squares of other sizes overflow or underflow.
    """

    translation: bool = True
    scale: str = "path"

    def __post_init__(self) -> None:
        check_switch("translation", self.translation)
        check_choice("scale", self.scale, SCALES)

    def apply(self, paths: Array, dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """Return paths (n, d, T) minus their center, divided by their size, as `dtype`."""
        if self.translation and self.scale != "none" and use_compiled(_OPERATIONS_PER_SAMPLE * paths.size):
            least = _FLAT if self.scale == "per-dimension" else math.inf
            normalized = np.empty(paths.shape, dtype)
            compiled_module("kineme.similarity._compiled").fill_normalized(paths, least, normalized)
            return normalized
        return self._apply(paths).astype(dtype, copy=False)

    def _apply(self, paths: Array) -> Array:
        centered = paths - self.center(paths)
        if self.scale == "none":
            _check_size(centered)
            return np.asarray(centered)
        squares = np.einsum("ijk,ijk->ij", centered, centered)[:, :, None] / paths.shape[2]
        centered /= self._size(squares if self.translation else paths.var(axis=2, keepdims=True))
        return np.asarray(centered)

    def center(self, paths: Array) -> Array:
        """Return the center of each path (n, d, T), shape (n, d, 1): its mean position along the phase."""
        return paths.mean(axis=2, keepdims=True) if self.translation else np.zeros((*paths.shape[:2], 1))

    def size(self, paths: Array) -> Array:
        """Return the size of each path (n, d, T), shape (n, 1, 1) or (n, d, 1); 1 for a path that does not move."""
        if self.scale == "none":
            return np.ones((len(paths), 1, 1))
        return self._size(paths.var(axis=2, keepdims=True))

    def _size(self, squares: Array) -> Array:
        """Return the size from the variance in each dimension, (n, d, 1)."""
        total = np.sqrt(squares.sum(axis=1, keepdims=True))
        total[total == 0] = 1.0
        if self.scale == "path":
            return np.asarray(total)
        own = np.sqrt(squares)
        return np.where(own > _FLAT * total, own, total)


def _check_size(paths: Array) -> None:
    """Refuse paths (n, d, T) that keep a size of which single precision makes zero or infinity."""
    sizes = np.abs(paths).max(axis=(1, 2), initial=0.0)
    wrong = (sizes > LARGEST) | ((sizes > 0) & (sizes < SMALLEST))
    if wrong.any():
        raise TrajectoryError(
            f'expected movements of {SMALLEST:g} to {LARGEST:g} in their unit with scale="none", got '
            f"{sizes[wrong][0]:.3g}; choose another unit, or another scale"
        )


def _log_mean_exp(logs: Array) -> Array:
    top = logs.max(axis=0)
    return np.asarray(np.log(np.mean(np.exp(logs - top), axis=0)) + top)


#: Name -> A-average (paper's reference [10]) of kernels given by their logarithms, over the first axis.
LOG_MEANS: dict[str, Callable[[Array], Array]] = {
    "arithmetic": _log_mean_exp,
    "geometric": lambda logs: np.asarray(logs.mean(axis=0)),
    "harmonic": lambda logs: -_log_mean_exp(-logs),
    "quadratic": lambda logs: 0.5 * _log_mean_exp(2.0 * logs),
    "min": lambda logs: np.asarray(logs.min(axis=0)),
}


def softmax(logs: Array, axis: int = 0) -> Array:
    """Return shares along an axis, in proportion to ``exp(logs)``."""
    weights = np.exp(logs - logs.max(axis=axis, keepdims=True))
    return np.asarray(weights / weights.sum(axis=axis, keepdims=True))


#: Name -> share of each kernel in the average, d log K / d log k_r: none negative, their sum over the first axis 1.
SHARES: dict[str, Callable[[Array], Array]] = {
    "arithmetic": softmax,
    "geometric": lambda logs: np.full(logs.shape, 1.0 / len(logs)),
    "harmonic": lambda logs: softmax(-logs),
    "quadratic": lambda logs: softmax(2.0 * logs),
    "min": lambda logs: (np.arange(len(logs))[:, None] == logs.argmin(axis=0)).astype(float),
}


@dataclass(frozen=True)
class ComparisonSpecification:
    """Representations, invariances, smoothing and average.

    Kernel widths and weights are estimated from movements, see `Comparison`.

    - `representations`: those compared sample by sample first. By default positions over arc length, forcing term over
      time, elastic path, turning angles, and point cloud; elastic path and point cloud once more, in detail.
    - `cutoff`: movements are smoothed below this many cycles each, see `Smooth`; None for recordings without noise.
    - `max_angle`: largest rotation [rad] between movements of one class, instead of the prior; 0 for none.
    - `points`: how many points in the plane or in space the columns are, one after the other; they turn together.
    - `prior`: how rare rotations are, in two and three dimensions, if there is no `max_angle`. None is a limit of pi/3.

    Raises `SpecificationError`: a parameter out of its range, or `max_angle` and a prior that is not the default.
    """

    representations: tuple[Representation, ...] = DEFAULT_REPRESENTATIONS
    normalization: Normalization = field(default_factory=Normalization)  # the normalization of translation and size
    cutoff: float | None = 10.0
    max_angle: float | None = None
    mean: str = "arithmetic"  # the A-average over representations
    prior: RotationPrior | None = field(default_factory=RotationPrior)
    points: int | None = None  # J points that turn together; None: those that channels name, see `with_points`

    def __post_init__(self) -> None:
        if isinstance(self.points, (str, list, tuple)):
            raise SpecificationError(
                f"expected points to be a number, got {self.points!r}; leave it out where columns have these names, as "
                "left_hand_x: names tell the points by themselves"
            )
        if self.points is not None:
            check_count("points", self.points, 1)
        check_choice("mean", self.mean, list(LOG_MEANS))
        if self.cutoff is not None:
            Smooth(self.cutoff)  # checks its own parameter
        object.__setattr__(self, "representations", check_representations(self.representations))
        if self.max_angle is not None:
            check_number("max_angle", self.max_angle, least=0.0)
        if self.prior is not None and not isinstance(self.prior, RotationPrior):
            raise SpecificationError(
                f"expected rotation_prior to be a kineme.recognition.RotationPrior or None, got {self.prior!r}; write "
                "kineme.recognition.RotationPrior(concentration=0.03)"
            )
        if self.max_angle is not None and self.prior not in (None, RotationPrior()):
            raise SpecificationError(
                f"expected max_angle or rotation_prior, got max_angle={self.max_angle!r} and {self.prior}; leave one "
                "out: under a prior, a large rotation costs similarity and none is forbidden"
            )

    @cached_property
    def by_rows(self) -> tuple[Representation, ...]:
        """The representations that are compared sample by sample; they come first."""
        return tuple(representation for representation in self.representations if not representation.in_pairs)

    @cached_property
    def by_pairs(self) -> tuple[Representation, ...]:
        """The representations that are compared pair by pair."""
        return self.representations[len(self.by_rows) :]

    @cached_property
    def stored_rows(self) -> tuple[Representation, ...]:
        """What feature rows hold: representations compared sample by sample, then positions in detail, if needed."""
        return (*self.by_rows, self.detailed_positions) if self.detailed else self.by_rows

    @property
    def detailed_positions(self) -> Representation:
        """The positions that are compared pair by pair in detail."""
        return replace(DETAILED_POSITIONS, signal=self.representations[rotating(self.representations)].signal)

    @cached_property
    def detailed(self) -> bool:
        """True if movements are compared in detail, too."""
        return any(representation.detailed for representation in self.representations)

    def are_signals(self, n_dims: int) -> bool:
        """Return True if movements of so many dimensions are compared pair by pair as signals, over time."""
        return n_dims == 1 and bool(self.by_pairs) and self.representations[rotating(self.representations)].signal

    @property
    def upright(self) -> bool:
        """True if what is compared in detail is not rotated: where nothing says how movements are rotated."""
        return self.max_angle is None and self.prior == RotationPrior()

    @property
    def detailed_cutoff(self) -> float | None:
        """Cycles below which what is compared in detail is smoothed; None for not at all."""
        return None if self.cutoff is None else DETAIL * self.cutoff

    @property
    def specification(self) -> ComparisonSpecification:
        """The specification itself."""
        return self

    def procrustes(self, n_dims: int) -> Procrustes:
        """Return the distance between rows of movements of `n_dims` dimensions."""
        n_points = self.points or 1
        if n_points > 1 and n_dims not in (2 * n_points, 3 * n_points):
            raise SpecificationError(
                f"expected {2 * n_points} or {3 * n_points} columns, those of points={n_points} in the plane or in "
                f"space, got {n_dims}; leave points out, or select the columns"
            )
        d = n_dims // n_points
        if self.max_angle is not None and 0 <= self.max_angle - math.pi <= 1e-12 and d in (2, 3):
            return Procrustes(d, math.pi, RotationPrior(0.0), n_points)  # no limit: the fast way
        if self.max_angle is not None:
            return Procrustes(d, float(self.max_angle), None, n_points)
        if d not in (2, 3):
            return Procrustes(d, 0.0)
        return Procrustes(d, math.pi / 3 if self.prior is None else math.pi, self.prior, n_points)

    def with_points(self, channels: Channels | None) -> ComparisonSpecification:
        """Return the specification with the number of points, which are told by the names of columns if at all.

        Warns `UserWarning`: names say another number of points, or columns of points that are not one after the other.
        """
        names = point_names(channels)
        if self.points is None and (apart := points_apart(channels)):
            message = "columns name points, but not one after the other, and are compared as none: order them as"
            warn(f"{message} {listed(apart)}", UserWarning, 3)
        if self.points not in (None, 1) and names and len(names) != self.points:
            said = f"{len(names)} points, and {self.points} are compared, as points={self.points} says"
            warn(f"names of columns say {said}", UserWarning, 3)
        return self if self.points is not None else replace(self, points=len(names) or 1)


class Compares(Protocol):
    """An object with the specification of a comparison: a specification itself, a `Comparison`, a recognizer."""

    @property
    def specification(self) -> ComparisonSpecification:
        """Specification of the comparison."""
        ...


def specification_of(like: Compares | None) -> ComparisonSpecification:
    """Return the specification that `like` is or has; the default one for None.

    Raises `SpecificationError`: `like` has none, or one with a parameter out of its range.
    """
    specification = ComparisonSpecification() if like is None else getattr(like, "specification", None)
    if not isinstance(specification, ComparisonSpecification):
        raise SpecificationError(
            f"expected like to be a kineme.Recognizer, a Comparison, a ComparisonSpecification or None, got {like!r}"
        )
    return specification
