"""Features of rhythmic recordings, as a scikit-learn transformer."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any, Self

import numpy as np

from kineme.features.movement_features import MovementFeatures
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.primitives.rhythmic.rhythmic_dmp import RhythmicDMP


class RhythmicFeatures(MovementFeatures):
    """Describe each recording by its rhythmic DMP: features of one cycle, wherever it started, rows as in Eq. (9).

    Parameters
    ----------
    feature : {"shape-attractor", "forcing", "weights"}, default "shape-attractor"
        ``r f``, which depends on the amplitude; f or w, which do not. None of them depends on translation and tempo.
    n_basis, stiffness, damping, ridge, n_points, overlap, period, align_on, aperiodic, preprocessing
        The specification; see `RhythmicDMP`.
    n_samples : int, default 100
        Samples S of a cycle. Weights have n_basis instead.
    fit_to : {"forcing", "trajectory"}, default "trajectory"
        The `fit` of `RhythmicDMP`.
    dtype : {"float64", "float32"}, default "float64"
        Type of the result.

    Attributes
    ----------
    dmp_ : RhythmicDMP
        The specification in force. Unless `align_on` is given, it is the dimension with the largest first harmonic in
        most training recordings, one for all: otherwise it could change between recordings with two similar dimensions.
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
        """Check the parameters and choose the dimension to align on; y is ignored.

        Raises
        ------
        TrajectoryError
            Recordings that cannot be used; see `RhythmicDMP.learn`.
        """
        self._check_parameters()
        shared = {field.name for field in fields(RhythmicDMP)} - {"fit"}
        dmp = RhythmicDMP(fit=self.fit_to, **{name: getattr(self, name) for name in shared})
        demonstrations = Demonstrations.of(X)
        if dmp.align_on is None:
            aligned_on = dmp.learn(demonstrations).aligned_on
            dmp = replace(dmp, align_on=int(np.bincount(aligned_on).argmax()))
        self.dmp_ = dmp
        self.n_dims_ = demonstrations.n_dims
        return self
