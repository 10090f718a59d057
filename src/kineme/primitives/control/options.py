"""How a controller treats what it is told while it moves."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.primitives.control.obstacles import ObstacleAvoidance
from kineme.primitives.discrete.primitives import Primitives
from kineme.primitives.discrete.rollout import Rollout, rollout
from kineme.validation import Array, check_choice, check_number

FEEDBACK = ("state", "phase")


@dataclass(frozen=True)
class Options:
    """The choices that `Controller` takes as keywords; they are explained there."""

    feedback: str = "state"
    phase_stopping: float | None = None
    goal_filter: float | None = None
    velocity_limit: ArrayLike | None = None
    acceleration_limit: ArrayLike | None = None
    avoidance: ObstacleAvoidance = ObstacleAvoidance()  # noqa: RUF009 - frozen
    settle: float | None = None

    def __post_init__(self) -> None:
        check_choice("feedback", self.feedback, FEEDBACK)
        if (self.feedback == "phase") != (self.phase_stopping is not None):
            raise SpecificationError(
                'expected phase_stopping together with feedback="phase", and only then, got '
                f"feedback={self.feedback!r} and phase_stopping={self.phase_stopping!r}"
            )
        if self.phase_stopping is not None:
            check_number("phase_stopping", self.phase_stopping, least=0.0)
        for name in ("goal_filter", "settle"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), above=0.0)
        if not isinstance(self.avoidance, ObstacleAvoidance):
            raise SpecificationError(f"expected avoidance to be an ObstacleAvoidance, got {self.avoidance!r}")


def options_from(keywords: dict[str, Any]) -> Options:
    """The options that a user typed; one that does not exist is a TypeError, as for any function."""
    known = [field.name for field in fields(Options)]
    unknown = [name for name in keywords if name not in known]
    if unknown:
        raise TypeError(f"expected options out of {known} for a controller, got {unknown[0]!r}")
    return Options(**keywords)


def one_movement(
    primitives: Primitives,
    start: ArrayLike | None,
    goal: ArrayLike | None,
    duration: float | None,
    velocity: ArrayLike | None,
) -> Rollout:
    """The undisturbed movement of a single primitive, with the wishes of `Primitives.rollout` checked for one."""
    if len(primitives) != 1:
        raise SpecificationError(
            f"expected one primitive to control, got {len(primitives)}; choose one: primitives[0].controller(dt)"
        )
    if duration is not None:
        check_number("duration", duration, above=0.0)
    d = primitives.n_dims
    start, goal, velocity = _wish("start", start, d), _wish("goal", goal, d), _wish("velocity", velocity, d)
    return rollout(primitives, start, goal, duration, velocity)


def _wish(name: str, value: ArrayLike | None, n_dims: int) -> Array | None:
    """A start, goal or velocity as finite (d,)."""
    if value is None:
        return None
    array = _numbers(name, value)
    array = array[None] if array.ndim == 0 else array  # a number serves one dimension
    if array.shape != (n_dims,) or not np.isfinite(array).all():
        raise SpecificationError(f"expected {name} to be {n_dims} finite numbers, one per dimension, got {value!r}")
    return array


def limit(name: str, value: ArrayLike | None, n_dims: int) -> Array | None:
    """A limit as positive (d,), from a number or one per dimension."""
    if value is None:
        return None
    array = _numbers(name, value)
    if array.shape not in ((), (n_dims,)) or not (array > 0).all():
        raise SpecificationError(f"expected {name} to be a number above 0, or {n_dims} of them, got {value!r}")
    return np.broadcast_to(array, n_dims)


def _numbers(name: str, value: ArrayLike) -> Array:
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SpecificationError(f"expected {name} to be numbers, got {value!r}") from error
