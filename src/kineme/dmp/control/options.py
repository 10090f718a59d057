"""The options of a controller, checked when it is made, and steering around obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.validation import Array, check_choice, check_number

AHEAD = 1e-4  # rad; an obstacle closer to straight ahead has no side, and one is chosen

FEEDBACK = ("state", "phase")


@dataclass(frozen=True)
class Options:
    """Options of a controller: what measurements, new goals, limits and obstacles do.

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
    """Return what a user typed as an array of numbers."""
    try:
        return np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SpecificationError(f"expected {name} to be numbers, got {value!r}") from error


@dataclass(frozen=True)
class ObstacleAvoidance:
    """Turns the movement away from what lies ahead, as people do when they walk around things.

    With ``r = o - x`` from the movement to an obstacle and v the velocity relative to it, both in normalized time, each
    obstacle adds to x''

        gamma R v phi exp(-beta phi) exp(-|r| / reach),        phi = angle between r and v,

    where R turns by 90 degrees about r x v. In words: at right angles to v, away from the obstacle, in
    proportion to the speed. The term does no work, so it neither speeds up nor stops the movement, vanishes where
    the movement rests, and keeps the goal attractive.

    Parameters
    ----------
    gamma : float, default 1000.0
        Strength, per duration. In normalized time the path around obstacles at rest is the same at every tempo.
    beta : float, default 20 / pi
        How fast the effect fades as the obstacle comes out of the way, per radian; it is strongest at 1 / beta.
    reach : float, optional
        Distance over which the effect falls to 1/e, in the unit of the movement. By default only the angle counts:
        even a far obstacle turns a movement that heads for it.

    Notes
    -----
    Hoffmann et al. write the formula in three dimensions; the factor of `reach` is exp(-k d) of Rai et al. The
    component of r across v says the same without a cross product, for any d from 2 on. Where the obstacle is straight
    ahead, within 0.0001 rad, or at the position, the movement turns left (d = 2) or along the axis in which it moves
    least (d > 2), as if the angle were 0.0001 rad.

    References
    ----------
    H. Hoffmann, P. Pastor, D.-H. Park, S. Schaal, "Biologically-inspired dynamical systems for movement generation:
    automatic real-time goal adaptation and obstacle avoidance", ICRA 2009, Section IV.
    A. Rai, F. Meier, A. Ijspeert, S. Schaal, "Learning coupling terms for obstacle avoidance", Humanoids 2014.
    """

    gamma: float = 1000.0
    beta: float = 20.0 / math.pi
    reach: float | None = None

    def __post_init__(self) -> None:
        check_number("gamma", self.gamma, least=0.0)
        check_number("beta", self.beta, least=0.0)
        if self.reach is not None:
            check_number("reach", self.reach, above=0.0)

    @property
    def fading(self) -> float:
        """The reciprocal of `reach`, 0 without one."""
        return 0.0 if self.reach is None else 1.0 / float(self.reach)


def steering(
    avoidance: ObstacleAvoidance, state: Array, obstacles: Array, velocities: Array, rounding: float = 0.0
) -> Array:
    """The sum of all obstacles' terms (d,).

    - `state` (2, d): position and dx/du.
    - `obstacles`, `velocities` (m, d): positions and their derivatives with respect to u.
    - `rounding`: an obstacle within this distance is at the position; one so little beside the line behind it has no
      effect.
    """
    r, v = obstacles - state[0], state[1] - velocities  # (m, d)
    speed, distance = np.linalg.norm(v, axis=1), np.linalg.norm(r, axis=1)
    moving = speed > 0
    heading = v / np.where(moving, speed, 1.0)[:, None]
    along = np.einsum("md,md->m", r, heading)
    across = r - along[:, None] * heading
    offset = np.linalg.norm(across, axis=1)
    phi = np.arctan2(offset, along)
    ahead = (phi < AHEAD) | (distance <= rounding)
    phi = np.where(ahead, AHEAD, phi)
    away = np.where(ahead[:, None], _side(heading), -across / np.where(offset > rounding, offset, 1.0)[:, None])
    strength = avoidance.gamma * speed * phi * np.exp(-avoidance.beta * phi - avoidance.fading * distance)
    return np.asarray(np.where(moving, strength, 0.0) @ away)


def _side(heading: Array) -> Array:
    """A unit vector (m, d) across each heading: to the left in the plane, else along the axis of least movement."""
    if heading.shape[1] == 2:
        return np.column_stack((-heading[:, 1], heading[:, 0]))
    rows, axis = np.arange(len(heading)), np.argmin(np.abs(heading), axis=1)
    side = -heading[rows, axis][:, None] * heading
    side[rows, axis] += 1.0
    return side / np.linalg.norm(side, axis=1, keepdims=True)
