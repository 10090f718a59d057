"""Generate one movement of one primitive: by the decode matrix, or step by step around obstacles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kineme.dmp.control.plan import Status
from kineme.dmp.discrete.dmp import DMP, Primitives
from kineme.dmp.pose.pose_dmp import PoseDMP, PosePrimitives
from kineme.dmp.recorded_as import in_recording, primitive_columns
from kineme.errors import ExtrapolationWarning, SpecificationError, heard_warnings, warn
from kineme.io.arrays.npz import kind_of
from kineme.io.writing.write_movement import ColumnNames, Columns, names_of
from kineme.movements.channels.channel import learned_names, recorded_names
from kineme.movements.channels.coordinates import as_wxyz, columns_of, turns_beyond
from kineme.movements.preparation.glitches import RemoveGlitches, without_glitches
from kineme.movements.rotations import NORM_TOLERANCE, angle_between
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import LARGEST, Array

SAVED = ".kineme"  # file extension of saved primitives

_LONGEST = 10.0  # durations after which a movement around obstacles is given up
_AIMED = 8  # times that it is aimed beside the via points so that obstacles lead it through them
_MET = 0.01  # of the extent: a via point that is missed by more is said


@dataclass(frozen=True, eq=False)
class MovementOptions:
    """Options of a new movement; None leaves it as demonstrated. Points are in the columns that are not discrete.

    With `meet_goal` it ends exactly at its goal, with the velocity that it has at the demonstrated one; else as close
    as the primitive brings it, to some hundredths of the way between the two goals.
    """

    start: Array | None = None
    goal: Array | None = None
    duration: float | None = None  # tau [s]
    rate: float = 100.0  # samples per second, at least
    settle: float | None = None  # continue until within this distance of the goal
    obstacles: Array | None = None  # (m, d), points to steer around
    meet_goal: bool = False
    via: tuple[tuple[float, Array], ...] = ()  # when, between 0 and 1, and where; obstacles are aimed around


class Generated(NamedTuple):
    """A new movement: times (T,), positions (T, d), velocities and accelerations (T, e), and what they are called."""

    columns: Columns
    names: ColumnNames


def generate(learned: Learned, options: MovementOptions) -> Generated:
    """The new movement in the columns of the recording, discrete channels stepping where they did.

    Raises `SpecificationError`: an option that cannot be met, obstacles that keep it from its goal, numbers that are
    not finite. Warns `ExtrapolationWarning`: a via point missed by more than 1 % of the extent because of obstacles.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        start, goal = (checked_point(learned, getattr(options, name), name) for name in ("start", "goal"))
        points = [(share, checked_point(learned, point, "a via point")) for share, point in options.via]
        via = tuple((share, point) for share, point in points if point is not None)
        move = _undisturbed if options.obstacles is None else _around_obstacles
        duration = float(learned.primitive.durations[0]) if options.duration is None else options.duration
        movement = move(learned.primitive, replace(options, start=start, goal=goal, via=via, duration=duration))
    for name, column in movement.items():
        if not np.isfinite(column).all():
            raise SpecificationError(
                f"expected finite {name} of the new movement, they leave the range of numbers; choose a start, a "
                "goal and a duration nearer to those demonstrated"
            )
    about, names = learned.primitive.to_recording, ColumnNames(learned.columns, learned.rates)
    if about is not None:
        names = names_of(about.channels, learned.rates)
        shares = movement["times"] / duration
        movement["positions"] = in_recording(_signed(movement["positions"], learned), about, 0, shares)
        movement |= {name: movement[name][:, about.rates_in_order] for name in ("velocities", "accelerations")}
    return Generated(movement, names)


def checked_point(learned: Learned, point: Array | None, name: str) -> Array | None:
    """A start or goal in the columns of the recording that move (columns,), in those of the primitive."""
    if point is None:
        return None
    names = learned.moving_columns
    if point.shape != (len(names),):
        raise SpecificationError(f"expected {len(names)} numbers for {name}, {', '.join(names)}, got {point.size}")
    if not (np.abs(point) <= LARGEST).all():
        raise SpecificationError(
            f"expected finite numbers up to {LARGEST:g} for {name}, got {point.tolist()}; choose another unit"
        )
    about = learned.primitive.to_recording
    for channel, columns in [] if about is None else zip(about.moving, columns_of(about.moving), strict=True):
        if channel.kind == "orientation" and abs(norm := np.linalg.norm(point[columns]) - 1.0) > NORM_TOLERANCE:
            raise SpecificationError(
                f"expected a unit quaternion for {', '.join(channel.columns)} of {name}, got norm {norm + 1.0:.6g}; "
                "check the order of the columns, or divide it by its norm"
            )
    return point if about is None else point[primitive_columns(about.moving)]


def in_turn(learned: Learned, point: Array | None, name: str) -> tuple[Array | None, list[str]]:
    """Return a start or goal with angles in the turn in which the recording starts or ends, and what is turned."""
    about = learned.primitive.to_recording
    if point is None or about is None:
        return point, []
    order, near = primitive_columns(about.moving), getattr(learned.primitive, f"{name}s")[0]
    turned = np.array(point, dtype=np.float64)
    turned[order] -= turns_beyond(turned[order][None], near, about.periods(np.stack((point[order], near))))[0]
    return turned, [
        f"{name} {asked:g} of {column} is taken as {taken:g}, in the turn of the recording"
        for column, asked, taken in zip(learned.moving_columns, point.tolist(), turned.tolist(), strict=True)
        if asked != taken
    ]


def _signed(columns: Array, learned: Learned) -> Array:
    """Columns of a primitive, with orientations of the recorded sign: q and -q are one, but not in one column."""
    if not isinstance(learned.primitive, PosePrimitives):
        return columns
    columns, start = columns.copy(), learned.primitive.starts[0]
    for at in range(learned.primitive.n_positions, len(start), 4):
        if columns[0, at : at + 4] @ start[at : at + 4] < 0:
            columns[:, at : at + 4] *= -1.0
    return columns


def _undisturbed(primitive: Primitives | PosePrimitives, options: MovementOptions) -> Columns:
    end = None
    if options.meet_goal:
        end = primitive.rollout(duration=options.duration, rate=options.rate).velocities[:, -1]
    movement = primitive.rollout(
        options.start,
        options.goal,
        options.duration,
        via=options.via or None,
        end_velocity=end,
        rate=options.rate,
        settle=options.settle,
    )
    return {name: getattr(movement, name)[0] for name in ("times", "positions", "velocities", "accelerations")}


def _around_obstacles(primitive: Primitives | PosePrimitives, options: MovementOptions) -> Columns:
    obstacles = np.asarray(options.obstacles)
    n_dims = primitive.n_positions if isinstance(primitive, PosePrimitives) else primitive.n_dims
    if obstacles.ndim != 2 or obstacles.shape[1] != n_dims or n_dims < 2:
        raise SpecificationError(
            f"expected obstacles in the {n_dims} dimensions of the movement, two or more, got shape {obstacles.shape}"
        )
    movement = _steered(primitive, options, obstacles)
    return _through(primitive, options, obstacles, movement) if options.via else movement


def _through(
    primitive: Primitives | PosePrimitives, options: MovementOptions, obstacles: Array, movement: Columns
) -> Columns:
    """The movement around obstacles that comes nearest to its via points, aimed as far beside them as it missed."""
    n = obstacles.shape[1]
    tolerance = _MET * float(np.ptp(movement["positions"][:, :n], axis=0).max())
    best, least = movement, _missing(options, movement, n)
    missing, beside = least, np.zeros_like(least)
    with heard_warnings():  # of what it is aimed at, which nobody asked for
        for _ in range(_AIMED):
            if _largest(least) <= tolerance:
                break
            beside = beside + missing
            aimed = tuple(
                (share, np.append(point[:n] + off, point[n:]))
                for (share, point), off in zip(options.via, beside, strict=True)
            )
            movement = _steered(primitive, replace(options, via=aimed), obstacles)
            missing = _missing(options, movement, n)
            if _largest(missing) < _largest(least):
                best, least = movement, missing
    for (share, point), off in zip(options.via, np.linalg.norm(least, axis=1), strict=True):
        if not off <= tolerance:
            warn(
                f"the via point {np.round(point[:n], 6).tolist()} at {share:g} of the duration is missed by {off:.3g}: "
                "obstacles lead the movement away; move one of them, or ask for another time",
                ExtrapolationWarning,
                stacklevel=4,
            )
    return best


def _missing(options: MovementOptions, movement: Columns, n: int) -> Array:
    """From the movement to each of the k via points, at its time (k, n)."""
    assert options.duration is not None
    at = options.duration * np.array([share for share, _ in options.via])
    reached = np.column_stack([np.interp(at, movement["times"], x) for x in movement["positions"][:, :n].T])
    return np.array([point[:n] for _, point in options.via]) - reached


def _largest(missing: Array) -> float:
    return float(np.linalg.norm(missing, axis=1).max())


def _steered(primitive: Primitives | PosePrimitives, options: MovementOptions, obstacles: Array) -> Columns:
    """The movement under control, with the obstacles where they are."""
    assert options.duration is not None
    steps = primitive.rollout(duration=options.duration, rate=options.rate).times.shape[1] - 1
    control = primitive.controller(
        options.duration / steps,
        start=options.start,
        goal=options.goal,
        duration=options.duration,
        via=options.via or None,
        settle=options.settle,
    )
    states = [control.state]
    while len(states) <= _LONGEST * steps:
        settled = options.settle is None or bool(states[-1].status & Status.SETTLED)
        if states[-1].progress >= 1.0 - 1e-9 and settled:
            break
        states.append(control.step(obstacles=obstacles))
    if options.settle is not None and not states[-1].status & Status.SETTLED:
        raise SpecificationError(
            f"expected the movement to come within {options.settle:g} of its goal in {_LONGEST:g} durations, the "
            "obstacles keep it away; move them or the goal"
        )
    names = {"times": "time", "positions": "position", "velocities": "velocity", "accelerations": "acceleration"}
    return {column: np.array([getattr(state, name) for state in states]) for column, name in names.items()}


@dataclass(frozen=True, eq=False)
class Learned:
    """A primitive, and its demonstration where that is known."""

    primitive: Primitives | PosePrimitives  # a batch of one
    demonstration: Trajectory | None = None  # as it was recorded; its channels say what the columns are

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns that are generated: those that were recorded."""
        about = self.primitive.to_recording
        if about is not None:
            return recorded_names(about.channels)
        return tuple(self.primitive.plain_names[0]) if isinstance(self.primitive, PosePrimitives) else self.rates

    @property
    def moving_columns(self) -> tuple[str, ...]:
        """Those that a start and a goal have: all but the discrete ones."""
        about = self.primitive.to_recording
        return self.columns if about is None else recorded_names(about.moving)

    @property
    def rates(self) -> tuple[str, ...]:
        """Names of the columns that have velocities: an orientation has three, a discrete channel none."""
        channels = self.primitive.channels
        return tuple(self.primitive.plain_names[1]) if channels is None else learned_names(channels)

    @property
    def recorded(self) -> Array | None:
        """The demonstration in these columns, shape (T, columns)."""
        return None if self.demonstration is None else self.demonstration.recorded

    @property
    def example(self) -> Array:
        """The movement as it was learned, in the columns of the recording, shape (T, columns)."""
        return np.asarray(self.primitive.rollout()[0].recorded)


def learn_one(demonstration: Trajectory, dmp: DMP) -> Learned:
    """The primitive of a recording, whatever it holds, without its glitches; with orientations it is one of poses."""
    # Not in its specification, by which others learn again: what it was learned of is clean.
    clean = replace(dmp, preprocessing=(RemoveGlitches(), *dmp.preprocessing))
    if has_orientation(demonstration):
        return Learned(PoseDMP(clean).learn([demonstration]), demonstration)
    return Learned(replace(clean.learn([demonstration]), dmp=dmp), demonstration)


def has_orientation(demonstration: Trajectory) -> bool:
    """Tell whether a channel of the recording is an orientation."""
    return any(channel.kind == "orientation" for channel in demonstration.channels or ())


def load_saved(path: Path) -> Primitives | PosePrimitives:
    """Saved primitives of either kind."""
    is_pose = path.is_file() and kind_of(path) == PosePrimitives.KIND
    return PosePrimitives.load(path) if is_pose else Primitives.load(path)


class Deviation(NamedTuple):
    """The largest distance from a recording."""

    largest: float  # in the unit of the recording; of an orientation the angle [rad]
    share: float  # of the extent: the diagonal of the bounding box, or the largest angle from the start
    of: str  # "positions", "angles" or an orientation's name; empty in a recording of one kind


def largest_deviation(learned: Learned) -> Deviation | None:
    """Of positions, angles or an orientation, at the recorded times, that which is the largest share of its extent."""
    demonstration = learned.demonstration
    if demonstration is None:
        return None
    replay = learned.primitive.rollout(n_samples=max(1000, len(demonstration))).demonstrations[0]
    at = demonstration.times - demonstration.times[0]
    generated = np.stack([np.interp(at, replay.times, column) for column in replay.recorded.T], axis=1)
    deviations = [
        Deviation(off, off / extent, of) for off, extent, of in _deviations(demonstration, generated) if extent > 0.0
    ]
    if not deviations:
        return None
    worst = max(deviations, key=lambda each: each.share)
    return worst if len(deviations) > 1 else worst._replace(of="")


def _deviations(demonstration: Trajectory, generated: Array) -> Iterator[tuple[float, float, str]]:
    """Yield the largest distance of each kind of columns (T, columns), its extent, and what it is."""
    channels = demonstration.channels or ()
    kinds = [channel.kind for channel in channels for _ in channel.columns] or ["position"] * generated.shape[1]
    for kind in ("position", "angle"):
        columns = [k for k, name in enumerate(kinds) if name == kind]
        recorded = without_glitches(demonstration.recorded[:, columns], np.array([0, len(demonstration)]))
        off = np.linalg.norm(generated[:, columns] - recorded, axis=1)
        yield float(off.max()), float(np.linalg.norm(np.ptp(recorded, axis=0))), f"{kind}s"
    for channel, some in zip(channels, columns_of(channels), strict=True):
        if channel.kind == "orientation":
            q, fitted = as_wxyz(demonstration.recorded[:, some], channel), as_wxyz(generated[:, some], channel)
            fitted = fitted / np.linalg.norm(fitted, axis=1, keepdims=True)  # between samples shorter than 1
            yield float(angle_between(fitted, q).max()), float(angle_between(q, q[0]).max()), channel.name
