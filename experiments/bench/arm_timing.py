"""Handwriting on arms, as fast as it goes and slowed down: how much passes, and how near the limits it comes.

Between samples lies what the joint_trajectory_controller of ROS interpolates, a polynomial of the fifth order, here
that of SciPy.
"""

from __future__ import annotations

import time
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BPoly

from bench.rows import Row
from kineme import DMP, Trajectory, load_lasa
from kineme.datasets.lasa import LASA_26
from kineme.dmp import Rollout
from kineme.errors import TrajectoryError
from kineme.robots import JointTrajectory, Robot, load, move
from kineme.robots.execution.joint_trajectory import Torques

ARMS = ("panda", "ur5e", "wam", "so101")
SIZES = (0.05, 0.1, 0.2)  # of the longer side [m]
SECONDS = {"fastest": 5.0, "slowed": 0.3}  # of the movement itself
RATE = 100.0
QUICK = 5  # every fifth
PARTS, PARTS_OF_TORQUES = 20, 4  # of the time between two samples
LIMITS = ("velocity", "acceleration", "torque")
MOST = 1.001  # share of a limit


class Cell(NamedTuple):
    """One letter on one arm with one timing."""

    arm: str
    timing: str
    name: str  # of the letter, with its size
    shares: tuple[float, float, float] | None  # of `LIMITS`, at their worst instant; None where it is refused
    refusal: str
    seconds: float  # processor time


def measure(quick: bool) -> list[Row]:
    letters = {demonstrations.labels[0]: demonstrations[0] for demonstrations in (load_lasa([s]) for s in LASA_26)}
    robots = {name: load(name) for name in ARMS}
    choices = list(product(ARMS, SECONDS, LASA_26, SIZES))[:: QUICK if quick else 1]
    cells = [_timed(robots[arm], letters[shape], shape, size, timing) for arm, timing, shape, size in choices]
    rows = []
    for arm, timing in product(ARMS, SECONDS):
        rows += _rows(arm, timing, [cell for cell in cells if (cell.arm, cell.timing) == (arm, timing)])
    return rows


def _timed(robot: Robot, letter: Trajectory, shape: str, size: float, timing: str) -> Cell:
    name, begin = f"{shape} {size:g} m", time.process_time()
    try:
        made = move(_written(letter, size, SECONDS[timing]), robot, timing=timing, place="free", rate=RATE)
    except TrajectoryError as error:
        return Cell(robot.name, timing, name, None, str(error), time.process_time() - begin)
    taken = time.process_time() - begin
    return Cell(robot.name, timing, name, shares(robot, made.trajectory), "", taken)


def _written(letter: Trajectory, size: float, seconds: float) -> Rollout:
    path = size * letter.positions / np.ptp(letter.positions, axis=0).max()
    return DMP().learn([Trajectory(letter.times, path)]).rollout(duration=seconds)


def shares(robot: Robot, trajectory: JointTrajectory) -> tuple[float, float, float]:
    """The greatest velocity, acceleration and torque between samples, as shares of their limits."""
    times, q = trajectory.times, trajectory.positions
    joints = BPoly.from_derivatives(times, np.stack((q, trajectory.velocities, trajectory.accelerations), axis=1))
    fine = np.append((times[:-1, None] + np.diff(times)[:, None] * np.arange(PARTS) / PARTS).ravel(), times[-1])
    velocities, accelerations = joints(fine, 1), joints(fine, 2)
    torques, coarse = Torques(robot), slice(None, None, PARTS // PARTS_OF_TORQUES)
    moving = zip(joints(fine[coarse]), velocities[coarse], accelerations[coarse], strict=True)
    needed = np.abs([torques.of(*state) for state in moving]) / robot.effort
    return (
        float((np.abs(velocities) / robot.velocity).max()),
        float((np.abs(accelerations) / robot.acceleration).max()),
        float(np.nanmax(needed, initial=0.0)),
    )


def _rows(arm: str, timing: str, cells: list[Cell]) -> list[Row]:
    refused = {cell.name: cell.refusal for cell in cells if cell.shares is None}
    passed = [cell for cell in cells if cell.shares is not None]
    details = {
        "refused": refused,
        "processor seconds": {
            "median": float(np.median([c.seconds for c in cells])),
            "most": max(c.seconds for c in cells),
        },
    }
    what = f"{arm}, {timing}: of {len(cells)} letters"
    row = Row(f"{what}, passed", "%", 100 * len(passed) / len(cells), target=(">=", 100.0), details=details)
    if not passed:
        return [row]
    greatest = np.max([cell.shares for cell in passed], axis=0)
    details = dict(zip(LIMITS, greatest.tolist(), strict=True))
    return [
        row,
        Row(f"{what}, greatest share of a limit", "", float(greatest.max()), target=("<=", MOST), details=details),
    ]
