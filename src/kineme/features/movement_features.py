"""Base class of the transformers from movements to features."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicDMP, RhythmicPrimitives
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import axis_names
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import check_choice, check_count

#: Feature name -> (primitives, S) -> array (n, size, d).
FEATURES: dict[str, Callable[[Primitives | RhythmicPrimitives, int], NDArray[Any]]] = {
    "shape-attractor": lambda primitives, n_samples: primitives.shape_attractor(n_samples),
    "forcing": lambda primitives, n_samples: primitives.forcing(n_samples),
    "weights": lambda primitives, _: primitives.weights,
}
_NESTED = "dmp__"

Specification = TypeVar("Specification", DMP, RhythmicDMP)


def features_of(primitives: Primitives | RhythmicPrimitives, feature: str, n_samples: int) -> NDArray[Any]:
    """Feature rows (n, d * size) of learned primitives, dimension-major as in Eq. (9)."""
    by_time = FEATURES[feature](primitives, n_samples)
    return by_time.transpose(0, 2, 1).reshape(len(primitives), -1)


class MovementFeatures(TransformerMixin, BaseEstimator, Generic[Specification]):
    """Base of transformers that learn one primitive per movement and describe it by one feature.

    The fields of `dmp` are parameters of the transformer too, as ``dmp__n_basis`` and so on: `set_params` replaces
    the specification, which is itself never changed.
    """

    _specification_type: ClassVar[type]  # of the specification
    dmp_: Specification
    n_dims_: int

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

        Raises
        ------
        ValueError
            A name that is no parameter.
        SpecificationError
            A value out of the range of a field.
        """
        nested, others = self._nested(parameters)
        super().set_params(**others)
        if nested:
            self.dmp = replace(self._specification(), **nested)
        return self

    def transform(self, X: MovementsLike) -> NDArray[Any]:
        """Features of movements, shape (n, d * S), or (n, d * N) for weights.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used, or of other dimensions than those of `fit`.
        DegenerateMovementError
            Weights or forcing in the original formulation where ``g = x0``.
        """
        check_is_fitted(self)
        demonstrations = Demonstrations.of(X)
        if demonstrations.n_dims != self.n_dims_:
            raise TrajectoryError(
                f"expected movements of {self.n_dims_} dimensions as in fit, got {demonstrations.n_dims}; "
                "fit again, or select the dimensions by columns= of read_recordings, in the shell --columns"
            )
        return features_of(self.dmp_.learn(demonstrations), self.feature, self.n_samples).astype(self.dtype, copy=False)

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[Any]:
        """Names x_1 ... x_S, y_1 ... y_S; beyond three dimensions q1_1 ... q1_S, q2_1 ..."""
        check_is_fitted(self)
        size = self.dmp_.n_basis if self.feature == "weights" else self.n_samples
        names = [f"{axis}_{k + 1}" for axis in axis_names(self.n_dims_) for k in range(size)]
        return np.array(names, dtype=object)

    def _checked(self) -> Specification:
        """The specification, after a check of all other parameters."""
        check_choice("feature", self.feature, list(FEATURES))
        check_count("n_samples", self.n_samples, 2)
        check_choice("dtype", self.dtype, ("float64", "float32"))
        return self._specification()

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

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.input_tags.three_d_array = True
        return tags
