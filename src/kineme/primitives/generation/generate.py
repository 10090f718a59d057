"""Generate one movement of one primitive: by the decode matrix, or step by step around obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kineme.errors import SpecificationError
from kineme.files.recordings import read_recording
from kineme.files.write_movement import Columns
from kineme.primitives.control.state import State, Status
from kineme.primitives.discrete.dmp import DMP, Primitives
from kineme.validation import Array

SAVED = ".kineme"  # file extension of saved primitives
_LONGEST = 10.0  # durations after which a movement around obstacles is given up


@dataclass(frozen=True, eq=False)
class MovementOptions:
    """What the new movement should be; None leaves it as demonstrated.

    Attributes
    ----------
    start, goal : ndarray of shape (d,), optional
    duration : float, optional
        tau [s].
    rate : float
        Samples per second, at least.
    settle : float, optional
        Continue until within this distance of the goal.
    obstacles : ndarray of shape (m, d), optional
        Points to steer around.
    """

    start: Array | None = None
    goal: Array | None = None
    duration: float | None = None
    rate: float = 100.0
    settle: float | None = None
    obstacles: Array | None = None


def primitives_from(path: Path, dmp: DMP) -> Primitives:
    """Saved primitives from a ``.kineme`` file, or those that `dmp` learns from a recording."""
    return Primitives.load(path) if path.suffix.lower() == SAVED else dmp.learn(read_recording(path))


def generate(primitive: Primitives, options: MovementOptions) -> Columns:
    """The new movement as columns times (T,), positions, velocities, accelerations (T, d).

    Parameters
    ----------
    primitive : Primitives
        A batch of one.

    Raises
    ------
    SpecificationError
        An option that cannot be met; among them obstacles that keep the movement from its goal, more samples than fit
        into memory, and numbers that are not finite: a robot gets no movement that was not checked.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        made = (_undisturbed if options.obstacles is None else _around_obstacles)(primitive, options)
    for name, column in made.items():
        if not np.isfinite(column).all():
            raise SpecificationError(
                f"expected finite {name} of the new movement, they leave the range of numbers; choose a start, a "
                "goal and a duration nearer to those demonstrated"
            )
    return made


def _undisturbed(primitive: Primitives, options: MovementOptions) -> Columns:
    made = primitive.rollout(options.start, options.goal, options.duration, rate=options.rate, settle=options.settle)
    return {
        "times": made.times[0],
        "positions": made.positions[0],
        "velocities": made.velocities[0],
        "accelerations": made.accelerations[0],
    }


def _around_obstacles(primitive: Primitives, options: MovementOptions) -> Columns:
    obstacles = np.asarray(options.obstacles)
    if obstacles.ndim != 2 or obstacles.shape[1] != primitive.n_dims or primitive.n_dims < 2:
        raise SpecificationError(
            f"expected obstacles in the {primitive.n_dims} dimensions of the movement, two or more, got shape "
            f"{obstacles.shape}"
        )
    duration = float(primitive.durations[0]) if options.duration is None else options.duration
    steps = primitive.rollout(duration=duration, rate=options.rate).n_samples - 1
    control = primitive.controller(
        duration / steps, start=options.start, goal=options.goal, duration=duration, settle=options.settle
    )
    states = [control.state]
    while not _arrived(states[-1], options) and len(states) <= _LONGEST * steps:
        states.append(control.step(obstacles=obstacles))
    if options.settle is not None and not states[-1].status & Status.SETTLED:
        raise SpecificationError(
            f"expected the movement to come within {options.settle:g} of its goal in {_LONGEST:g} durations, the "
            "obstacles keep it away; move them or the goal"
        )
    return {
        "times": np.array([state.time for state in states]),
        "positions": np.array([state.position for state in states]),
        "velocities": np.array([state.velocity for state in states]),
        "accelerations": np.array([state.acceleration for state in states]),
    }


def _arrived(state: State, options: MovementOptions) -> bool:
    over = state.progress >= 1.0 - 1e-9
    return over if options.settle is None else over and bool(state.status & Status.SETTLED)
