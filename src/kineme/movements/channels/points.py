"""Points among the columns of a recording: hands, markers, joints of a body, by the names of their coordinates."""

from __future__ import annotations

from typing import Any

from kineme.movements.channels.channel import Channels
from kineme.movements.channels.detect import name_of
from kineme.movements.tables.time_stamps import words_of

#: Quantities with three axes that are no places.
_NO_PLACES = {"acc", "accel", "acceleration", "gyro", "gyroscope", "rate", "omega", "mag", "magnetometer", "force",
              "torque", "velocity", "vel", "speed", "emg", "euler"}  # fmt: skip


def count_points(channels: Channels | None) -> int:
    """Return how many points the columns are, one after the other: x, y, z or x, y of each, under one name.

    1 where they are anything else: one point, other quantities, other orders, or no names.
    """
    for axes in ("xyz", "xy"):
        n, d = len(channels or ()), len(axes)
        if channels is None or n < 2 * d or n % d:
            continue
        names = [_name_and_axis(channel) for channel in channels]
        points = [names[k : k + d] for k in range(0, n, d)]
        stems = [point[0][0] for point in points]
        if len({*stems}) == len(stems) and all(
            [axis for _, axis in point] == [*axes] and len({stem for stem, _ in point}) == 1 for point in points
        ):
            return len(points)
    return 1


def _name_and_axis(channel: Any) -> tuple[str, str]:
    """Return what a column belongs to, and which coordinate it is; empty where that is not told."""
    words = words_of(name_of(channel.name))
    if channel.kind != "position" or len(words) < 2 or {*words} & _NO_PLACES:
        return "", ""
    return ("_".join(words[:-1]), words[-1]) if words[-1] in {*"xyz"} else ("_".join(words[1:]), words[0])
