"""The arms that come with kineme: one table."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import NamedTuple

#: Where their URDF files lie.
FOLDER = Path(__file__).parent


class Model(NamedTuple):
    """An arm whose URDF file lies beside this module."""

    title: str
    tip: str  # the frame that follows the movement
    rest: tuple[float, ...]  # joint positions from which it starts, tool pointing down where it can [rad]
    assumed: str = ""  # what its maker does not publish, and what is taken instead
    meshes: str = ""  # its URDF with meshes in the package example-robot-data, if installed


#: Name -> model; ``robots.load``, the command line and the docs list what is here.
MODELS = {
    "panda": Model(
        "Franka Emika Panda, 7 joints",
        "panda_hand_tcp",
        (0.0, -pi / 4, 0.0, -3 * pi / 4, 0.0, pi / 2, pi / 4),
        meshes="panda_description/urdf/panda.urdf",
    ),
    "ur5e": Model("Universal Robots UR5e, 6 joints", "tool0", (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)),
    "wam": Model(
        "Barrett WAM, 7 joints",
        "wam_tool",
        (0.0, 0.6, 0.0, 1.8, 0.0, 0.75, 0.0),
        "its maker publishes no limits of velocity: 2 rad/s is taken for every joint, measure yours",
    ),
    "so101": Model(
        "SO-101, 5 joints",
        "gripper_frame_link",
        (0.0, -0.6, 0.9, 0.9, 0.0),
        meshes="so_arm_description/urdf/so101.urdf",
    ),
}
