"""Movements on arms: how well the tip follows a stroke, the whole way to a checked trajectory, and one live step.

Times are processor times: what others do on the machine does not count.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from bench.rows import Row
from bench.simulated_panda import tracking
from kineme import DMP, Trajectory
from kineme.orientation import PoseDMP, exp, product
from kineme.robots import ArmController, InverseKinematics, Robot, load, move
from kineme.robots.execution.preflight import along
from kineme.validation import Array

N_SAMPLES, SECONDS, SIZE, DT = 150, 3.0, 0.2, 0.005
TURN = np.array([0.2, 0.3, 0.4])  # rotation vector [rad]
MOST_OFF, MOST_WHOLE, MOST_STEP = 0.05, 50.0, 200.0  # mm rms, ms, µs


def measure(quick: bool) -> list[Row]:
    repeats = 3 if quick else 15
    rows = []
    for name in ("panda", "ur5e", "wam"):
        robot = load(name)
        rows += [_accuracy(robot), _whole(robot, repeats), *_steps(robot, 100 if quick else 600)]
    panda = load("panda")
    return [*rows, *tracking(stroke(panda, SECONDS / 4), panda)]  # too fast: it is slowed down


def stroke(robot: Robot, seconds: float = SECONDS) -> Trajectory:
    """An S, 20 cm tall, with the velocity of least jerk."""
    u = np.linspace(0.0, 1.0, N_SAMPLES)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    shape = np.column_stack((0 * s, 0.4 * (s - 0.5), SIZE / 2 * np.sin(2 * np.pi * s)))
    return Trajectory(times=seconds * u, positions=InverseKinematics(robot).tip_position + shape)


def _accuracy(robot: Robot) -> Row:
    made = move(stroke(robot), robot, timing="slowed", place="free")
    assert made.path is not None
    tips = along(robot, made.trajectory).tip_positions[-len(made.path.times) :]
    off = 1e3 * np.linalg.norm(tips - made.path.positions, axis=1)
    rms = float(np.sqrt(np.mean(off**2)))
    details = {"worst": float(off.max()), "samples": len(off)}
    return Row(
        f"{robot.name}: tip off a {100 * SIZE:.0f} cm stroke, rms", "mm", rms, target=("<=", MOST_OFF), details=details
    )


def _whole(robot: Robot, repeats: int) -> Row:
    movement = stroke(robot)

    def whole() -> None:
        move(movement, robot, timing="slowed", place="free", rate=N_SAMPLES / SECONDS)

    taken = 1e3 * _least(whole, repeats)
    what = f"{robot.name}: {N_SAMPLES} points placed, solved, timed and checked"
    return Row(what, "ms", taken, target=("<=", MOST_WHOLE), details={"repeats": repeats})


def _least(work: Callable[[], object], repeats: int) -> float:
    """Least processor time of one call [s]."""
    work()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        work()
        times.append(time.process_time() - begin)
    return min(times)


def _steps(robot: Robot, n: int) -> Iterator[Row]:
    positions, poses = stroke(robot), _turning(robot)
    for what, primitive in (("position", DMP().learn([positions])), ("pose", PoseDMP().learn([poses]))):
        for feedback in ({}, {"feedback": "phase", "phase_stopping": 1e3}):
            arm = ArmController(robot, primitive.controller(DT, duration=SECONDS, **feedback))
            name = f"{robot.name}: live step, controller and joints, {what}{', phase' if feedback else ''}"
            yield Row(name, "µs", 1e6 * _median_step(arm, n), target=("<=", MOST_STEP))


def _turning(robot: Robot) -> Array:
    """`stroke` with an orientation that turns by 31 degrees, (T, 7)."""
    there = stroke(robot)
    turned = np.linspace(0.0, 1.0, len(there.times))[:, None] * TURN
    at_rest = InverseKinematics(robot).tip_pose[3:]
    return np.column_stack((there.positions, product(exp(turned), at_rest)))


def _median_step(arm: ArmController, n: int) -> float:
    """Median processor time of a step [s]."""
    times = np.empty(n)
    for k in range(n):
        begin = time.process_time()
        arm.step()
        times[k] = time.process_time() - begin
    return float(np.median(times))
