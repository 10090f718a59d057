"""Features of orientations and poses, as a scikit-learn transformer."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.utils.validation import check_is_fitted

from kineme.dmp.pose.tangent import as_poses, to_tangent
from kineme.errors import TrajectoryError
from kineme.features.dmp_features import DMPFeatures
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import check_number


class PoseFeatures(TransformerMixin, BaseEstimator):
    """Describe movements of an orientation, or of a position and an orientation, by their DMPs.

    The features of `DMPFeatures` on the rotation vector from the goal; see `PoseDMP`.

    Parameters
    ----------
    features : DMPFeatures, optional
        What to compute; by default ``DMPFeatures()``. Its parameters are searched as ``features__n_samples``,
        ``features__dmp__n_basis`` and so on.
    orientation_weight : float, default 0.2
        Weight of a radian beside the positions, in their unit per radian. With 0.2 m, about the length of a hand or a
        tool, a rotation counts as much as the displacement of the tip. Positions in millimeters need 200. Not used
        without positions.

    Attributes
    ----------
    features_ : DMPFeatures
        The fitted transformer behind it.
    n_columns_ : int
        4 for orientations, 7 for poses.

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

    def fit(self, X: MovementsLike, y: Any = None) -> Self:
        """Check the parameters and the movements; y is ignored."""
        check_number("orientation_weight", self.orientation_weight, above=0.0)
        self.features_ = DMPFeatures() if self.features is None else clone(self.features)
        demonstrations = as_poses(X)
        self.n_columns_ = demonstrations.n_dims
        self.steps_ = tuple(self.features_.get_params()["dmp__preprocessing"])
        self.features_.set_params(dmp__preprocessing=())  # applied in to_tangent, before the goal is read
        self.features_.fit(self._tangent(demonstrations))
        return self

    def transform(self, X: MovementsLike) -> NDArray[Any]:
        """Features of movements, shape (n, d * S) with d = 3 (orientations) or 6 (poses); see `DMPFeatures`.

        Raises
        ------
        TrajectoryError
            Movements that cannot be used, or orientations where `fit` saw poses.
        """
        check_is_fitted(self)
        demonstrations = as_poses(X)
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
        weights = np.repeat([1.0, float(self.orientation_weight)], 3)
        weighted = replace(tangent.movements, positions=tangent.positions * weights)
        return Demonstrations.of_movements(weighted, tangent.steps)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        tags.input_tags.three_d_array = True
        return tags
