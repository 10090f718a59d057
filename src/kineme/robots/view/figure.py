"""A movement on an arm as a picture, and for the viewer of Rerun: where its tip goes, and its joints over time."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from kineme.io.writing.rerun import Scene, Stretch
from kineme.movements.trajectories.figure import set_equal_scales
from kineme.reporting.colors import BLUE, GRAY, ORANGE
from kineme.reporting.figures import new_figure
from kineme.reporting.text import drawable
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.planning.robot_movement import RobotMovement

_ROW = 0.85  # height of one joint [inch]
_LEAST_SPAN = 0.05  # of what the limits allow: so much of it is drawn at least, that a joint at rest is a straight line
_LONGEST = 34  # letters of the name of a joint


def draw_robot_movement(movement: RobotMovement) -> Figure:
    """The path of the tip, wanted and executed, and each joint over time with its limits."""
    trajectory, robot = movement.trajectory, movement.robot
    n = robot.n_joints + len(trajectory.steps)
    figure = new_figure(8.4, max(3.6, 1.0 + _ROW * n))
    left, right = figure.subfigures(1, 2, width_ratios=(1.0, 1.25))  # type: ignore[misc]
    _draw_path(left, movement)
    rows = right.subplots(n, 1, sharex=True, squeeze=False)[:, 0]
    for j, axes in enumerate(rows[: robot.n_joints]):
        _draw_joint(axes, movement, j)
    for axes, (name, values) in zip(rows[robot.n_joints :], trajectory.steps.items(), strict=True):
        axes.axvspan(0, movement.begins, color=GRAY, alpha=0.12, linewidth=0)
        axes.step(trajectory.times, values, color=BLUE, where="post")
        _name(axes, _short(name))
    rows[-1].set_xlabel("time [s]")
    right.suptitle("joints over time, their limits at the right; the approach is shaded", fontsize=9)
    return figure


def _draw_path(figure: Any, movement: RobotMovement) -> None:
    executed, first = kinematics(movement.robot, movement.trajectory.positions)[0], movement.first
    axes = figure.add_subplot(projection="3d")
    axes.plot(*executed[: first + 1].T, color=GRAY, linestyle=":", label="approach")
    if movement.path is not None:
        axes.plot(*movement.path.positions.T, color=ORANGE, linewidth=4, alpha=0.5, label="wanted")
    axes.plot(*executed[first:].T, color=BLUE, label="executed")
    axes.scatter(*executed[first], color=BLUE, s=24, label="start")
    axes.scatter(*executed[-1], color=BLUE, s=40, marker="*", label="goal")
    set_equal_scales(axes, executed)
    extents = np.ptp(executed, axis=0)
    is_flat = extents[2] < extents.max() / 2  # then the numbers of x and y lie lower
    for name, extent in zip("xyz", extents, strict=True):
        axes.locator_params(axis=name, nbins=4 if extent > extents.max() / 2 else 2)  # numbers side by side
        getattr(axes, f"set_{name}label")(f"{name} [m]", labelpad=10 if is_flat and name != "z" else None)
    figure.legend(loc="outside lower center", ncols=3)
    figure.suptitle(f"tip of {drawable(movement.robot.name)}", fontsize=9)


def _draw_joint(axes: Any, movement: RobotMovement, j: int) -> None:
    robot, times, values = movement.robot, movement.trajectory.times, movement.trajectory.positions[:, j]
    lower, upper = float(robot.lower[j]), float(robot.upper[j])
    axes.axvspan(0, movement.begins, color=GRAY, alpha=0.12, linewidth=0)
    axes.plot(times, values, color=BLUE)
    room = 0.3 * max(float(np.ptp(values)), 0.5)
    for limit in (lower, upper):
        if values.min() - room <= limit <= values.max() + room:
            axes.axhline(limit, color=ORANGE, linestyle="--", linewidth=1)
    low, high = axes.get_ylim()
    narrow = max(0.0, _LEAST_SPAN * (upper - lower) - (high - low)) / 2
    axes.set_ylim(low - narrow, high + narrow)
    _name(axes, f"{_short(robot.joints[j])} [{robot.units[j]}]")
    limits = f"{lower:.2f} to {upper:.2f}"
    axes.text(1.0, 1.0, limits, transform=axes.transAxes, ha="right", va="bottom", fontsize=7, color=ORANGE)


def _name(axes: Any, name: str) -> None:
    axes.set_title(drawable(name), loc="left", fontsize=8, pad=2)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else "…" + name[1 - _LONGEST :]


def robot_scene(movement: RobotMovement, name: str) -> Scene:
    """Return the joints over time, the tip as it is executed and as it is wanted, and when the approach is over."""
    robot, trajectory = movement.robot, movement.trajectory
    joints = tuple(f"{joint} [{unit}]" for joint, unit in zip(robot.joints, robot.units, strict=True))
    rates = tuple(f"{joint} [{unit}/s]" for joint, unit in zip(robot.joints, robot.units, strict=True))
    signals = {"joints": trajectory.positions, "velocities": trajectory.velocities}
    names = {"joints": joints, "velocities": rates}
    if trajectory.steps:
        signals["steps"] = np.column_stack([*trajectory.steps.values()])
        names["steps"] = tuple(trajectory.steps)
    paths = {f"tip of {robot.name}": kinematics(robot, trajectory.positions)[0]}
    if movement.path is not None:
        wanted = np.full((len(trajectory.times), 3), np.nan)
        wanted[len(wanted) - len(movement.path.positions) :] = movement.path.positions
        paths["wanted"] = wanted
    begins, ends = float(movement.begins), float(trajectory.times[-1])
    stretches = [Stretch(0.0, begins, "approach")] if begins > 0 else []
    return Scene(name, trajectory.times, signals, names, paths, {"symbols": [*stretches, Stretch(begins, ends, name)]})
