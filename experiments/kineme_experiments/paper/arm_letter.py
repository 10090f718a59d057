"""Figure 7 b, c: a learned letter, written by the arm."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.reporting.colors import BLUE, GRAY, GREEN, ORANGE, PURPLE
from kineme.reporting.figures import LINES, new_figure
from kineme.reporting.table import Table
from kineme.robots.kinematics.descent import PLANES, InverseKinematics
from kineme.robots.models.robot import load
from kineme.robots.planning.move import move
from kineme.robots.planning.robot_movement import RobotMovement
from kineme.validation import Array
from kineme_experiments.paper.arm_recordings import PLANE, ROBOT, SCALE, tip_positions
from kineme_experiments.paper.representations import specification

CAPTION = "(b, c) The WAM writes the learned letter: the path of its tip, seen from above, and its joints."

_NOTHING = 0.001
_AT_LIMIT = 0.99  # share of a limit from which on it is what slows the arm down


class Letter(NamedTuple):
    """A letter that the arm wrote."""

    made: RobotMovement
    demonstrated: Array  # (T, 2), where the demonstration lies on the table [m]
    wanted: Array  # (T, 2), what was learned, at the samples of the movement [m]
    written: Array  # (T, 2), where the joints bring the tip [m]
    numbers: dict[str, float]


def write_letter(one: Demonstrations) -> Letter:
    """Learn one demonstration with the paper's parameters, and execute it.

    Raises
    ------
    DataError
        The extra ``robot`` is not installed.
    """
    arm = load(ROBOT)
    rest, axes = InverseKinematics(arm).tip_position, list(PLANES[PLANE])
    shown = one[0]
    learned = specification("original").learn(one).rollout(n_samples=len(shown.times)).positions[0]
    points = np.tile(rest, (len(learned), 1))
    points[:, axes] += SCALE * learned
    made = move(Trajectory(times=shown.times, positions=points), arm, timing="slowed")
    assert made.path is not None  # of movements of the tip there is one
    first = int(np.searchsorted(made.trajectory.times, made.begins - 1e-9))
    tip = tip_positions(arm, made.trajectory.positions[first:])
    off = np.linalg.norm(tip - made.path.positions, axis=1)
    learned_off = SCALE * np.linalg.norm(learned - shown.positions, axis=1)
    return Letter(
        made,
        rest[axes] + SCALE * shown.positions,
        made.path.positions[:, axes],
        tip[:, axes],
        {
            "learned_rms": _rms(learned_off),
            "tracking_rms": _rms(off),
            "tracking_max": float(off.max()),
            "duration": made.trajectory.duration - made.begins,
            "approach": made.begins,
            "factor": made.factor,
            **_peaks(made, first),
        },
    )


def _rms(off: Array) -> float:
    return float(np.sqrt(np.mean(off**2)))


def _peaks(made: RobotMovement, first: int) -> dict[str, float]:
    """The largest shares of the limits of velocity and acceleration, without the approach, and of which joint."""
    of_velocity = np.abs(made.trajectory.velocities[first:]).max(axis=0) / made.robot.velocity
    of_acceleration = np.abs(made.trajectory.accelerations[first:]).max(axis=0) / made.robot.acceleration
    return {
        "velocity_share": float(of_velocity.max()),
        "velocity_joint": int(of_velocity.argmax()),
        "acceleration_share": float(of_acceleration.max()),
        "acceleration_joint": int(of_acceleration.argmax()),
    }


def draw_letter(letter: Letter) -> Figure:
    """The paths on the table beside the joints over time."""
    figure = new_figure(6.6, 2.9)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.3))
    left.plot(*letter.demonstrated.T, color=GRAY, linewidth=5, alpha=0.35, label="demonstrated")
    left.plot(*letter.wanted.T, color=ORANGE, linewidth=2.6, label="desired")
    left.plot(*letter.written.T, color=BLUE, linewidth=1.1, linestyle="--", label="executed")
    left.plot(*letter.written[:1].T, "o", color=GRAY, markersize=6)
    left.plot(*letter.written[-1:].T, "*", color="black", markersize=9)
    left.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="(b)")
    left.margins(0.1)
    _draw_joints(right, letter.made)
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure


def _draw_joints(axes: Any, made: RobotMovement) -> None:
    colors = (BLUE, ORANGE, GREEN, PURPLE, GRAY)
    times = made.trajectory.times - made.begins
    shown = times >= -1e-9
    for j, values in enumerate(made.trajectory.positions.T):
        style = {"color": colors[j % len(colors)], "linestyle": LINES[j // len(colors)]}
        axes.plot(times[shown], values[shown], label=f"joint {j + 1}", **style)
    axes.set(xlabel="time [s]", ylabel="joint position [rad]", title="(c)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def letter_table(numbers: dict[str, float]) -> Table:
    """The numbers of a letter."""
    joints = {key: f"joint {int(numbers[f'{key}_joint']) + 1}" for key in ("velocity", "acceleration")}
    return Table(
        "Figure 7 b, c. The arm writes a learned letter",
        ("", "value"),
        [
            ("learned from demonstrated path, rms", f"{1e3 * numbers['learned_rms']:.2f} mm"),
            ("executed from desired path, rms", f"{1e3 * numbers['tracking_rms']:.2g} mm"),
            ("executed from desired path, largest", f"{1e3 * numbers['tracking_max']:.2g} mm"),
            ("duration, after an approach", f"{numbers['duration']:.2f} s, {numbers['approach']:.2f} s"),
            ("times as long as demonstrated", f"{numbers['factor']:.3f}"),
            ("peak share of the velocity limits", f"{numbers['velocity_share']:.0%}, {joints['velocity']}"),
            ("peak share of the acceleration limits", f"{numbers['acceleration_share']:.0%}, {joints['acceleration']}"),
        ],
        read_letter(numbers),
    )


def read_letter(numbers: dict[str, float]) -> str:
    """What the arm adds to the error of learning, and why it takes longer than the demonstration, if it does."""
    ratio = numbers["tracking_rms"] / numbers["learned_rms"]
    accuracy = (
        f"The arm is off the desired path by {'less than 0.1%' if ratio < _NOTHING else format(ratio, '.1%')} of what "
        "the learned path is off the demonstrated one."
    )
    longer = numbers["factor"] > 1 + _NOTHING
    limits = max(numbers["velocity_share"], numbers["acceleration_share"])
    reason = "its limits demand it" if limits > _AT_LIMIT else "the arm starts from a stand and stops to one"
    pace = f"The letter takes {numbers['factor']:.3f} times as long as it was demonstrated, since {reason}. "
    return (
        f"{accuracy} {pace if longer else ''}Executed is where the joint positions that are sent bring the tip by the "
        "kinematics of the arm, not a measurement."
    )
