"""Bodies and robots over time in named arrays: parameters of SMPL models, joints with the pose of their root, points.

AMASS (Mahmood et al. 2019) keeps ``poses`` (T, 3 J), rotation vectors [rad] of J joints, beside ``trans`` (T, 3) [m]
and ``mocap_framerate``. Programs that retarget movements keep ``joint_pos`` or ``dof_pos`` (T, J) beside the pose of
the root, or ``qpos`` of MuJoCo, and ``fps``. What does not change over time, and velocities, are left aside.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.io.arrays.arrays import first_named, numbers_of
from kineme.io.arrays.trees import SAY_STEP, STAMP, Rate, rate_of
from kineme.movements.rotations import exp
from kineme.movements.tables.columns import choose_roles, is_time
from kineme.movements.tables.layout import Layout, Parsed, distinct, no_lines
from kineme.movements.tables.table import Segments, Table, table_movements
from kineme.movements.trajectories.movements import axis_names
from kineme.validation import Array

#: Joints in the order of SMPL (Loper et al. 2015), without its hands, which SMPL-H (Romero et al. 2017) and SMPL-X
#: (Pavlakos et al. 2019) have as fingers.
_TRUNK = [
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle",
    "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder",
    "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist",
]  # fmt: skip
_FACE = ["jaw", "left_eye", "right_eye"]
_LEFT, _RIGHT = (
    [f"{side}_{finger}{k}" for finger in ("index", "middle", "pinky", "ring", "thumb") for k in (1, 2, 3)]
    for side in ("left", "right")
)
_MODELS = {
    "the joints of SMPL's body": _TRUNK,
    "SMPL": [*_TRUNK, "left_hand", "right_hand"],
    "SMPL-H": [*_TRUNK, *_LEFT, *_RIGHT],
    "SMPL-X": [*_TRUNK, *_FACE, *_LEFT, *_RIGHT],
}
_ALL_JOINTS = ("poses", "fullpose", "full_pose", "smpl_poses", "pose")
#: Arrays that hold the rotations of some joints -> those joints; of AMASS, and of the package smplx.
_PARTS = {
    "root_orient": _TRUNK[:1], "global_orient": _TRUNK[:1], "pose_body": _TRUNK[1:], "body_pose": _TRUNK[1:],
    "pose_jaw": _FACE[:1], "jaw_pose": _FACE[:1], "pose_eye": _FACE[1:], "leye_pose": _FACE[1:2],
    "reye_pose": _FACE[2:], "pose_hand": [*_LEFT, *_RIGHT], "left_hand_pose": _LEFT, "right_hand_pose": _RIGHT,
}  # fmt: skip
_PLACES = (
    "trans", "transl", "smpl_trans", "root_pos", "root_position", "root_trans", "root_translation", "base_pos",
    "base_position",
)  # fmt: skip
_TURNS = ("root_rot", "root_quat", "root_rotation", "root_orientation", "base_quat", "base_rot", "base_orientation")
_JOINTS = ("qpos", "joint_pos", "joint_positions", "dof_pos", "dof_positions", "joint_angles")
_JOINT_NAMES = ("joint_names", "dof_names", "joints_list", "joint_order")
_POINTS = ("keypoints", "landmarks", "markers", "joints", "joints3d", "keypoints3d", "body_positions", "body_pos_w")
_POINT_NAMES = ("keypoint_names", "landmark_names", "marker_names", "body_names", *_JOINT_NAMES)
_OF_A_TURN = 1e-3  # deviation of the norm of a quaternion from 1, at most


class Body(NamedTuple):
    """Columns (T,) by their heads, what they describe, and the arrays that they were taken from."""

    model: str
    columns: dict[str, Array]
    arrays: tuple[str, ...]

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(next(iter(self.columns.values())))


def body_movements(arrays: Mapping[str, Any], layout: Layout, kind: str) -> Parsed | None:
    """Return the movements of a body or a robot, cut at ``split_points``; None where arrays are of no such."""
    body = next((body for find in _KINDS if (body := find(arrays)) is not None), None)
    if body is None:
        return None
    columns, rate = _clock(arrays, body, layout)
    layout = layout if rate is None else replace(layout, units=None)
    columns |= body.columns if layout.coordinates is None else body.columns | _others(arrays, body)
    heads = tuple(columns)
    table = Table(heads, list(columns.values()), body.n_samples, no_lines, segments=_segments(arrays, body))
    roles = choose_roles(heads, ["number"] * len(heads), layout)
    parsed = table_movements(table, roles, layout, kind)
    of_rate = "" if rate is None else f", {rate.hertz:g} Hz by {rate.name}"
    aside = [name for name in arrays if name not in (*body.arrays, *columns, *([rate.name] if rate else []))]
    ignored = tuple(aside) if layout.coordinates is None else parsed.detected.ignored
    return parsed._replace(detected=parsed.detected._replace(ignored=ignored, layout=f"{body.model}{of_rate}"))


def _clock(arrays: Mapping[str, Any], body: Body, layout: Layout) -> tuple[dict[str, Array], Rate | None]:
    stamps = {name: _values(arrays, name, body.n_samples) for name in arrays if is_time(name)}
    timed = {name: x[:, 0] for name, x in stamps.items() if x is not None and x.shape[1] == 1}
    if timed or isinstance(layout.units, float | int):  # the caller knows better than the file
        return timed, None
    rate = rate_of(arrays)
    if rate is None:
        raise DataError(
            f"expected the rate of {body.arrays[-1]} beside it, as mocap_framerate, fps or dt, got none{SAY_STEP}"
        )
    return {STAMP: rate.stamps(body.n_samples)}, rate


def _smpl(arrays: Mapping[str, Any]) -> Body | None:
    """Return rotation vectors of all joints of a model, or of some, with the translation of the root."""
    name = first_named(arrays, _ALL_JOINTS)
    x = None if name is None else _values(arrays, name)
    model = next((model for model, joints in _MODELS.items() if x is not None and x.shape[1] == 3 * len(joints)), None)
    columns: dict[str, Array] = {}
    if name is not None and x is not None and model is not None:
        columns, used = _rotations(_MODELS[model], x), [name]
    else:
        used = [part for part in _PARTS if part in arrays]
        parts = {part: _values(arrays, part) for part in used}
        used = [part for part, y in parts.items() if y is not None and y.shape[1] == 3 * len(_PARTS[part])]
        if not used or len({len(parts[part]) for part in used}) > 1:  # type: ignore[arg-type]
            return None
        for part in used:
            columns |= _rotations(_PARTS[part], parts[part])  # type: ignore[arg-type]
        model = "rotations of joints"
    n = len(next(iter(columns.values())))
    place, root = _points_of(arrays, _PLACES, n)
    return Body(model, root | columns, (*place, *used))


def _rotations(joints: Sequence[str], x: Array) -> dict[str, Array]:
    """Return rotation vectors (T, 3 J) as columns of quaternions, by their joints."""
    q = exp(x.reshape(len(x), -1, 3))
    return {f"{joint}.{part}": q[:, j, k] for j, joint in enumerate(joints) for k, part in enumerate("wxyz")}


def _robot(arrays: Mapping[str, Any]) -> Body | None:
    """Return joints by their names, with the pose of the root, if any; of MuJoCo's ``qpos`` it is in the array."""
    name = first_named(arrays, _JOINTS)
    x = None if name is None else _values(arrays, name)
    if name is None or x is None or np.ndim(arrays[name]) != 2:
        return None
    place, columns = _points_of(arrays, _PLACES, len(x))
    turn = first_named(arrays, _TURNS)
    q = None if turn is None else _values(arrays, turn, len(x))
    used = [*place, *([turn] if turn and q is not None else []), name]
    names = _texts(arrays, _JOINT_NAMES)
    if turn is not None and q is not None:
        columns |= {f"{turn}.{k}": q[:, k] for k in range(q.shape[1])}
    # MuJoCo's positions of a free joint are x, y, z and a unit quaternion w, x, y, z.
    is_free = x.shape[1] >= 7 and bool((np.abs(np.linalg.norm(x[:, 3:7], axis=1) - 1.0) <= _OF_A_TURN).all())
    if name == "qpos" and is_free and len(names) != x.shape[1]:
        root = names[0] if len(names) == x.shape[1] - 6 else "root"
        columns |= {f"{root}.position.{axis}": x[:, k] for k, axis in enumerate("xyz")}
        columns |= {f"{root}.orientation.{part}": x[:, k] for k, part in enumerate("wxyz", 3)}
        names, x = names[len(names) == x.shape[1] - 6 :], x[:, 7:]
    heads = names if len(names) == x.shape[1] else [f"{name}.{k}" for k in range(x.shape[1])]
    columns |= dict(zip(distinct(heads), x.T, strict=True))
    return Body("joints of a robot", columns, tuple(used))


def _named_points(arrays: Mapping[str, Any]) -> Body | None:
    """Return points (T, J, 2) or (T, J, 3) that are named so, where a rate or times say that the first axis is time."""
    name = first_named(arrays, _POINTS)
    x = None if name is None else _values(arrays, name)
    if name is None or x is None or np.ndim(arrays[name]) != 3 or np.shape(arrays[name])[2] not in (2, 3):
        return None
    timed = any(is_time(key) and np.shape(arrays[key]) == x.shape[:1] for key in arrays)
    if not timed and rate_of(arrays) is None:
        return None
    n_points, width = np.shape(arrays[name])[1:]
    names = _texts(arrays, _POINT_NAMES)
    names = names if len(names) == n_points else [f"{name}.{k}" for k in range(n_points)]
    heads = [f"{name}.{axis}" for name in distinct(names) for axis in "xyz"[:width]]
    return Body("points", dict(zip(heads, x.T, strict=True)), (name,))


_KINDS: tuple[Callable[[Mapping[str, Any]], Body | None], ...] = (_smpl, _robot, _named_points)


def _points_of(arrays: Mapping[str, Any], names: Sequence[str], n: int) -> tuple[list[str], dict[str, Array]]:
    """Return the array of a point over time, and its columns; nothing where there is none."""
    name = first_named(arrays, names)
    x = None if name is None else _values(arrays, name, n)
    if name is None or x is None or x.shape[1] != 3:
        return [], {}
    return [name], {f"{name}.{axis}": x[:, k] for k, axis in enumerate("xyz")}


def _others(arrays: Mapping[str, Any], body: Body) -> dict[str, Array]:
    columns: dict[str, Array] = {}
    for name in arrays:
        x = None if name in body.arrays else _values(arrays, name, body.n_samples)
        if x is not None and not is_time(name):
            ends = axis_names(3) if x.shape[1] == 3 else [str(k) for k in range(x.shape[1])]
            columns |= {name: x[:, 0]} if x.shape[1] == 1 else {f"{name}.{end}": x[:, k] for k, end in enumerate(ends)}
    return columns


def _values(arrays: Mapping[str, Any], name: str, n: int | None = None) -> Array | None:
    """Give an array of n samples as columns (n, width); None for anything else, as texts, objects and other lengths."""
    try:
        x = numbers_of(arrays[name])
    except DataError:
        return None
    if x.ndim == 0 or not x.size or (n is not None and len(x) != n):
        return None
    return x.reshape(len(x), -1)


def _texts(arrays: Mapping[str, Any], names: Sequence[str]) -> list[str]:
    for name in names:
        with suppress(DataError):  # of Python objects
            texts = np.asarray(arrays.get(name))
            if texts.ndim == 1 and texts.dtype.kind in "US":
                return [text.decode("utf-8", "replace") if isinstance(text, bytes) else text for text in texts.tolist()]
    return []


def _segments(arrays: Mapping[str, Any], body: Body) -> Segments | None:
    cuts = _values(arrays, "split_points") if "split_points" in arrays else None
    if cuts is None or len(cuts) < 3:
        return None
    cuts = cuts[:, 0]
    if cuts[0] != 0 or cuts[-1] != body.n_samples or (np.diff(cuts) < 0).any():
        raise DataError(f"expected split_points that rise from 0 to {body.n_samples}, got {cuts[0]:g} to {cuts[-1]:g}")
    n = len(cuts) - 1
    return Segments(cuts.astype(np.intp), [str(k) for k in range(n)], [None] * n)
