"""Base class of the transformers from movements to features."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.utils.validation import check_is_fitted

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.pose.tangent import as_poses, to_tangent
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicDMP, RhythmicPrimitives
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channels, is_plain, learned_names
from kineme.movements.trajectories.as_learned import as_learned
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import axis_names, in_coordinates
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import check_choice, check_count, check_number

#: Feature name -> (primitives, S) -> array (n, size, d).
FEATURES: dict[str, Callable[[Primitives | RhythmicPrimitives, int], NDArray[Any]]] = {
    "shape-attractor": lambda primitives, n_samples: primitives.shape_attractor(n_samples),
    "forcing": lambda primitives, n_samples: primitives.forcing(n_samples),
    "weights": lambda primitives, _: primitives.weights,
}
_NESTED, _FEATURES = "dmp__", "features__"

Specification = TypeVar("Specification", DMP, RhythmicDMP)


def features_of(primitives: Primitives | RhythmicPrimitives, feature: str, n_samples: int) -> NDArray[Any]:
    """Feature rows (n, d * size) of learned primitives, dimension-major as in Eq. (9)."""
    by_time = FEATURES[feature](primitives, n_samples)
    return by_time.transpose(0, 2, 1).reshape(len(primitives), -1)


class _TakesMovements(TransformerMixin, BaseEstimator):
    """A transformer of movements, no rows of numbers."""

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.input_tags.three_d_array = True
        return tags


class MovementFeatures(_TakesMovements, Generic[Specification]):
    """Base of transformers that learn one primitive per movement and describe it by one feature.

    The fields of `dmp` are parameters, too, as ``dmp__n_basis``: `set_params` replaces the specification.
    """

    _specification_type: ClassVar[type]  # of the specification
    dmp_: Specification
    n_dims_: int
    channels_: Channels | None

    def __init__(
        self,
        feature: str = "shape-attractor",
        dmp: Specification | None = None,
        *,
        n_samples: int = 100,
        dtype: str = "float64",
        **fields_of_dmp: Any,
    ) -> None:
        self.feature = feature
        self.dmp: Specification | None = dmp
        self.n_samples = n_samples
        self.dtype = dtype
        if fields_of_dmp:
            nested, unknown = self._nested(fields_of_dmp)
            if unknown:
                raise TypeError(
                    f"{type(self).__name__} has no parameter {', '.join(map(repr, unknown))}; those of the primitive "
                    f"are set by dmp=kineme.{self._specification_type.__name__}(...), or as {_NESTED}n_basis"
                )
            self.dmp = replace(self._specification(), **nested)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Parameters by name; with `deep` also the fields of `dmp`, as ``dmp__n_basis`` and so on."""
        parameters = super().get_params(deep=False)
        if deep:
            dmp = self._specification()
            parameters |= {_NESTED + field.name: getattr(dmp, field.name) for field in fields(self._specification_type)}
        return parameters

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters by name; ``dmp__n_basis`` and so on replace a field of `dmp`.

        Raises `ValueError`: a name that is no parameter. Raises `SpecificationError`: a value out of the range of a
        field.
        """
        nested, others = self._nested(parameters)
        super().set_params(**others)
        if nested:
            self.dmp = replace(self._specification(), **nested)
        return self

    def fit(self, X: MovementsLike, y: Any = None) -> Self:
        """Check the parameters and store what the dimensions are; y is ignored."""
        check_choice("feature", self.feature, list(FEATURES))
        check_count("n_samples", self.n_samples, 2)
        check_choice("dtype", self.dtype, ("float64", "float32"))
        self.feature_, self.n_samples_, self.dtype_ = self.feature, self.n_samples, self.dtype
        self.dmp_ = self._specification()
        demonstrations = Demonstrations.of(X)
        self.channels_ = demonstrations.channels
        self.n_dims_ = in_coordinates(demonstrations.movements).positions.shape[1]
        return self

    def transform(self, X: MovementsLike) -> NDArray[Any]:
        """Features of movements, shape (n, d * S), or (n, d * N) for weights.

        Columns that are known are put in the order and converted to the units of those of `fit`.

        Raises `TrajectoryError`: movements that cannot be used, or of other dimensions than those of `fit`. Raises
        `DegenerateMovementError`: weights or forcing in the original formulation where ``g = x0``.
        """
        check_is_fitted(self)
        demonstrations = as_learned(X, self.channels_, self.n_dims_)
        rows = features_of(self.dmp_.learn(demonstrations), self.feature_, self.n_samples_)
        return rows.astype(self.dtype_, copy=False)

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[Any]:
        """Names x_1 ... x_S, y_1 ... y_S; beyond three dimensions q1_1 ... q1_S, q2_1 ..."""
        check_is_fitted(self)
        size = self.dmp_.n_basis if self.feature_ == "weights" else self.n_samples_
        names = [f"{axis}_{k + 1}" for axis in axis_names(self.n_dims_) for k in range(size)]
        return np.array(names, dtype=object)

    def _specification(self) -> Specification:
        dmp = self._specification_type() if self.dmp is None else self.dmp
        if not isinstance(dmp, self._specification_type):
            name = self._specification_type.__name__
            raise SpecificationError(
                f"expected dmp to be a kineme.{name}, got {dmp!r}; write {type(self).__name__}(dmp=kineme.{name}())"
            )
        return dmp  # type: ignore[return-value]

    def _nested(self, parameters: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Split into fields of the specification, by their names there, and all other parameters."""
        names = [field.name for field in fields(self._specification_type)]
        nested = {key.removeprefix(_NESTED): value for key, value in parameters.items() if key.startswith(_NESTED)}
        others = {key: value for key, value in parameters.items() if not key.startswith(_NESTED)}
        if unknown := [name for name in nested if name not in names]:
            raise ValueError(
                f"{self._specification_type.__name__} has no parameter {', '.join(map(repr, unknown))}; it has {names}"
            )
        return nested, others


class DMPFeatures(MovementFeatures[DMP]):
    """Describe each movement by its DMP: rows ``x_1 ... x_S, y_1 ... y_S``, Eq. (9).

    Parameters
    ----------
    feature : {"shape-attractor", "forcing", "weights"}, default "shape-attractor"
        The shape-attractor term of the equation, the forcing term f, or the weights w; see
        `Primitives.shape_attractor`, `Primitives.forcing`, `Primitives.weights`.
    dmp : DMP, default DMP()
        How the movements are learned. Its fields are searched as ``dmp__n_basis`` and so on.
    n_samples : int, default 100
        Samples S of the shape-attractor and of f. Weights have ``dmp.n_basis`` instead.
    dtype : {"float64", "float32"}, default "float64"
        Type of the result; kernels compute in the type of their input.

    Attributes
    ----------
    dmp_ : DMP
        The specification in force.
    feature_, n_samples_, dtype_
        The parameters in force, those of `fit`.
    n_dims_ : int
        Dimensions d of the training movements.
    channels_ : tuple of Channel or None
        What they are, where that is known.

    Examples
    --------
    >>> import kineme
    >>> from sklearn.model_selection import cross_val_score
    >>> from sklearn.neighbors import KNeighborsClassifier
    >>> from sklearn.pipeline import make_pipeline
    >>> demos = kineme.load_lasa(kineme.datasets.PAPER_LETTERS)
    >>> model = make_pipeline(kineme.DMPFeatures("shape-attractor"), KNeighborsClassifier(1))
    >>> float(cross_val_score(model, demos, demos.labels).mean())
    1.0
    """

    _specification_type: ClassVar[type] = DMP


class RhythmicFeatures(MovementFeatures[RhythmicDMP]):
    """Describe each recording by its rhythmic DMP: features of one cycle, wherever it started, rows as in Eq. (9).

    Parameters
    ----------
    feature : {"shape-attractor", "forcing", "weights"}, default "shape-attractor"
        ``r f``, which depends on the amplitude; f or w, which do not. None of them depends on translation and tempo.
    dmp : RhythmicDMP, default RhythmicDMP()
        How the recordings are learned. Its fields are searched as ``dmp__n_basis`` and so on.
    n_samples : int, default 100
        Samples S of a cycle. Weights have ``dmp.n_basis`` instead.
    dtype : {"float64", "float32"}, default "float64"
        Type of the result.

    Attributes
    ----------
    dmp_ : RhythmicDMP
        The specification in force. Unless `align_on` is given, it is the dimension with the largest first harmonic in
        most training recordings, one for all: otherwise it could change between recordings with two similar dimensions.
    feature_, n_samples_, dtype_
        The parameters in force, those of `fit`.
    n_dims_ : int
        Dimensions d of the training movements.
    channels_ : tuple of Channel or None
        What they are, where that is known.
    """

    _specification_type: ClassVar[type] = RhythmicDMP

    def fit(self, X: MovementsLike, y: Any = None) -> Self:
        """Check the parameters and choose the dimension to align on; y is ignored.

        Raises `TrajectoryError`: recordings that cannot be used; see `RhythmicDMP.learn`.
        """
        super().fit(demonstrations := Demonstrations.of(X))
        if self.dmp_.align_on is None:
            aligned_on = self.dmp_.learn(demonstrations).aligned_on
            self.dmp_ = replace(self.dmp_, align_on=int(np.bincount(aligned_on).argmax()))
        return self


class PoseFeatures(_TakesMovements):
    """Describe movements of an orientation, or of a position and an orientation, by their DMPs.

    The features of `DMPFeatures` on the rotation vector from the goal; see `PoseDMP`.

    Parameters
    ----------
    features : DMPFeatures, optional
        What to compute; by default ``DMPFeatures()``. Its parameters are searched as ``features__n_samples``,
        ``features__dmp__n_basis`` and so on.
    orientation_weight : float, default 0.2
        Weight of a radian beside the positions, in their unit per radian. With 0.2 m, about the length of a hand or a
        tool, a rotation counts as much as the displacement of the tip. Positions in millimeters need 200.

    Attributes
    ----------
    features_ : DMPFeatures
        The fitted transformer behind it.
    orientation_weight_ : float
        The weight in force, that of `fit`.
    n_columns_ : int
        4 for orientations, 7 for poses.
    channels_ : tuple of Channel or None
        What the columns are, where one of them is known to be an orientation.

    Notes
    -----
    Unchanged by the sign of any quaternion, by the tempo, and by a fixed quaternion from the right (a tool mounted
    differently). A fixed quaternion from the left (the scene turned) rotates the three orientation rows of
    the bio-inspired features like a vector, as it does the three position rows. In the original formulation the
    weights and f are relative to g - x0, so that `orientation_weight` cancels in them.
    """

    def __init__(self, features: DMPFeatures | None = None, orientation_weight: float = 0.2) -> None:
        self.features = features
        self.orientation_weight = orientation_weight

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Parameters by name; with `deep` also those of `features`, as ``features__n_samples`` and so on."""
        parameters = super().get_params(deep)
        if deep and self.features is None:
            parameters |= {_FEATURES + name: value for name, value in DMPFeatures().get_params().items()}
        return parameters

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters by name; ``features__n_samples`` and so on set those of `features`, which are made if need be.

        Raises `ValueError`: a name that is no parameter. Raises `SpecificationError`: a value out of the range of a
        field.
        """
        if parameters.get("features", self.features) is None and any(name.startswith(_FEATURES) for name in parameters):
            parameters["features"] = DMPFeatures()
        return super().set_params(**parameters)

    def fit(self, X: MovementsLike, y: Any = None) -> Self:
        """Check the parameters and the movements; y is ignored."""
        check_number("orientation_weight", self.orientation_weight, above=0.0)
        self.orientation_weight_ = float(self.orientation_weight)
        self.features_ = DMPFeatures() if self.features is None else clone(self.features)
        given = Demonstrations.of(X)
        self.channels_ = None if given.channels is None or is_plain(given.channels) else given.channels
        demonstrations = as_poses(given)
        self.n_columns_ = demonstrations.n_dims
        self.steps_ = tuple(self.features_.get_params()["dmp__preprocessing"])
        self.features_.set_params(dmp__preprocessing=())  # applied in to_tangent, before the goal is read
        self.features_.fit(self._tangent(demonstrations))
        return self

    def transform(self, X: MovementsLike) -> NDArray[Any]:
        """Features of movements, shape (n, d * S) with d = 3 (orientations) or 6 (poses); see `DMPFeatures`.

        Raises `TrajectoryError`: movements that cannot be used, or orientations where `fit` saw poses.
        """
        check_is_fitted(self)
        known = X if self.channels_ is None else as_learned(X, self.channels_, len(learned_names(self.channels_)))
        demonstrations = as_poses(known)
        if demonstrations.n_dims != self.n_columns_:
            raise TrajectoryError(
                f"expected movements of {self.n_columns_} columns as in fit, got {demonstrations.n_dims}; fit again"
            )
        return self.features_.transform(self._tangent(demonstrations))

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[Any]:
        """Names rx_1 ... rx_S, ry_1 ... rz_S of the rotation vector, for poses after x_1 ... z_S."""
        check_is_fitted(self)
        axes = ("rx", "ry", "rz") if self.n_columns_ == 4 else ("x", "y", "z", "rx", "ry", "rz")
        size = len(self.features_.get_feature_names_out()) // len(axes)
        return np.array([f"{axis}_{k + 1}" for axis in axes for k in range(size)], dtype=object)

    def _tangent(self, demonstrations: Demonstrations) -> Demonstrations:
        tangent, _ = to_tangent(demonstrations, self.steps_)
        if tangent.n_dims == 3:
            return tangent
        weights = np.repeat([1.0, self.orientation_weight_], 3)
        weighted = replace(tangent.movements, positions=tangent.positions * weights)
        return Demonstrations.of_movements(weighted, tangent.steps)
