"""What a channel of a recording is, and the kinds of channels."""

from __future__ import annotations

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
    """

    name: str
    kind: str
    columns: tuple[str, ...]
    unit: str | None = None
    order: str = ""

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates that are learned."""
        if self.kind == "orientation":
            return tuple(f"{self.name}.r{axis}" for axis in "xyz")
        return self.columns if KINDS[self.kind] else ()


Channels = tuple[Channel, ...]


def learned_names(channels: Channels) -> tuple[str, ...]:
    """Names of all coordinates that are learned, in order."""
    return tuple(name for one in channels for name in one.coordinates)


def recorded_names(channels: Channels) -> tuple[str, ...]:
    """Heads of all columns, channel after channel."""
    return tuple(name for one in channels for name in one.columns)


def is_plain(channels: Channels) -> bool:
    """Whether every column is learned as it was recorded, but for wraps of angles."""
    return all(one.kind in ("position", "angle") for one in channels)
