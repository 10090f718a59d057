"""The table of message types: how a message becomes a row of named numbers, or a movement of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

Heads = tuple[str, ...]
Row = Sequence[float]

_XYZ = ("x", "y", "z")
POSE: Heads = (*(f"position.{axis}" for axis in _XYZ), *(f"orientation.{axis}" for axis in (*_XYZ, "w")))
_TWIST: Heads = (*(f"linear.{axis}" for axis in _XYZ), *(f"angular.{axis}" for axis in _XYZ))

#: The types of messages with transforms between frames.
TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")


class MessageType(NamedTuple):
    """How messages of a type are read.

    Attributes
    ----------
    row : callable or None
        Message -> heads and numbers of one sample; no heads: the message holds no sample.
    path : callable or None
        Message -> heads, stamps [ns] and rows of a whole movement. `row` or `path` is given.
    has_header : bool
        Whether a message tells its own time.
    """

    row: Callable[[Any], tuple[Heads, Row]] | None = None
    path: Callable[[Any], tuple[Heads, list[int], list[Row]]] | None = None
    has_header: bool = False


def nanoseconds_of(time: Any) -> int:
    """A time or a duration of ROS [ns]."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def transform_row(transform: Any) -> Row:
    """Translation and rotation, the numbers of `POSE`."""
    p, q = transform.translation, transform.rotation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _pose_row(pose: Any) -> Row:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _twist_row(twist: Any) -> Row:
    v, w = twist.linear, twist.angular
    return v.x, v.y, v.z, w.x, w.y, w.z


def _point_row(point: Any) -> Row:
    return point.x, point.y, point.z


def _joint_state(message: Any) -> tuple[Heads, Row]:
    """Positions of joints under their names; a message of velocities or efforts alone holds no sample."""
    row = message.position.tolist()
    if not row:
        return (), ()
    if len(message.name) != len(row):
        raise ValueError(f"expected a position for each joint, got {len(message.name)} names and {len(row)} positions")
    return tuple(message.name), row


def _pose_array(message: Any) -> tuple[Heads, Row]:
    heads = tuple(f"poses.{k}.{head}" for k in range(len(message.poses)) for head in POSE)
    return heads, [number for pose in message.poses for number in _pose_row(pose)]


def _numbers(message: Any) -> tuple[Heads, Row]:
    row = message.data.tolist()
    return tuple(f"data.{k}" for k in range(len(row))), row


def _joint_trajectory(message: Any) -> tuple[Heads, list[int], list[Row]]:
    heads = tuple(message.joint_names)
    rows = [point.positions.tolist() for point in message.points]
    if odd := next((len(row) for row in rows if len(row) != len(heads)), None):
        raise ValueError(f"expected a position for each of {len(heads)} joints, got {odd}")
    if any(not row for row in rows):
        raise ValueError("expected points with positions, got some without")
    return heads, [nanoseconds_of(point.time_from_start) for point in message.points], rows


def _path(message: Any) -> tuple[Heads, list[int], list[Row]]:
    stamps = [nanoseconds_of(pose.header.stamp) for pose in message.poses]
    return POSE, stamps, [_pose_row(pose.pose) for pose in message.poses]


def _fixed(heads: Heads, row: Callable[[Any], Row]) -> Callable[[Any], tuple[Heads, Row]]:
    return lambda message: (heads, row(message))


#: Name of a type -> how its messages are read; those of `TRANSFORMS` are composed, see `kineme.io.ros.frames`.
TYPES: dict[str, MessageType] = {
    "sensor_msgs/msg/JointState": MessageType(_joint_state, has_header=True),
    "geometry_msgs/msg/Pose": MessageType(_fixed(POSE, _pose_row)),
    "geometry_msgs/msg/PoseStamped": MessageType(_fixed(POSE, lambda m: _pose_row(m.pose)), has_header=True),
    "geometry_msgs/msg/PoseWithCovarianceStamped": MessageType(
        _fixed(POSE, lambda m: _pose_row(m.pose.pose)), has_header=True
    ),
    "geometry_msgs/msg/PoseArray": MessageType(_pose_array, has_header=True),
    "geometry_msgs/msg/TransformStamped": MessageType(
        _fixed(POSE, lambda m: transform_row(m.transform)), has_header=True
    ),
    "geometry_msgs/msg/Twist": MessageType(_fixed(_TWIST, _twist_row)),
    "geometry_msgs/msg/TwistStamped": MessageType(_fixed(_TWIST, lambda m: _twist_row(m.twist)), has_header=True),
    "geometry_msgs/msg/PointStamped": MessageType(_fixed(POSE[:3], lambda m: _point_row(m.point)), has_header=True),
    "geometry_msgs/msg/Vector3Stamped": MessageType(
        _fixed(("vector.x", "vector.y", "vector.z"), lambda m: _point_row(m.vector)), has_header=True
    ),
    "nav_msgs/msg/Odometry": MessageType(_fixed(POSE, lambda m: _pose_row(m.pose.pose)), has_header=True),
    "nav_msgs/msg/Path": MessageType(path=_path),
    "trajectory_msgs/msg/JointTrajectory": MessageType(path=_joint_trajectory),
    "std_msgs/msg/Float64MultiArray": MessageType(_numbers),
    "std_msgs/msg/Float32MultiArray": MessageType(_numbers),
}
