"""A joint trajectory as columns, for CSV, NPZ, JSON and Parquet."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kineme.io.writing.write_movement import ColumnNames, Columns, encode_movement, write_movement
from kineme.robots.execution.joint_trajectory import JointTrajectory


def write_joints(path: str | Path, trajectory: JointTrajectory) -> Path:
    """Times, joints and discrete channels under their names, then velocities ``v_NAME`` and accelerations ``a_NAME``.

    The heads of joints end in their units: ``shoulder_pan [rad]``, ``v_shoulder_pan [rad/s]``.

    Raises
    ------
    DataError
        An ending that no writer has, or a file that cannot be written.
    """
    return write_movement(Path(path), *as_columns(trajectory))


def encode_joints(trajectory: JointTrajectory, ending: str = ".csv") -> bytes:
    """The bytes of such a file."""
    columns, names = as_columns(trajectory)
    return encode_movement(columns, ending, names)


def as_columns(trajectory: JointTrajectory) -> tuple[Columns, ColumnNames]:
    """The arrays, and what their columns are called."""
    positions = np.column_stack((trajectory.positions, *trajectory.steps.values()))
    columns = {
        "times": trajectory.times,
        "positions": positions,
        "velocities": trajectory.velocities,
        "accelerations": trajectory.accelerations,
    }
    joints = tuple(f"{name} [{unit}]" for name, unit in zip(trajectory.joints, trajectory.units, strict=True))
    return columns, ColumnNames((*joints, *trajectory.steps), joints)
