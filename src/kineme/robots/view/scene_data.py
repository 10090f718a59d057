"""What the script of the page gets: the arm, and where it is when."""

from __future__ import annotations

import json
from base64 import b64encode
from typing import Any

import numpy as np

from kineme.reporting.figures import BLUE, GRAY, GREEN, ORANGE
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.robots.view.shapes import Shapes
from kineme.sampling import evenly_spaced
from kineme.validation import Array

MOST_SAMPLES = 3000  # of a page; between two of them the page interpolates


def scene_data(made: RobotMovement, shapes: Shapes) -> dict[str, Any]:
    """Times, joint positions [rad, m] and positions of the tip [m], rounded to a millionth."""
    trajectory = made.trajectory
    kept = evenly_spaced(len(trajectory), MOST_SAMPLES)
    tip = kinematics(made.robot, trajectory.positions)[0]
    wanted = np.empty((0, 3)) if made.path is None else made.path.positions
    return {
        "urdf": shapes.urdf,
        "meshes": [{"kind": mesh.kind, "content": b64encode(mesh.content).decode()} for mesh in shapes.meshes],
        "joints": shapes.joints,
        "tip": shapes.tip,
        "times": _rounded(trajectory.times[kept]),
        "positions": _rounded(trajectory.positions[kept]),
        "steps": [_rounded(values[kept]) for values in trajectory.steps.values()],
        "executed": _rounded(tip[kept]),
        "wanted": _rounded(wanted[evenly_spaced(len(wanted), MOST_SAMPLES)] if len(wanted) else wanted),
        "begins": round(made.begins, 6),
        "start": _rounded(tip[made.first]),
        "goal": _rounded(tip[-1]),
        "colors": {"executed": BLUE, "wanted": ORANGE, "approach": GRAY, "goal": GREEN},
    }


def _rounded(values: Array) -> Any:
    return np.round(values, 6).tolist()


def as_script_data(data: dict[str, Any]) -> str:
    """JSON that can stand in a script element: no ``<`` is left in it that could end the element."""
    return json.dumps(data, separators=(",", ":")).replace("<", r"\u003c")
