"""BVH: a hierarchy of joints with their channels, and one line of numbers for each frame.

Source: Biovision's format as Meredith and Maddock, "Motion Capture File Formats Explained", 2001, describe it. Channels
are named ``Joint.Xposition`` and ``Joint.Zrotation``; rotations are in degrees, positions in a unit that no file says.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import islice

import numpy as np

from kineme.errors import DataError
from kineme.io.limits import check_expanded
from kineme.io.motion_capture.export_heads import positive
from kineme.movements.channels.column_match import Columns
from kineme.movements.tables.columns import Roles, choose_roles
from kineme.movements.tables.layout import Layout
from kineme.movements.tables.table import Table

_STAMP = "time [s]"
_MOST_CHANNELS = 10_000


def read_bvh_table(data: bytes, layout: Layout) -> tuple[Table, Roles]:
    """The channels of a BVH file and its time stamps, from the time of a frame."""
    check_expanded(3 * len(data))
    lines = data.decode("utf-8", "replace").lstrip("\ufeff").splitlines()
    if not lines or next((line.strip() for line in lines if line.strip()), "").upper() != "HIERARCHY":
        raise DataError("expected a BVH file that begins with HIERARCHY, got something foreign")
    at = next((k for k, line in enumerate(lines) if line.strip().upper() == "MOTION"), None)
    if at is None:
        raise DataError("expected MOTION below the hierarchy of a BVH file, got none: a truncated file")
    channels = _channels(lines[:at])
    step, first = _step(lines, at)
    values, faults = _values(lines, first, len(channels))
    heads = (_STAMP, *channels)
    units = ("s", *("deg" if name.lower().endswith("rotation") else "" for name in channels))
    columns = [np.arange(len(values)) * step, *values.T]
    numbered = [k for k in range(first, len(lines)) if lines[k].strip()]
    table = Table(heads, columns, len(values), lambda row: numbered[row] + 1, faults, measured_in=units, maker="")
    roles = choose_roles(heads, ("number",) * len(heads), layout)
    # Refuse rotations of a joint in another order than that of the file, which says which axis turns first.
    chosen, of_file = (
        Columns(tuple(heads[k] for k in places), ()).rotations for places in (roles.positions, sorted(roles.positions))
    )
    for joint, axes in chosen.items():
        if axes != of_file[joint]:
            raise DataError(
                f"expected the rotations of {joint!r} in the order {of_file[joint]}, as the file has them, got {axes}, "
                "which are other angles of the same turns; export all files in one order"
            )
    return table, roles


def _channels(lines: Sequence[str]) -> list[str]:
    """The channels of all joints in their order."""
    joint, names = "", []
    for k, line in enumerate(lines, 1):
        words = line.split()
        key = words[0].upper() if words else ""
        if key in ("ROOT", "JOINT"):
            joint = " ".join(words[1:])
        elif key == "CHANNELS":
            count = words[1] if len(words) > 1 else ""
            if not joint or not count.isdecimal() or int(count) != len(words) - 2:
                raise DataError(
                    f"expected a joint's number of channels and their names in line {k}, got {line.strip()!r}"
                )
            names += [f"{joint}.{channel}" for channel in words[2:]]
    if not 0 < len(names) <= _MOST_CHANNELS:
        raise DataError(f"expected joints with channels in the hierarchy of a BVH file, got {len(names)} channels")
    return names


def _step(lines: Sequence[str], at: int) -> tuple[float, int]:
    """Seconds between frames, and the line of the first frame, counted from 0."""
    for k, line in enumerate(islice(lines, at + 1, at + 6), at + 1):
        key, colon, value = line.partition(":")
        if colon and key.strip().lower() == "frame time":
            if (step := positive(value.strip())) is None:
                raise DataError(f"expected the time of a frame above 0 s in line {k + 1}, got {value.strip()!r}")
            return step, k + 1
    raise DataError("expected 'Frame Time: SECONDS' below MOTION, got none: a truncated or damaged file")


def _values(
    lines: Sequence[str], first: int, width: int
) -> tuple[np.ndarray[tuple[int, int], np.dtype[np.float64]], dict[int, str]]:
    """The numbers of all frames, NaN in a line that is not one number per channel, and what is wrong there."""
    rows = [line for line in lines[first:] if line.strip()]
    if not rows:
        raise DataError("expected frames below the time of a frame, got none")
    check_expanded(8 * width * len(rows))
    try:
        values = np.loadtxt(io.StringIO("\n".join(rows)), comments=None, ndmin=2)
        if values.shape == (len(rows), width):
            return values, {}
    except ValueError:
        pass
    values, faults = np.full((len(rows), width), np.nan), {}
    for row, line in enumerate(rows):
        try:
            numbers = [float(word) for word in line.split()]
        except ValueError:
            faults[row] = f"expected {width} numbers, got {line.strip()[:40]!r}"
            continue
        if len(numbers) == width:
            values[row] = numbers
        else:
            faults[row] = f"expected {width} numbers, one for each channel, got {len(numbers)}"
    return values, faults
