"""A controlled movement: what no step changes, its via points, and the goal that it follows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Flag, auto
from functools import cached_property, reduce
from operator import or_
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.validation import Array, check_choice, check_number


class Status(Flag):
    """Events of a step; members combine. Nothing here is an exception: the motion went on."""

    MOVING = auto()
    SETTLED = auto()
    PAUSED = auto()
    MEASUREMENT_REJECTED = auto()
    GOAL_REJECTED = auto()
    TEMPO_REJECTED = auto()
    DT_REJECTED = auto()
    COUPLING_REJECTED = auto()
    OBSTACLES_REJECTED = auto()
    VELOCITY_LIMIT = auto()
    ACCELERATION_LIMIT = auto()
    STATE_KEPT = auto()
    AMPLITUDE_REJECTED = auto()
    PERIOD_REJECTED = auto()
    VIA_POINT_MISSED = auto()

    @property
    def messages(self) -> tuple[str, ...]:
        """One sentence for each member that is set."""
        return tuple(MESSAGES[member] for member in self)

    @property
    def rejected(self) -> bool:
        """True if something that was passed to the step could not be used."""
        return bool(self & REJECTED)


MESSAGES = {
    Status.MOVING: "the movement is under way",
    Status.SETTLED: "the movement has ended and rests at its goal",
    Status.PAUSED: "tempo is 0, or the tracking error holds the phase: position and phase stand still",
    Status.MEASUREMENT_REJECTED: (
        "expected the measured position and velocity to be d finite numbers; what was not is left out"
    ),
    Status.GOAL_REJECTED: "expected a goal of d finite numbers that the formulation can reach; the last good one stays",
    Status.TEMPO_REJECTED: "expected a tempo of 0 or more, at most one duration per step; the last good tempo stays",
    Status.DT_REJECTED: "expected dt above 0 and at most one duration per step; the controller's own dt was used",
    Status.COUPLING_REJECTED: "expected a coupling of d finite accelerations; none was applied",
    Status.OBSTACLES_REJECTED: (
        "expected obstacles as finite (m, d) positions and velocities, d of at least 2; the last good obstacles stay"
    ),
    Status.VELOCITY_LIMIT: "the velocity is above its limit; it was not changed",
    Status.ACCELERATION_LIMIT: "the acceleration is above its limit; it was not changed",
    Status.STATE_KEPT: "the step led out of the range of numbers; the last good state was kept",
    Status.AMPLITUDE_REJECTED: "expected the amplitude as a finite number; the last good one stays",
    Status.PERIOD_REJECTED: "expected the period in seconds, above 0 and not too short for dt; the last good one stays",
    Status.VIA_POINT_MISSED: (
        "the movement passed a via point farther away than 1 % of its extent; via_missed says how far"
    ),
}

#: What says that something could not be used.
REJECTED = reduce(or_, (member for member in Status if str(member.name).endswith("_REJECTED")))


class State(NamedTuple):
    """A movement at one moment. The arrays are the caller's own: the controller keeps no reference to them.

    - `time`: since the start [s].
    - `progress`: the phase as normalized time u: 0 at the start, 1 where the demonstration ended, more while settling;
      of a rhythm the periods since the start.
    - `position`, `velocity`, `acceleration` (d,): in the unit of the demonstration, per second and per second squared.
    - `goal` (d,): the goal in force, of a rhythm the baseline; on the way to a new one where the controller filters
      goals.
    - `via_missed`: largest distance from via points whose time passed in this step; 0 where none did. Of poses in
      positions.
    """

    time: float
    progress: float
    position: Array
    velocity: Array
    acceleration: Array
    goal: Array
    via_missed: float
    status: Status


AHEAD = 1e-4  # rad; an obstacle closer to straight ahead has no side, and one is chosen

FEEDBACK = ("state", "phase")

_ARRIVED = 1e-14  # of the target's distance from the origin: rounding

SHORTEST = 1e-12  # durations; shorter steps are lost in rounding
_ROUNDING = 64 * np.finfo(np.float64).eps


class Influences(NamedTuple):
    """Influences on the movement during one step, held constant over it; in normalized time, relative to the origin."""

    goal: Array  # (d,), at the start of the step; ahead of a goal that moves, see `MovingGoal`
    ratio: Array  # (d,), what scale f is multiplied by
    goal_rate: Array  # (d,), with which the goal goes on during the step
    push: Array  # (d,), an external acceleration
    obstacles: Array  # (m, n_positions), at the start of the step
    obstacle_velocities: Array  # (m, n_positions); with these the obstacles go on during the step


#: Of the extent of a movement: farther from a via point is said.
MISSED = 1e-2


class ViaPlaces(NamedTuple):
    """Places of a movement at k times, relative to the origin."""

    times: Array  # (k,), normalized
    points: Array  # (k, n_positions), or (k, d) of a movement without positions; NaN where a dimension is free
    tolerance: float  # distance from one that is said


@dataclass(frozen=True, eq=False)
class Plan:
    """The equation of one movement and where it begins, whatever kind of primitive it comes from.

    In normalized time u, with positions and goals relative to the origin,

        x'' = K (g - x) - D x' + ratio scale_f(u) + coupling(u) g,        ' = d/du.
    """

    dmp: Any  # the specification: stiffness, damping, and the terms from which `shape` is mixed
    mixing: Array  # (N + 1, d + 1), from basis functions and coupling to `shape`
    ratio: Callable[[Array], Array]  # of a goal (d,), no lambda: plans are pickled; not finite where it cannot go
    origin: Array  # (d,), from where positions and goals count; x0 of a discrete movement
    goal: Array  # (d,), the first goal
    state: Array  # (2, d), the first position and dx/du
    duration: float  # of u = 1 [s]
    settle: float  # distance within which the movement has settled, by default
    n_positions: int  # the leading dimensions that are coordinates of one point, in which obstacles lie
    begin: float = 0.0  # u of the first state
    periodic: bool = False  # whether `shape` repeats itself after u = 1; then the movement never settles
    longest_step: float = 1.0  # at most so many durations in one step
    via: ViaPlaces | None = None  # its via points, which obstacles, goals and measurements may lead it away from

    @cached_property
    def K(self) -> float:
        """Stiffness."""
        return float(self.dmp.K)

    @cached_property
    def D(self) -> float:
        """Damping."""
        return float(self.dmp.D)

    @property
    def n_gaps(self) -> int:
        """Gaps between the centers of basis functions in [0, 1]: how finely `shape` is to be sampled."""
        return int(self.dmp.n_basis) - (not self.periodic)

    def shape(self, u: Array) -> Array:
        """Scale f of each dimension, then the coupling, at normalized times u (T,); shape (T, d + 1)."""
        return np.asarray(self.dmp.terms(u) @ self.mixing)

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return len(self.origin)

    @cached_property
    def rounding(self) -> float:
        """Distance that rounding leaves between equal positions, once the origin is subtracted from them."""
        return float(_ROUNDING * max(np.abs(place).max() for place in (self.origin, self.goal, self.state[0])))

    @cached_property
    def intervals(self) -> float:
        """Quadrature intervals per unit of u: two between neighboring centers, and as many as the spring is fast."""
        return max(2.0 * self.n_gaps, math.sqrt(self.K), 0.5 * self.D)


def passed(via: ViaPlaces, begin: float, end: float, du: float, periodic: bool) -> Iterator[tuple[float, Array]]:
    """Yield the via points whose times lie in a step of du, after `begin` and not after `end`, and how far ahead."""
    after, before = via.times > begin, via.times <= end
    within = after & before if not periodic or (begin <= end and du < 1.0) else (after | before) | (du >= 1.0)
    for time, point in zip(via.times[within].tolist(), via.points[within], strict=True):
        yield time - begin if time > begin else time - begin + 1.0, point


class FilteredValue:
    """Numbers that approach a target with a time constant, ``filter dx/dt = target - x``, or jump without one."""

    def __init__(self, target: Array, time_constant: float | None) -> None:
        self._time_constant = time_constant
        self.target = target
        self.lag: Array | None = None  # value in force minus target; None where it has arrived

    @property
    def now(self) -> Array:
        """The value in force."""
        return self.target if self.lag is None else self.target + self.lag

    def set(self, target: Array) -> None:
        """Set a target."""
        if self._time_constant is not None:
            self.lag = self.now - target
        self.target = target

    def mean(self, dt: float) -> Array:
        """Go on by dt; returns the mean of the value in force meanwhile."""
        if self.lag is None or self._time_constant is None:
            return self.target
        passed = dt / self._time_constant
        mean = self.target + self.lag * (-math.expm1(-passed) / passed if passed > 0 else 1.0)
        self.lag = self.lag * math.exp(-passed)
        if np.abs(self.lag).max() <= _ARRIVED * np.abs(self.target).max():
            self.lag = None
        return mean


class MovingGoal(FilteredValue):
    """A goal relative to the origin, at rest or with a velocity, and what scale f is multiplied by for it.

    A goal that moves would be trailed by D / K of its velocity. So what enters the equation is ahead of it,

        x'' = (K + coupling(u)) (g + D / K g') + scale f - K x - D x'  =  K (g - x) + D (g' - x') + ...,

    the moving target of J. Kober, K. Mulling, O. Kromer, C. H. Lampert, B. Scholkopf, J. Peters, "Movement Templates
    for Learning of Hitting and Batting", ICRA 2010, the paper's reference [3]: there too what draws to the target is
    weighted by 1 - s. Scale f belongs to where the goal will be at the end.
    """

    def __init__(self, plan: Plan, target: Array, time_constant: float | None) -> None:
        super().__init__(target, time_constant)
        self.velocity: Array | None = None  # per second
        self._plan, self._ratio, self._arrival = plan, plan.ratio(target), target

    def aim(self, target: Array, velocity: Array | None = None, remaining: float = 0.0) -> bool:
        """Set a target and its velocity, `remaining` [s] before the end; False, and no change, where it cannot go."""
        if velocity is None and self.velocity is None and (target == self.target).all():
            return True
        arrival = target if velocity is None else target + remaining * velocity
        ratio = self._plan.ratio(arrival)
        if not np.isfinite(ratio).all():
            return False
        self.set(target)
        self.velocity, self._ratio, self._arrival = velocity, ratio, arrival
        return True

    def ahead(self, goal: Array, rate: Array) -> Array:
        """The goal that is followed without a lag where it moves by `rate` per unit of u."""
        return goal + self._plan.D / self._plan.K * rate

    def follow(self, dt: float) -> tuple[Array, Array]:
        """Go on by dt; returns the goal at the start of it, or the mean of one on its way, and the ratio for it."""
        start = self.target
        if self.lag is None:
            ratio = self._ratio
        else:
            start = self.mean(dt)
            ratio = self._plan.ratio(start - self.target + self._arrival)
        if self.velocity is not None:
            self.target = self.target + dt * self.velocity
        return start, ratio


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
        check_number("phase_stopping", self.phase_stopping, least=0.0, optional=True)
        for name in ("goal_filter", "settle"):
            check_number(name, getattr(self, name), above=0.0, optional=True)
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
        check_number("reach", self.reach, above=0.0, optional=True)

    @property
    def fading(self) -> float:
        """The reciprocal of `reach`, 0 without one."""
        return 0.0 if self.reach is None else 1.0 / float(self.reach)


def steering(
    avoidance: ObstacleAvoidance, state: Array, obstacles: Array, velocities: Array, rounding: float = 0.0
) -> Array:
    """The sum of all obstacles' terms (d,), of a state (2, d) of position and dx/du, and obstacles (m, d) likewise.

    An obstacle within `rounding` is at the position; one so little beside the line behind it has no effect.
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
