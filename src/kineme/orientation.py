"""Orientations as unit quaternions (w, x, y, z), and poses: learn them, move again, describe them."""

from typing import TYPE_CHECKING as _TYPE_CHECKING
from typing import Any as _Any

from kineme.primitives.pose.pose_controller import PoseController, PoseState
from kineme.primitives.pose.pose_dmp import PoseDMP
from kineme.primitives.pose.pose_primitives import PosePrimitives
from kineme.primitives.pose.pose_rollout import PoseRollout
from kineme.primitives.pose.quaternions import angle_between, conjugate, continuous, normalized, product
from kineme.primitives.pose.rates import angular_acceleration, angular_velocity, rotation_vector_rate
from kineme.primitives.pose.rotation_vectors import exp, log, slerp
from kineme.primitives.pose.tangent import from_tangent, to_tangent

if _TYPE_CHECKING:
    from kineme.features.pose_features import PoseFeatures

__all__ = [
    "PoseController",
    "PoseDMP",
    "PoseFeatures",
    "PosePrimitives",
    "PoseRollout",
    "PoseState",
    "angle_between",
    "angular_acceleration",
    "angular_velocity",
    "conjugate",
    "continuous",
    "exp",
    "from_tangent",
    "log",
    "normalized",
    "product",
    "rotation_vector_rate",
    "slerp",
    "to_tangent",
]


def __getattr__(name: str) -> _Any:
    if name == "PoseFeatures":  # scikit-learn loads on first use, not with the quaternions
        from kineme.features.pose_features import PoseFeatures

        return PoseFeatures
    raise AttributeError(f"module 'kineme.orientation' has no attribute {name!r}; it has {', '.join(__all__)}")
