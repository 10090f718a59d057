"""A symbol as something that can be done: the ranges in which it was shown, and its movement to a new goal."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.dmp.discrete.rollout import Rollout
from kineme.dmp.pose.pose_rollout import PoseRollout
from kineme.dmp.recorded_as import primitive_columns
from kineme.dmp.styles.parameters import as_primitives
from kineme.errors import SpecificationError
from kineme.library.grounding import learned_movement
from kineme.library.library import ActionLibrary
from kineme.movements.channels.channel import Channels, learned_names
from kineme.movements.channels.coordinates import turns_beyond
from kineme.validation import Array, as_point, check_number

_GRIPPERS = ("grip", "grasp", "finger")


@dataclass(frozen=True, eq=False)
class Skill:
    """What was shown of a symbol, in the coordinates that are places: positions or, without any, all that move.

    - `movements` (n,): their ids in the library. `starts`, `goals` (n, k). `durations` (n,) [s].
    - `axes`, `units`: names of the k coordinates and their units, None where the recordings do not say it.
    - `periods` (k,): what angles wrap by, which are in one turn; infinite of other coordinates.
    """

    name: str
    id: str
    description: str
    movements: NDArray[np.int64]
    starts: Array
    goals: Array
    durations: Array
    axes: tuple[str, ...]
    units: tuple[str | None, ...]
    periods: Array

    @property
    def shown(self) -> dict[str, Array]:
        """Start, goal and displacement of each movement, (n, k)."""
        return {"start": self.starts, "goal": self.goals, "displacement": self.goals - self.starts}

    def turns(self, place: Array, what: str = "start") -> Array:
        """Return whole turns (k,) by which a start or goal is beyond those that were shown; see `turns_beyond`."""
        return np.asarray(turns_beyond(place[None], np.median(self.shown[what], axis=0), self.periods)[0])


class Excess(NamedTuple):
    """One number beyond the range that was shown."""

    what: str  # "start", "goal" or "displacement"
    axis: str
    value: float
    low: float
    high: float
    unit: str | None

    @property
    def distance(self) -> float:
        """Distance from the range, in its unit."""
        return max(self.low - self.value, self.value - self.high)

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{self.what} {self.axis} = {self.value:.4g}{unit} is {self.distance:.3g}{unit} outside "
            f"{self.low:.4g} to {self.high:.4g}{unit}"
        )


def skill_of(library: ActionLibrary, who: str) -> Skill:
    """Return what was shown of a symbol.

    Raises `SpecificationError`: no such symbol, or one without movements.
    """
    symbol = library[who]
    if not len(symbol):
        raise SpecificationError(f"expected a symbol with movements, {symbol.name!r} has none; learn some")
    primitives = as_primitives(library.primitives(ids=symbol.members))
    columns, axes, units = place_columns(library.channels, primitives.n_dims)
    about = primitives.recorded_as
    periods = np.full(primitives.n_dims, np.inf) if about is None else about.periods(primitives.starts)
    return Skill(
        symbol.name, symbol.id, symbol.description, symbol.members, primitives.starts[:, columns],
        primitives.goals[:, columns], primitives.durations, axes, units, periods[columns],
    )  # fmt: skip


def place_columns(channels: Channels | None, n_dims: int) -> tuple[list[int], tuple[str, ...], tuple[str | None, ...]]:
    """Return the coordinates that are places, their names and their units: positions, or all but grippers."""
    if channels is None:
        return (
            list(range(n_dims)),
            tuple("xyz"[:n_dims] if n_dims <= 3 else map("x{}".format, range(n_dims))),
            (None,) * n_dims,
        )
    names = learned_names(channels)
    moving = [channel for channel in channels if channel.coordinates and not is_gripper(channel.name)] or channels
    unit_of = {channel.name: channel.unit for channel in moving if channel.kind == "position"} or {
        name: channel.unit for channel in moving for name in channel.coordinates
    }
    columns = [k for k, name in enumerate(names) if name in unit_of]
    return columns, tuple(names[k] for k in columns), tuple(unit_of[names[k]] for k in columns)


def is_gripper(name: str) -> bool:
    """Tell whether a column is how far a gripper is open; ``gripper_x`` is where it is."""
    return any(part in name.lower() for part in _GRIPPERS) and not re.search(r"(^|[^a-z])[xyz]\b", name.lower())


def outside(skill: Skill, start: ArrayLike, goal: ArrayLike, margin: float = 0.0) -> list[Excess]:
    """List what lies outside the box of starts, goals and displacements that were shown; empty if nothing does.

    Start and goal (k,) are places in the unit of the recordings. The boxes are larger by `margin` on every side, in
    that unit. Angles of both are taken less the whole turns by which the start is beyond those that were shown.
    """
    check_number("margin", margin, least=0.0)
    begin, end = _in_turn(skill, start, goal)
    excesses = []
    for (what, shown), value in zip(skill.shown.items(), (begin, end, end - begin), strict=True):
        low, high = shown.min(axis=0) - margin, shown.max(axis=0) + margin
        slack = 1e-9 * max(1.0, float(np.abs(shown).max()))  # stored and asked for differ by rounding
        excesses += [
            Excess(what, skill.axes[k], float(value[k]), float(low[k]), float(high[k]), skill.units[k])
            for k in np.flatnonzero((value < low - slack) | (value > high + slack))
        ]
    return excesses


def nearest_demonstration(skill: Skill, start: ArrayLike, goal: ArrayLike) -> int:
    """Return the row of the movement that went most nearly so: by displacement and, if equal, by start."""
    begin, end = _in_turn(skill, start, goal)
    ways = np.linalg.norm(skill.goals - skill.starts - (end - begin), axis=1)
    return int(np.lexsort((np.linalg.norm(skill.starts - begin, axis=1), ways.round(9)))[0])


def _in_turn(skill: Skill, start: ArrayLike, goal: ArrayLike) -> tuple[Array, Array]:
    """Return start and goal (k,), angles in the turn in which they were shown."""
    begin, end = as_point("start", start, skill.axes), as_point("goal", goal, skill.axes)
    turns = skill.turns(begin)
    return begin - turns, end - turns


def move_to(
    library: ActionLibrary,
    skill: Skill,
    start: ArrayLike,
    goal: ArrayLike,
    *,
    duration: float | None = None,
    rate: float = 100.0,
) -> Rollout | PoseRollout:
    """Generate the movement of the nearest demonstration from a start to a goal, at rest at both and exactly there.

    Orientations and discrete channels are those of that demonstration. The places are not compared with what was shown:
    see `outside`.
    """
    row = nearest_demonstration(skill, start, goal)
    learned = learned_movement(library.store, int(skill.movements[row]))
    primitive = learned.primitive
    channels = primitive.to_recording.moving if primitive.to_recording is not None else None
    names = skill.axes if channels is None else learned.moving_columns
    columns = [names.index(axis) for axis in skill.axes]
    if channels is not None:  # orientations of a primitive are its last columns
        columns = np.argsort(primitive_columns(channels))[columns].tolist()
    first, last = primitive.starts[0].copy(), primitive.goals[0].copy()
    first[columns], last[columns] = as_point("start", start, skill.axes), as_point("goal", goal, skill.axes)
    rest = np.zeros(primitive.n_dims)
    return primitive.rollout(first, last, duration, velocity=rest, end_velocity=rest, rate=rate)
