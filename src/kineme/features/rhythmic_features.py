"""From rhythmic recordings to feature rows, as a scikit-learn transformer."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from kineme.errors import TrajectoryError
from kineme.features.dmp_features import FEATURES, features_of
from kineme.rhythm.rhythmic_dmp import RhythmicDMP
from kineme.trajectories.axes import axis_names
from kineme.trajectories.demonstrations import Demonstrations
from kineme.validation import check_choice, check_count


class RhythmicFeatures(TransformerMixin, BaseEstimator):
    """Describe each recording by its rhythmic DMP: one cycle, whatever part of it came first, rows as in Eq. (9).

    Parameters
    ----------
    feature : {"shape-attractor", "forcing", "weights"}, default "shape-attractor"
        ``r f``, which knows the amplitude; f or w, which do not. None of them knows place and tempo.
    n_basis, stiffness, damping, ridge, n_points, overlap, period, align_on, aperiodic, preprocessing
        The specification; see `RhythmicDMP`.
    n_samples : int, default 100
        Samples S of a cycle. Weights have n_basis instead.
    fit_to : {"forcing", "trajectory"}, default "trajectory"
        The `fit` of `RhythmicDMP`.
    dtype : {"float64", "float32"}, default "float64"
        Of the result.

    Attributes
    ----------
    dmp_ : RhythmicDMP
        The specification in force. Unless `align_on` is given, it names the dimension with the largest first harmonic
        in most training recordings: two dimensions that are nearly alike must not take turns.
    n_dims_ : int
        Dimensions d of the training movements.
    """

    def __init__(  # noqa: PLR0913, PLR0917 - one parameter per choice, as scikit-learn's searches need them
        self,
        feature: str = "shape-attractor",
        n_basis: int = 25,
        n_samples: int = 100,
        stiffness: float = 100.0,
        damping: float | None = None,
        fit_to: str = "trajectory",
        ridge: float | None = None,
        n_points: int = 200,
        overlap: float = 0.5,
        period: float | None = None,
        align_on: int | None = None,
        aperiodic: str = "raise",
        preprocessing: tuple[Any, ...] = (),
        dtype: str = "float64",
    ) -> None:
        self.feature = feature
        self.n_basis = n_basis
        self.n_samples = n_samples
        self.stiffness = stiffness
        self.damping = damping
        self.fit_to = fit_to
        self.ridge = ridge
        self.n_points = n_points
        self.overlap = overlap
        self.period = period
        self.align_on = align_on
        self.aperiodic = aperiodic
        self.preprocessing = preprocessing
        self.dtype = dtype

    def fit(self, X: Any, y: Any = None) -> Self:
        """Check the parameters and choose the dimension to align on; nothing is learned from y.

        Raises
        ------
        TrajectoryError
            Recordings that cannot be used; see `RhythmicDMP.learn`.
        """
        check_choice("feature", self.feature, list(FEATURES))
        check_count("n_samples", self.n_samples, 2)
        check_choice("dtype", self.dtype, ("float64", "float32"))
        shared = {field.name for field in fields(RhythmicDMP)} - {"fit"}
        dmp = RhythmicDMP(fit=self.fit_to, **{name: getattr(self, name) for name in shared})
        demonstrations = Demonstrations.of(X)
        if dmp.align_on is None:
            aligned_on = dmp.learn(demonstrations).aligned_on
            dmp = replace(dmp, align_on=int(np.bincount(aligned_on).argmax()))
        self.dmp_ = dmp
        self.n_dims_ = demonstrations.n_dims
        return self

    def transform(self, X: Any) -> NDArray[Any]:
        """Features of recordings, shape (n, d * S), or (n, d * N) for weights.

        Raises
        ------
        TrajectoryError
            Recordings that cannot be used, or of other dimensions than those of `fit`.
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
