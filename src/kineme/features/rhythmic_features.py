"""Features of rhythmic recordings, as a scikit-learn transformer."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np

from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicDMP
from kineme.features.movement_features import MovementFeatures
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike


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
    n_dims_ : int
        Dimensions d of the training movements.
    """

    _specification_type: ClassVar[type] = RhythmicDMP

    def fit(self, X: MovementsLike, y: Any = None) -> Self:
        """Check the parameters and choose the dimension to align on; y is ignored.

        Raises
        ------
        TrajectoryError
            Recordings that cannot be used; see `RhythmicDMP.learn`.
        """
        dmp = self._checked()
        demonstrations = Demonstrations.of(X)
        if dmp.align_on is None:
            aligned_on = dmp.learn(demonstrations).aligned_on
            dmp = replace(dmp, align_on=int(np.bincount(aligned_on).argmax()))
        self.dmp_ = dmp
        self.n_dims_ = demonstrations.n_dims
        return self
