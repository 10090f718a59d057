"""Many movements of unequal length and sampling, stored contiguously."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import DataError, TrajectoryError, warn
from kineme.movements.channels.channel import Channels, recorded_names
from kineme.movements.channels.column_match import columns_detected, columns_like, in_one_unit
from kineme.movements.channels.coordinates import in_order
from kineme.movements.channels.detect import find_channels
from kineme.movements.tables.layout import Column, Layout, Parsed
from kineme.movements.trajectories.collect import collect_arrays, collect_trajectories
from kineme.movements.trajectories.labels import as_indices, label_array, spelled_alike
from kineme.movements.trajectories.movements import Movements, Samples, axis_names, of_channels
from kineme.movements.trajectories.presented import Presented, with_units
from kineme.movements.trajectories.trajectory import MovementsLike, Trajectory, unchecked
from kineme.validation import Array, as_array, describe

_SHOWN = 8  # names of dimensions
_NESTED = 8  # records around movements; more are a mistake, such as a stand-in that has every attribute


class Demonstrations(Presented, Sequence[Trajectory]):
    """An immutable sequence of `Trajectory`, stored as one block so that batch work never loops in Python.

    Parameters
    ----------
    trajectories : sequence of Trajectory
        All of the same number of dimensions. For plain arrays use `from_arrays`.

    Attributes
    ----------
    positions : ndarray of shape (total, d)
        All samples of all movements, one movement after the other; read-only.
    offsets : ndarray of shape (n + 1,)
        Movement i holds the samples ``offsets[i]:offsets[i + 1]``.
    labels : ndarray of shape (n,) or None
        The action that each movement shows.
    names : tuple of str or None
        Where each movement comes from.
    steps : tuple
        The preprocessing steps applied so far, in order.

    Raises
    ------
    TrajectoryError
        No movement at all, or movements of different dimensions; the message names the first such movement.
    """

    def __init__(self, trajectories: Sequence[Trajectory]) -> None:
        self._hold(collect_trajectories(trajectories))

    def _hold(self, movements: Movements, steps: tuple[Any, ...] = ()) -> None:
        self.movements = movements
        self.steps = steps

    @classmethod
    def from_arrays(
        cls,
        arrays: ArrayLike | Sequence[ArrayLike],
        labels: ArrayLike | None = None,
        times: Sequence[ArrayLike] | Array | None = None,
        names: Sequence[str | None] | None = None,
        copy: bool = True,
    ) -> Demonstrations:
        """Collect plain arrays.

        Parameters
        ----------
        arrays : sequence of n arrays (T_i, d), or one array (n, T, d)
            Positions. One array (T, d) or (T,) is one movement.
        labels : array_like of shape (n,), optional
            The action that each movement shows.
        times : sequence of n arrays (T_i,), or one array (T,) shared by all, optional
            Time stamps [s]. Without them, each movement is taken as evenly sampled over one second.
        names : sequence of n str, optional
            Where each movement comes from.
        copy : bool, default True
            Whether to copy an (n, T, d) array that could be used in place. Lists are always copied.
        """
        return cls.of_movements(collect_arrays(arrays, labels, times, names, copy))

    @classmethod
    def from_dataframe(  # noqa: PLR0913 - one parameter per question that columns may leave open
        cls,
        frames: Any,
        *,
        time: Column | None = None,
        columns: Column | Sequence[Column] | None = None,
        movement: Column | Sequence[Column] | None = None,
        label: Column | None = None,
        units: str | float | None = None,
        kinds: Mapping[str, str] | None = None,
    ) -> Demonstrations:
        """Collect the movements of data frames of pandas or polars, by the names of their columns, as in files.

        A frame is one movement, or many that a column tells apart. What is not said is found by name: time stamps in a
        column, or an index, called ``t``, ``time [ms]``, ``timestamp``; movements by ``demo``, ``trial``, ``episode``;
        labels by ``label``, ``gesture``. All other columns of numbers are coordinates, and `dimensions` says which they
        are; counters such as ``frame``, and velocities ``v_x`` beside ``x``, are left aside.

        Parameters
        ----------
        frames : DataFrame, groups of one as ``groupby`` makes them, or sequence of DataFrame
            With the same coordinates in the same order.
        time, label : str or int, optional
            Columns by name, or counted from 0.
        columns, movement : str or int or sequence of them, optional
            Columns of the coordinates, and of what tells movements apart.
        units : {"s", "ms", "us", "ns"} or float, optional
            Unit of the time stamps, or its length in seconds; by default told by the name or by the stamps' size. As a
            number it is also the step between samples of frames without time stamps.
        kinds : mapping, optional
            What columns are, see `read_recordings`: an orientation is learned as its rotation.

        Raises
        ------
        TrajectoryError
            No column of times that is known by its name or given, several of them, no coordinates, or samples that
            are no movement; the message lists the columns.
        """
        several = frames_of(frames) or list(frames)
        layout = Layout(time, columns, movement, label, units, kinds=kinds)
        return cls.of_movements(collect_data_frames(several, layout))

    @classmethod
    def of(cls, movements: MovementsLike) -> Demonstrations:
        """Whatever public functions accept as movements, as `Demonstrations`.

        Parameters
        ----------
        movements : MovementsLike
            - `Demonstrations`, or what has them as its ``demonstrations``: what `read_recordings` and `segment` return,
              and rollouts.
            - One `Trajectory`, or one array of shape (T, d) or (T,): one movement.
            - One array of shape (n, T, d): n movements, used without a copy.
            - One data frame of pandas or polars, see `from_dataframe`; or the groups of one, as ``groupby`` makes them.
            - A list of `Trajectory`, of (T_i, d) arrays, or of anything above, mixed or in lists of their own. A list
              is always many movements, also one of plain numbers in lists.

            Movements without time stamps are taken as evenly sampled over one second.

        Raises
        ------
        TrajectoryError
            What is none of these; no movement at all; movements of different dimensions; an array without time stamps
            of more dimensions than samples, which is taken for a transposed one.
        """
        if isinstance(movements, Demonstrations):
            return movements
        if (held := _held_by(movements)) is not movements:
            return cls.of(held)
        if (frames := frames_of(movements)) is not None:
            return cls.from_dataframe(frames)
        several: Any = [movements] if isinstance(movements, Trajectory) else as_array(movements)
        if isinstance(several, np.ndarray) and several.dtype == object:
            several = several.tolist()
        if isinstance(several, Sequence):
            if several and all(map(is_data_frame, several)):
                return cls.from_dataframe(several)
            if any(map(_holds_movements, [] if _are_paths(several) else several)):
                return cls(one_by_one(several, lambda held: [held] if isinstance(held, Trajectory) else cls.of(held)))
        return cls.from_arrays(several, copy=False)

    @classmethod
    def of_movements(cls, movements: Movements, steps: tuple[Any, ...] = ()) -> Demonstrations:
        """`Demonstrations` from a block that has been checked already."""
        new = cls.__new__(cls)
        new._hold(movements, steps)
        return new

    @property
    def positions(self) -> Array:  # noqa: D102 - documented by the class
        return self.movements.positions

    @property
    def offsets(self) -> NDArray[np.intp]:  # noqa: D102
        return self.movements.offsets

    @property
    def labels(self) -> NDArray[Any] | None:  # noqa: D102
        return self.movements.labels

    @property
    def names(self) -> tuple[str | None, ...] | None:  # noqa: D102
        return self.movements.names

    @property
    def dimensions(self) -> tuple[str, ...] | None:
        """Names of the d dimensions, where they come from named columns."""
        return self.movements.dimensions

    @property
    def channels(self) -> Channels | None:
        """Recorded quantities, where known: positions, angles, orientations, discrete values, with their names.

        An orientation is learned as three coordinates of `positions`, a discrete channel is none of them.
        """
        return self.movements.channels

    @property
    def recorded(self) -> Array:
        """The columns of the `channels` as recorded, shape (total, columns); without channels the `positions`.

        Orientations are quaternions of norm 1 in the order of the file, whose signs do not jump.
        """
        return self.positions if self.movements.recorded is None else self.movements.recorded

    @property
    def times(self) -> Array:
        """Time stamps of all samples, shape (total,) [s]."""
        return self.movements.stamps

    @property
    def durations(self) -> Array:
        """Time from first to last sample of each movement, shape (n,) [s]."""
        return self.movements.durations

    @property
    def n_dims(self) -> int:
        """Number of dimensions d."""
        return int(self.positions.shape[1])

    @property
    def lengths(self) -> NDArray[np.intp]:
        """Number of samples of each movement, shape (n,)."""
        return np.diff(self.offsets)

    @property
    def even_length(self) -> int | None:
        """The common number of samples when all movements have it and are evenly sampled, else None."""
        return self.movements.even_length

    @property
    def _samples(self) -> Samples:
        names = with_units(self.dimensions or tuple(axis_names(self.n_dims)), self.channels)
        heads = names if self.channels is None else with_units(recorded_names(self.channels), self.channels)
        return Samples(self.times, self.offsets, self.positions, names, self.recorded, heads, self.labels)

    def __len__(self) -> int:
        return len(self.offsets) - 1

    @overload
    def __getitem__(self, index: int) -> Trajectory: ...
    @overload
    def __getitem__(self, index: slice | Sequence[int] | NDArray[Any]) -> Demonstrations: ...
    def __getitem__(self, index: Any) -> Trajectory | Demonstrations:
        """One `Trajectory` for an integer; `Demonstrations` for a slice, a mask or a list of indices."""
        chosen = as_indices(index, len(self))
        return (
            self._trajectory(int(chosen))
            if chosen.ndim == 0
            else self.of_movements(self.movements.take(chosen), self.steps)
        )

    def __iter__(self) -> Iterator[Trajectory]:
        return (self._trajectory(i) for i in range(len(self)))

    def _trajectory(self, i: int) -> Trajectory:
        """Movement i; built without checking again, and sharing this block's memory."""
        rows = slice(self.offsets[i], self.offsets[i + 1])
        return unchecked(
            times=self.times[rows],
            positions=self.positions[rows],
            label=None if self.labels is None else self.labels[i : i + 1].tolist()[0],
            name=None if self.names is None else self.names[i],
            channels=self.channels,
            recorded=self.recorded[rows],
        )

    def __repr__(self) -> str:
        n_labels = "" if self.labels is None else f", {len(np.unique(self.labels))} labels"
        low, high = int(self.lengths.min()), int(self.lengths.max())
        samples = low if low == high else f"{low} to {high}"
        names = self.dimensions or ()
        listed = f" ({', '.join(names[:_SHOWN])}{', ...' if len(names) > _SHOWN else ''})" if names else ""
        each = f"{self.n_dims} dims{listed}, {samples} samples each{n_labels}"
        return f"Demonstrations({len(self)} movements, {each})"


def _held_by(movements: Any) -> Any:
    """Take movements out of the records around them; return anything else as it is."""
    inner = movements
    for _ in range(_NESTED):
        held = getattr(inner, "demonstrations", None)
        if held is None or held is inner:
            return inner
        inner = held
    raise TrajectoryError(
        f"expected movements, got {type(movements).__name__}, whose demonstrations have demonstrations without end; "
        "pass Demonstrations, a list of Trajectory, or arrays"
    )


def _are_paths(items: Sequence[Any]) -> bool:
    """Tell at once of a list, which may be long, that it holds nothing but arrays (T, d)."""
    return set(map(type, items)) == {np.ndarray} and set(map(attrgetter("ndim"), items)) == {2}


def _holds_movements(item: Any) -> bool:
    """Tell whether an item of a list is more than one array (T, d) of numbers."""
    if isinstance(item, np.ndarray) and item.dtype == object:
        item = item.tolist()
    if isinstance(item, (list, tuple)):
        return len(item) > 0 and (getattr(item[0], "ndim", 0) == 2 or _holds_movements(item[0]))
    if getattr(item, "ndim", 0):
        return item.ndim == 3
    return isinstance(item, (Trajectory, Demonstrations)) or hasattr(item, "demonstrations") or is_data_frame(item)


def one_by_one(several: Sequence[Any], convert: Callable[[Any], Iterable[Trajectory]]) -> list[Trajectory]:
    """The movements that each item of a list is converted to; errors name its index."""
    trajectories: list[Trajectory] = []
    for i, movement in enumerate(several):
        try:
            trajectories += convert(movement)
        except TrajectoryError as error:
            raise TrajectoryError(f"index {i} of the list: {error}") from error
    return trajectories


def require_labels(demonstrations: Demonstrations) -> NDArray[Any]:
    """The labels, or an error that says how to give them."""
    if demonstrations.labels is None:
        raise TrajectoryError(
            "expected labeled demonstrations, got none with a label; "
            "pass y to fit, labels= to Demonstrations.from_arrays, or label= to each Trajectory"
        )
    return demonstrations.labels


def check_labels(demos: Demonstrations, y: Any) -> NDArray[Any]:
    """Labels `y`, or those of the demonstrations: one per movement, texts or numbers, none of them empty."""
    labels = require_labels(demos) if y is None else label_array(y, len(demos), demos.names)
    for i, label in enumerate(labels.tolist()):
        if isinstance(label, (list, tuple, dict)) or (isinstance(label, str) and not label.strip()):
            raise TrajectoryError(
                f"{describe(i, demos.names)}: expected a label that is text or a number, got {label!r}; "
                "name the action, or leave the movement out"
            )
    try:
        np.sort(labels)
    except TypeError as error:
        raise TrajectoryError(
            f"expected labels that are texts or numbers, as classes have an order, got {error}"
        ) from None
    return spelled_alike(labels)


def is_data_frame(value: Any) -> bool:
    """Tell whether this is a data frame, of pandas, of polars, or of another package with their names."""
    return hasattr(value, "columns") and hasattr(value, "to_numpy") and hasattr(value, "__getitem__")


def frames_of(value: Any) -> list[Any] | None:
    """The data frames of one, of its groups as ``groupby`` makes them, or of a list of (key, group); else None."""
    if is_data_frame(value):
        return [value]
    if not hasattr(value, "get_group") and not isinstance(value, list):
        return None
    pairs = list(value)
    if pairs and all(isinstance(pair, tuple) and len(pair) == 2 and is_data_frame(pair[1]) for pair in pairs):
        return [frame for _, frame in pairs]
    return None


def collect_data_frames(frames: Sequence[Any], layout: Layout) -> Movements:
    """The movements of all frames, with their dimensions' names; see `Demonstrations.from_dataframe`."""
    if not frames:
        raise TrajectoryError("expected at least one data frame, got none")
    parsed = [_parse(frame, i, layout) for i, frame in enumerate(frames)]
    if converted := [*dict.fromkeys(said for frame in parsed for said in frame.detected.converted)]:
        warn(f"units are converted to those of most columns: {', '.join(converted)}", UserWarning, 3)
    first = columns_detected(parsed[0].detected)
    dimensions, blocks = first.heads, []
    for i, frame in enumerate(parsed):
        own = columns_detected(frame.detected)
        if {*own.names} != {*first.names}:
            raise TrajectoryError(
                f"data frame {i}: expected the coordinates {list(dimensions)} as in data frame 0, got "
                f"{list(frame.detected.columns)}; say which with columns= of Demonstrations.from_dataframe"
            )
        try:
            blocks.append(replace(frame.block, positions=columns_like(frame.block.positions, own, first)))
        except TrajectoryError as error:
            raise TrajectoryError(f"data frame {i}: {error}") from error
    pieces = [(block, slice(*rows)) for block in blocks for rows in zip(block.offsets, block.offsets[1:], strict=False)]
    labels: Any = [label for block in blocks for label in block.labels]
    places = [place or None for block in blocks for place in block.places]
    movements = collect_arrays(
        [block.positions[rows] for block, rows in pieces],
        None if labels.count(None) == len(labels) else labels,
        [block.times[rows] for block, rows in pieces if block.times is not None],
        places if any(places) else None,
        copy=True,
    )
    channels = find_channels(dimensions, movements.positions, movements.offsets, layout.kinds or {})
    movements = replace(movements, positions=in_order(movements.positions, dimensions, channels))
    return of_channels(movements, channels)


def _parse(frame: Any, i: int, layout: Layout) -> Parsed:
    from kineme.movements.tables.table import parse_data_frame  # what columns mean loads with the first frame

    if not is_data_frame(frame):
        raise TrajectoryError(f"expected data frames, got {type(frame).__name__} at index {i}; pass them one by one")
    try:
        return Parsed(*in_one_unit(*parse_data_frame(frame, layout)[:2]))
    except DataError as error:
        raise TrajectoryError(f"data frame {i}: {error} (of Demonstrations.from_dataframe)") from error


class MovementSequence(Presented):
    """A sequence of the movements in `demonstrations`, a field or property of the subclass."""

    if TYPE_CHECKING:  # read-only here

        @property
        def demonstrations(self) -> Demonstrations:
            """The movements."""

    @property
    def _samples(self) -> Samples:
        return self.demonstrations._samples

    def __iter__(self) -> Iterator[Trajectory]:
        return iter(self.demonstrations)

    @overload
    def __getitem__(self, index: int) -> Trajectory: ...
    @overload
    def __getitem__(self, index: slice | Sequence[int] | NDArray[Any]) -> Demonstrations: ...
    def __getitem__(self, index: Any) -> Trajectory | Demonstrations:
        """One `Trajectory` for an integer; `Demonstrations` for a slice, a mask or a list of indices."""
        return self.demonstrations[index]
