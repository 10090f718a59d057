"""The record of a channel of a recording, its kinds, and channels as plain data for headers of files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

from kineme.errors import TrajectoryError
from kineme.units import Unit, unit_named

#: Kind -> number of coordinates that a movement primitive learns from one such channel.
KINDS = {"position": 1, "angle": 1, "orientation": 3, "discrete": 0}

#: Orders of the components of a quaternion that files have.
ORDERS = ("wxyz", "xyzw")


class Channel(NamedTuple):
    """One quantity of a recording.

    Its kind is ``"position"``, any quantity that moves on a line, learned as it is; ``"angle"``, a joint, learned
    without the jumps where it wraps; ``"orientation"``, a unit quaternion, learned as three coordinates, its rotation
    integrated along time [rad], beside positions times 0.2 m; or ``"discrete"``, a gripper or a button, kept as the
    steps that were recorded, and never learned.

    - `name`: the head of its column; of an orientation, what the heads of its four columns share.
    - `columns`: heads of its columns: four of an orientation, one of the others. Side by side in what is recorded, in
      the order of the file as far as `order` can say it.
    - `unit`: from the head, such as ``"deg"``; None if the file does not say.
    - `order`: components of the columns of an orientation, ``"wxyz"`` or ``"xyzw"``; else empty.
    - `period`: what an angle wraps by if its unit does not say it, by the values that were recorded; 0 if it does not
      wrap.
    """

    name: str
    kind: str
    columns: tuple[str, ...]
    unit: str | None = None
    order: str = ""
    period: float | None = None

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates that are learned."""
        if self.kind == "orientation":
            return tuple(f"{self.name}.r{axis}" for axis in "xyz")
        return self.columns if KINDS[self.kind] else ()


Channels = tuple[Channel, ...]

_LISTED = 12  # channels that a message names one by one


def learned_names(channels: Channels) -> tuple[str, ...]:
    """Names of all coordinates that are learned, in order."""
    return tuple(name for channel in channels for name in channel.coordinates)


def recorded_names(channels: Channels) -> tuple[str, ...]:
    """Heads of all columns, channel after channel."""
    return tuple(name for channel in channels for name in channel.columns)


def is_plain(channels: Channels) -> bool:
    """Tell whether every column is learned as it was recorded, but for wraps of angles."""
    return all(channel.kind in ("position", "angle") for channel in channels)


def moving_kinds(channels: Channels) -> tuple[str, ...]:
    """Kinds of the channels that are learned, in order; names are free, and so is what is discrete."""
    return tuple(channel.kind for channel in channels if channel.coordinates)


def same_columns(channels: Channels | None, others: Channels | None) -> bool:
    """Tell whether channels are equal, but for the periods that were told by values."""
    if channels is None or others is None or channels == others:
        return channels == others
    return [channel._replace(period=None) for channel in channels] == [other._replace(period=None) for other in others]


def in_words(channels: Channels | None) -> str:
    """Channels with their kinds, as messages name them; of many, how many there are of each kind."""
    if channels is None:
        return "plain coordinates"
    if len(channels) > _LISTED:
        return ", ".join(f"{n} {kind} channels" for kind, n in Counter(channel.kind for channel in channels).items())
    columns = [f" in {', '.join(channel.columns)}" if channel.kind == "orientation" else "" for channel in channels]
    return ", ".join(
        f"{channel.name} ({channel.kind}{where})" for channel, where in zip(channels, columns, strict=True)
    )


def check_alike(several: Sequence[Channels | None], what: str = "part") -> None:
    """Refuse channels whose columns do not mean the same, where that is known; `what` messages call each of `several`.

    Columns of equal names are the same, whatever their kinds were guessed to be. Those of other names may be the other
    hand's: they need the same kinds, and not the same names in another order.
    """
    detected = [(i, channels) for i, channels in enumerate(several) if channels is not None]
    for i, channels in detected[1:]:
        first, ours = detected[0]
        if (wrong := _difference(ours, channels)) is not None:
            raise TrajectoryError(
                f"{what} {i}: expected movements of {in_words(ours)}, as {what} {first}, got {in_words(channels)}: "
                f"{wrong}; read the columns that belong together, in the same order and unit"
            )


def _difference(ours: Channels, theirs: Channels) -> str | None:
    """Say what keeps channels from being the same columns, or None."""
    names, others = learned_names(ours), learned_names(theirs)
    if names != others:
        if [channel.kind for channel in ours] != [channel.kind for channel in theirs]:
            return "their kinds differ"
        if sorted(names) == sorted(others):
            return "their order differs"
    for channel, other in zip(ours, theirs, strict=False):
        if channel.unit is not None and other.unit is not None and _measure(channel) != _measure(other):
            return f"{channel.name} is in {channel.unit}, {other.name} in {other.unit}"
    return None


def _measure(channel: Channel) -> Unit | str:
    """The same for all spellings of a unit."""
    return unit_named(channel.unit or "") or (channel.unit or "").lower()


def channels_to_data(channels: Channels) -> list[dict[str, Any]]:
    """A list of objects with the fields of `Channel`, as JSON can hold them."""
    return [channel._asdict() | {"columns": list(channel.columns)} for channel in channels]


def channels_from_data(data: Any, n_dims: int) -> Channels:
    """The inverse, of movements of so many dimensions; callers name the file that holds anything else."""
    channels = tuple(_channel(fields) for fields in data)
    if sum(len(channel.coordinates) for channel in channels) != n_dims:
        raise ValueError(f"channels should have {n_dims} coordinates")
    return channels


def _channel(fields: dict[str, Any]) -> Channel:
    columns, unit = tuple(fields["columns"]), fields["unit"]
    period = fields.get("period", 0.0)  # earlier versions did not say it
    channel = Channel(fields["name"], fields["kind"], columns, unit, fields["order"], period)
    texts = [channel.name, *columns, *([] if unit is None else [unit])]
    sized = len(columns) == (4 if channel.kind == "orientation" else 1)
    ordered = channel.order in ORDERS if channel.kind == "orientation" else channel.order == ""
    periodic = period is None or (isinstance(period, float) and math.isfinite(period) and period >= 0)
    texts_only = periodic and all(isinstance(text, str) for text in texts)
    if channel.kind not in KINDS or not (sized and ordered and texts_only):
        raise ValueError("channels should have a name, a kind, columns, a unit, an order and a period")
    return channel
