"""The options of a controller, checked when it is made."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kineme.dmp.control.obstacles import ObstacleAvoidance
from kineme.errors import SpecificationError
from kineme.validation import Array, check_choice, check_number

FEEDBACK = ("state", "phase")


@dataclass(frozen=True)
class Options:
    """How a controller treats what it is told while it moves.

    Attributes
    ----------
    feedback : {"state", "phase"}, default "state"
        What a measured position and velocity do. "state": the movement goes on from there. "phase": they do not touch
        the state; the distance between measured and expected position slows the phase.
    phase_stopping : float, optional
        With feedback="phase": a in ``du/dt = tempo / (tau (1 + a |x_measured - x|^2))``, per squared unit.
    goal_filter : float, optional
        Time constant [s] with which the goal in force, and the amplitude of a rhythm, approach a new one; by default
        they jump. Over a step the mean acts (second order in dt).
    velocity_limit, acceleration_limit : float or array_like, optional
        For all components or one each, as the state reports them. Reported when exceeded, by `Status.VELOCITY_LIMIT`
        and `Status.ACCELERATION_LIMIT`; nothing is clamped. The acceleration counts at the end of the step and as the
        velocity's mean change over it.
    avoidance : ObstacleAvoidance, optional
        How to steer around obstacles.
    settle : float, optional
        Distance to the goal, in each dimension, and change per duration within which the movement has settled; by
        default 0.1 % of the demonstration's largest extent. A rhythm never settles.

    Raises
    ------
    SpecificationError
        An option out of its range.

    Notes
    -----
    Phase stopping: A. J. Ijspeert, J. Nakanishi, H. Hoffmann, P. Pastor, S. Schaal, "Dynamical Movement Primitives:
    Learning Attractor Models for Motor Behaviors", Neural Computation 25(2), 2013. As there, tau grows in all
    equations, so the path stays the same.
    """

    feedback: str = "state"
    phase_stopping: float | None = None
    goal_filter: float | None = None
    velocity_limit: ArrayLike | None = None
    acceleration_limit: ArrayLike | None = None
    avoidance: ObstacleAvoidance | None = None
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
        if self.avoidance is not None and not isinstance(self.avoidance, ObstacleAvoidance):
            raise SpecificationError(f"expected avoidance to be an ObstacleAvoidance, got {self.avoidance!r}")


def one_vector(name: str, value: ArrayLike | None, n_dims: int) -> Array | None:
    """A start, goal or velocity of one movement as finite (d,)."""
    if value is None:
        return None
    array = numbers(name, value)
    array = array[None] if array.ndim == 0 else array  # a number serves one dimension
    if array.shape != (n_dims,) or not np.isfinite(array).all():
        raise SpecificationError(f"expected {name} to be {n_dims} finite numbers, one per dimension, got {value!r}")
    return array


def check_one(n_primitives: int) -> None:
    """Refuse to control several primitives at once."""
    if n_primitives != 1:
        raise SpecificationError(
            f"expected one primitive to control, got {n_primitives}; choose one: primitives[0].controller(dt)"
        )


def numbers(name: str, value: ArrayLike) -> Array:
    """What a user typed as an array of numbers."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SpecificationError(f"expected {name} to be numbers, got {value!r}") from error
