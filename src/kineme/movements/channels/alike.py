"""Whether movements of several recordings can be parts of one: joint angles do not go on as places of a hand."""

from __future__ import annotations

from collections.abc import Sequence

from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel, Channels, in_words, learned_names
from kineme.units import Unit, unit_named


def check_alike(several: Sequence[Channels | None], what: str = "part") -> None:
    """Refuse channels whose columns do not mean the same, where that is known.

    Columns of equal names are the same, whatever their kinds were guessed to be. Those of other names may be the other
    hand's: they need the same kinds, and not the same names in another order. Units that are known are equal.

    Parameters
    ----------
    several : sequence of Channels or None
        Of each part those that are learned, in the order of its columns; None where they are not known.
    what : str, default "part"
        What the message calls one of them.

    Raises
    ------
    TrajectoryError
        Channels that differ from those of the first part whose channels are known.
    """
    known = [(i, channels) for i, channels in enumerate(several) if channels is not None]
    for i, channels in known[1:]:
        first, ours = known[0]
        if (wrong := _difference(ours, channels)) is not None:
            raise TrajectoryError(
                f"{what} {i}: expected movements of {in_words(ours)}, as {what} {first}, got {in_words(channels)}: "
                f"{wrong}; read the columns that belong together, in the same order and unit"
            )


def _difference(ours: Channels, theirs: Channels) -> str | None:
    """What keeps channels from being the same columns, or None."""
    names, others = learned_names(ours), learned_names(theirs)
    if names != others:
        if [one.kind for one in ours] != [one.kind for one in theirs]:
            return "their kinds differ"
        if sorted(names) == sorted(others):
            return "their order differs"
    for one, other in zip(ours, theirs, strict=False):
        if one.unit is not None and other.unit is not None and _measure(one) != _measure(other):
            return f"{one.name} is in {one.unit}, {other.name} in {other.unit}"
    return None


def _measure(channel: Channel) -> Unit | str:
    """The same for all spellings of a unit."""
    return unit_named(channel.unit or "") or (channel.unit or "").lower()
