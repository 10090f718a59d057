"""Base class of the transformers from movements to features."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from kineme.errors import TrajectoryError
from kineme.features.rows import FEATURES, features_of
from kineme.movements.trajectories.axes import axis_names
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import check_choice, check_count


class MovementFeatures(TransformerMixin, BaseEstimator):
    """Base of transformers that learn one primitive per movement and describe it by one feature.

    A subclass has the parameters `feature`, `n_samples` and `dtype`; its `fit` sets `dmp_` and `n_dims_`.
    """

    feature: str
    n_samples: int
    dtype: str
    dmp_: Any
    n_dims_: int

    def _check_parameters(self) -> None:
        check_choice("feature", self.feature, list(FEATURES))
        check_count("n_samples", self.n_samples, 2)
        check_choice("dtype", self.dtype, ("float64", "float32"))

    def transform(self, X: Any) -> NDArray[Any]:
        """Features of movements, shape (n, d * S), or (n, d * N) for weights.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used, or of other dimensions than those of `fit`.
        DegenerateMovementError
            Weights or forcing in the original formulation where g = x0.
        """
        check_is_fitted(self)
        demonstrations = Demonstrations.of(X)
        if demonstrations.n_dims != self.n_dims_:
            raise TrajectoryError(
                f"expected movements of {self.n_dims_} dimensions as in fit, got {demonstrations.n_dims}; "
                "fit again, or select the dimensions"
            )
        return features_of(self.dmp_.learn(demonstrations), self.feature, self.n_samples).astype(self.dtype, copy=False)

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[Any]:
        """Names x_1 ... x_S, y_1 ... y_S; beyond three dimensions q1_1 ... q1_S, q2_1 ..."""
        check_is_fitted(self)
        size = self.dmp_.n_basis if self.feature == "weights" else self.n_samples
        names = [f"{axis}_{k + 1}" for axis in axis_names(self.n_dims_) for k in range(size)]
        return np.array(names, dtype=object)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.input_tags.three_d_array = True
        return tags
