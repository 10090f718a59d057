"""Episodes of robot data of any layout, one after the other, and which layout a path has."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from kineme.errors import DataError, SpecificationError
from kineme.io.arrays.robot_sets import LAYOUTS, robot_episodes, robot_layout
from kineme.io.lerobot.info import MARKER
from kineme.io.records import needs
from kineme.movements.episodes import Episode
from kineme.reporting.text import first_names

_NEAR = 3  # data sets in a folder, or around it, that a message names


def holds_episodes(path: Path) -> bool:
    """Tell whether a file or folder is a data set of episodes; a `DataError` only if a package is missing to tell."""
    return (path / MARKER).is_file() or robot_layout(path) is not None


def read_episodes(
    path: Path | str,
    features: Sequence[str] | None = None,
    rate: float | None = None,
    numbers: Collection[int] | None = None,
) -> Iterator[Episode]:
    """Yield the episodes of a data set as they are stored, with the features of numbers, or those that are named.

    A `rate` [1/s] is that of a layout without stamps, instead of what the set says or the custom is; of another it is a
    `SpecificationError`. Of a data set of LeRobot, episodes with these `numbers` alone are read. A `DataError` names
    the layouts if the path has none of them, or says why the data set cannot be read at all; what is wrong with a
    single episode stands in its `problems`.
    """
    path = Path(path)
    if (path / MARKER).is_file():
        if rate is not None:
            raise SpecificationError(f"expected no rate for a data set of LeRobot, which has stamps, got {rate:g}")
        with needs("pyarrow", "read LeRobot", "parquet"):
            from kineme.io.lerobot.episodes import episodes
        return episodes(path, features, numbers)
    is_robot = robot_layout(path) is not None
    within = sorted(marker.parents[1] for marker in path.glob(f"*/{MARKER}"))
    if is_robot and not within:
        return robot_episodes(path, features, rate)
    there = "nothing there" if not path.exists() else "several" if is_robot else "another"
    layouts = ", ".join(["LeRobot", *(row.name for rows in LAYOUTS.values() for row in rows)])
    around = [folder for folder in path.absolute().parents[:3] if (folder / MARKER).is_file()]
    near = around or within
    remedy = f"; say the folder of one: {first_names(near, _NEAR)}" if near and path.exists() else ""
    raise DataError(f"expected a data set of episodes ({layouts}), got {there}: {path}{remedy}")
