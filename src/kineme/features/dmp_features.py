"""From trajectories to the feature vector of Eq. (9), as a scikit-learn transformer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from kineme.errors import TrajectoryError
from kineme.primitives.dmp import DMP
from kineme.primitives.primitives import Primitives
from kineme.rhythm.primitives import RhythmicPrimitives
from kineme.trajectories.axes import axis_names
from kineme.trajectories.demonstrations import Demonstrations
from kineme.validation import check_choice, check_count

#: Feature name -> (primitives, S) -> array (n, size, d).
FEATURES: dict[str, Callable[[Primitives | RhythmicPrimitives, int], NDArray[Any]]] = {
    "shape-attractor": lambda primitives, n_samples: primitives.shape_attractor(n_samples),
    "forcing": lambda primitives, n_samples: primitives.forcing(n_samples),
    "weights": lambda primitives, _: primitives.weights,
}


class DMPFeatures(TransformerMixin, BaseEstimator):
    """Describe each movement by its DMP: rows ``x_1 ... x_S, y_1 ... y_S``, Eq. (9).

    Parameters
    ----------
    feature : {"shape-attractor", "forcing", "weights"}, default "shape-attractor"
        The shape-attractor term of the equation, the forcing term f, or the weights w; see
        `Primitives.shape_attractor`, `Primitives.forcing`, `Primitives.weights`.
    formulation, n_basis, stiffness, damping, gating, regression, ridge, phase_end, overlap, n_points, preprocessing
        The specification of the DMP; see `DMP`.
    n_samples : int, default 100
        Samples S of the shape-attractor and of f. Weights have n_basis instead.
    fit_to : {"forcing", "trajectory"}, default "forcing"
        The `fit` of `DMP`; a scikit-learn estimator has a method of that name.
    dtype : {"float64", "float32"}, default "float64"
        Of the result; kernels compute in the type they are given.

    Attributes
    ----------
    dmp_ : DMP
        The specification in force.
    n_dims_ : int
        Dimensions d of the training movements.

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

    def __init__(  # noqa: PLR0913, PLR0917 - one parameter per choice, as scikit-learn's searches need them
        self,
        feature: str = "shape-attractor",
        formulation: str = "bio-inspired",
        n_basis: int = 80,
        n_samples: int = 100,
        stiffness: float = 100.0,
        damping: float | None = None,
        gating: str = "none",
        fit_to: str = "forcing",
        regression: str = "local",
        ridge: float | None = None,
        phase_end: float = 0.01,
        overlap: float = 0.3,
        n_points: int = 200,
        preprocessing: tuple[Any, ...] = (),
        dtype: str = "float64",
    ) -> None:
        self.feature = feature
        self.formulation = formulation
        self.n_basis = n_basis
        self.n_samples = n_samples
        self.stiffness = stiffness
        self.damping = damping
        self.gating = gating
        self.fit_to = fit_to
        self.regression = regression
        self.ridge = ridge
        self.phase_end = phase_end
        self.overlap = overlap
        self.n_points = n_points
        self.preprocessing = preprocessing
        self.dtype = dtype

    def fit(self, X: Any, y: Any = None) -> Self:
        """Check the parameters and remember the dimensions of the movements; nothing is learned from y."""
        check_choice("feature", self.feature, list(FEATURES))
        check_count("n_samples", self.n_samples, 2)
        check_choice("dtype", self.dtype, ("float64", "float32"))
        shared = {field.name for field in fields(DMP)} - {"fit"}
        self.dmp_ = DMP(fit=self.fit_to, **{name: getattr(self, name) for name in shared})
        self.n_dims_ = Demonstrations.of(X).n_dims
        return self

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


def features_of(primitives: Primitives | RhythmicPrimitives, feature: str, n_samples: int) -> NDArray[Any]:
    """Feature rows (n, d * size) of learned primitives, dimension-major as in Eq. (9)."""
    by_time = FEATURES[feature](primitives, n_samples)
    return by_time.transpose(0, 2, 1).reshape(len(primitives), -1)
