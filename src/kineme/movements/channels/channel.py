"""What a channel of a recording is, and the kinds of channels."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

#: Kind -> number of coordinates that a movement primitive learns from one such channel.
KINDS = {"position": 1, "angle": 1, "orientation": 3, "discrete": 0}

#: Orders of the components of a quaternion that files have.
ORDERS = ("wxyz", "xyzw")


class Channel(NamedTuple):
    """One quantity of a recording.

    Attributes
    ----------
    name : str
        The head of its column; of an orientation, what the heads of its four columns share.
    kind : {"position", "angle", "orientation", "discrete"}
        - ``"position"``: any quantity that moves on a line; learned as it is.
        - ``"angle"``: a joint; learned without the jumps where it wraps.
        - ``"orientation"``: a unit quaternion; learned as three coordinates, its rotation integrated along time [rad],
          beside positions times 0.2 m.
        - ``"discrete"``: a gripper or a button; kept as the steps that were recorded, and never learned.
    columns : tuple of str
        Heads of its columns: four of an orientation, one of the others. Side by side in what is recorded, in the order
        of the file as far as `order` can say it.
    unit : str or None
        From the head, such as ``"deg"``; None if the file does not say.
    order : str
        Components of the columns of an orientation, ``"wxyz"`` or ``"xyzw"``; else empty.
    period : float or None
        What an angle wraps by if its unit does not say it, by the values that were recorded; 0 if it does not wrap.
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
    return tuple(name for one in channels for name in one.coordinates)


def recorded_names(channels: Channels) -> tuple[str, ...]:
    """Heads of all columns, channel after channel."""
    return tuple(name for one in channels for name in one.columns)


def is_plain(channels: Channels) -> bool:
    """Whether every column is learned as it was recorded, but for wraps of angles."""
    return all(one.kind in ("position", "angle") for one in channels)


def moving_kinds(channels: Channels) -> tuple[str, ...]:
    """Kinds of the channels that are learned, in order; names are free, and so is what is discrete."""
    return tuple(one.kind for one in channels if one.coordinates)


def same_columns(channels: Channels | None, others: Channels | None) -> bool:
    """Whether channels are equal, but for the periods that were told by values."""
    if channels is None or others is None or channels == others:
        return channels == others
    return [one._replace(period=None) for one in channels] == [one._replace(period=None) for one in others]


def in_words(channels: Channels | None) -> str:
    """Channels with their kinds, as messages name them; of many, how many there are of each kind."""
    if channels is None:
        return "plain coordinates"
    if len(channels) > _LISTED:
        return ", ".join(f"{n} {kind} channels" for kind, n in Counter(one.kind for one in channels).items())
    columns = [f" in {', '.join(one.columns)}" if one.kind == "orientation" else "" for one in channels]
    return ", ".join(f"{one.name} ({one.kind}{where})" for one, where in zip(channels, columns, strict=True))
