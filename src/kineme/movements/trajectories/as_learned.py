"""Movements that come, in the coordinates that were learned: converted by the channels, or refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channels, in_words, is_plain, moving_kinds, recorded_names, same_columns
from kineme.movements.channels.column_match import are_unknown, columns_like, columns_recorded, conversion, may_be
from kineme.movements.channels.coordinates import lever_of
from kineme.movements.tables.layout import listed
from kineme.movements.trajectories.demonstrations import Demonstrations, one_by_one
from kineme.movements.trajectories.movements import in_coordinates, of_channels
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.units import converted

_SELECT = "select the dimensions by --columns in the shell, by columns= of read_recordings in Python"
_SAY = (
    "choose the columns by columns= and say what they are by kinds= of read_recordings, in the shell --columns and "
    "--kind"
)


def as_learned(
    movements: MovementsLike, learned: Channels | None, n_dims: int, what: str = "movements"
) -> Demonstrations:
    """Movements in the `n_dims` coordinates that were learned from channels; of None nothing is known but their number.

    - Without channels, positions as wide as the recorded columns are converted: angles are unwrapped, quaternions are
      integrated, discrete columns are left out. Positions as wide as the coordinates are taken as they are, but for
      wraps of angles.
    - With channels of the names that were learned, their columns are put in that order and converted to those units,
      others left aside, whatever kind their values look like.
    - With channels that may be those, as x, y, z those of a hand, or that only count, as x1, x2, x3, see
      `kineme.movements.channels.column_match.may_be`, their kinds have to be those that were learned, in their
      order, discrete ones left aside; units are converted. Else those that only count are as without channels.

    `what` they are called in messages.
    """
    several = movements if isinstance(movements, (list, tuple)) else ()
    every = {id(channels): channels for channels in (getattr(movement, "channels", None) for movement in several)}
    if len({*every.values()}) > 1:  # of all movements together nothing would be known

        def convert(movement: Any) -> Demonstrations:
            return as_learned(movement if hasattr(movement, "demonstrations") else [movement], learned, n_dims, what)

        return Demonstrations(one_by_one(several, convert))
    demos = Demonstrations.of(movements)
    if demos.channels is not None:
        return _of_kinds(demos, learned, n_dims, what)
    if learned is not None and demos.n_dims == len(recorded_names(learned)):
        return of_columns(demos, learned)
    if demos.n_dims != n_dims:
        raise TrajectoryError(_of_width(demos, learned, n_dims, what))
    return demos


def _of_kinds(demos: Demonstrations, learned: Channels | None, n_dims: int, what: str) -> Demonstrations:
    """Movements with channels."""
    channels = demos.channels or ()
    if learned is None:  # learned as plain columns: so is what is asked
        plain = demos if demos.n_dims == n_dims else as_recorded(demos)
        if plain.n_dims == n_dims:
            return plain
        raise TrajectoryError(_of_width(demos, learned, n_dims, what))
    if same_columns(channels, learned):
        return Demonstrations.of_movements(in_coordinates(demos.movements), demos.steps)
    moving = tuple(channel for channel in learned if channel.coordinates)
    for wanted in (learned, moving):  # discrete columns, too, where all of them are there
        if {*columns_recorded(wanted).names} <= {*columns_recorded(channels).names}:
            return by_names(demos, wanted, known_units=False)
    if moving_kinds(channels) == moving_kinds(learned):
        _check_names(channels, moving, what)
        return _in_units(Demonstrations.of_movements(in_coordinates(demos.movements), demos.steps), learned)
    unknown = is_plain(channels) and (are_unknown(channels) or are_unknown(learned))
    if unknown and demos.n_dims == len(recorded_names(learned)):  # as without channels
        _check_names(channels, moving, what)
        return of_columns(as_recorded(demos), learned)
    _check_lacking(channels, moving, what)
    if is_plain(channels) and is_plain(learned) and demos.n_dims != n_dims:
        raise TrajectoryError(_of_width(demos, learned, n_dims, what))
    raise TrajectoryError(
        f"expected {what} recorded as {in_words(learned)}, as those that were learned, got {in_words(channels)}; "
        f"{_SAY}, or learn these apart"
    )


def _of_width(demos: Demonstrations, learned: Channels | None, n_dims: int, what: str) -> str:
    """Say what is wrong with movements of another width."""
    if learned is None or is_plain(learned):
        learned_of = "" if learned is None else f", where those that were learned are {in_words(learned)}"
        return f"expected {what} of {n_dims} dimensions as learned, got {demos.n_dims}{learned_of}; {_SELECT}"
    return (
        f"expected {what} of {len(recorded_names(learned))} columns, {in_words(learned)}, or of the {n_dims} "
        f"coordinates that are learned of them, got {demos.n_dims} columns; {_SELECT}"
    )


def of_columns(demos: Demonstrations, learned: Channels) -> Demonstrations:
    """Movements whose positions are recorded columns, by what these are."""
    if all(channel.kind == "position" for channel in learned):
        return demos
    raw = replace(demos.movements, channels=None, recorded=None)
    return Demonstrations.of_movements(of_channels(raw, learned), demos.steps)


def by_names(demos: Demonstrations, learned: Channels, known_units: bool = True) -> Demonstrations:
    """Movements whose channels have the names of `learned`, in that order and unit, and of those kinds."""
    raw = as_recorded(demos)
    ours, wanted = columns_recorded(demos.channels or ()), columns_recorded(learned)
    positions = np.ascontiguousarray(columns_like(raw.positions, ours, wanted, known_units))
    return of_columns(Demonstrations.of_movements(replace(raw.movements, positions=positions), demos.steps), learned)


def _check_lacking(channels: Channels, moving: Channels, what: str) -> None:
    """Refuse columns of which some have names that were learned, while others of these names are not there."""
    ours, wanted = columns_recorded(channels), columns_recorded(moving)
    lost = [head for head, name in zip(wanted.heads, wanted.names, strict=True) if name not in ours.names]
    if len(lost) < len(wanted.heads) and not may_be(channels, moving):
        raise TrajectoryError(
            f"expected {what} with the columns {listed(lost)} too, which were learned, got {listed(ours.heads)}; "
            f"record them, or {_SAY}"
        )


def _check_names(channels: Channels, moving: Channels, what: str) -> None:
    """Refuse to compare columns in their order that have other names, or a name that was learned in another place."""
    recorded = tuple(channel for channel in channels if channel.coordinates)
    ours, wanted = columns_recorded(recorded), columns_recorded(moving)
    place = {name: k for k, name in enumerate(wanted.names)}
    if not may_be(recorded, moving) or any(place.get(name, k) != k for k, name in enumerate(ours.names)):
        raise TrajectoryError(
            f"expected {what} of the columns {listed(wanted.heads)}, as those that were learned, got "
            f"{listed(ours.heads)}; choose the columns of these names with columns= of read_recordings, in the shell "
            "--columns; or take others in their order: in the shell --columns with their numbers, in Python movements "
            "of their positions alone"
        )


def as_recorded(demos: Demonstrations) -> Demonstrations:
    """The recorded columns as plain positions, of which nothing else is known."""
    plain = replace(demos.movements, positions=demos.recorded, recorded=None, channels=None, dimensions=None)
    return Demonstrations.of_movements(plain, demos.steps)


def _in_units(demos: Demonstrations, learned: Channels) -> Demonstrations:
    """Coordinates in the units of those that were learned, where both are known; rotations as beside those learned."""
    channels = demos.channels or ()
    moving = [[channel for channel in some if channel.coordinates] for some in (channels, learned)]
    ours, theirs = (next((channel.unit for channel in some if channel.kind == "position"), None) for some in moving)
    ratio = 1.0 if ours is not None and theirs is None else lever_of(learned) / lever_of(channels)
    positions, k = np.array(demos.positions), 0
    for channel, other in zip(*moving, strict=True):
        columns = slice(k, k := k + len(channel.coordinates))
        if channel.kind == "orientation":
            positions[:, columns] *= ratio
        elif (sizes := conversion(channel.name, channel.unit, other.unit, known_units=False)) is not None:
            positions[:, columns] = converted(positions[:, columns], *sizes)
    return Demonstrations.of_movements(replace(demos.movements, positions=positions), demos.steps)
