"""Episodes of robot data of any layout, one after the other: the table of layouts, and which of them a path holds."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from kineme.errors import DataError, SpecificationError
from kineme.io.arrays.robot_sets import LAYOUTS, robot_episodes, robot_layout
from kineme.io.lerobot.info import MARKER
from kineme.io.records import needs
from kineme.movements.episodes import Episode
from kineme.reporting.text import first_names

_NEAR = 3  # data sets in a folder, or around it, that a message names


class EpisodeLayout(NamedTuple):
    """A layout of files that holds episodes of robot data."""

    name: str
    # Whether a file or folder has it; reads little, and raises a `DataError` only if a package is missing.
    fits: Callable[[Path], bool]
    # The path, the names of the features to read, None for all of numbers, and a rate [1/s], None for that of the set
    # or of the custom, -> episodes as they are stored.
    read: Callable[[Path, Sequence[str] | None, float | None], Iterator[Episode]]


def _lerobot(
    path: Path, features: Sequence[str] | None, rate: float | None, numbers: Collection[int] | None = None
) -> Iterator[Episode]:
    if rate is not None:
        raise SpecificationError(f"expected no rate for a data set of LeRobot, which has stamps, got {rate:g}")
    with needs("pyarrow", "read LeRobot", "parquet"):
        from kineme.io.lerobot.episodes import episodes
    return episodes(path, features, numbers)


#: Layouts in the order in which they are tried.
EPISODE_LAYOUTS: tuple[EpisodeLayout, ...] = (
    EpisodeLayout("LeRobot", lambda path: (path / MARKER).is_file(), _lerobot),
    EpisodeLayout(
        ", ".join(row.name for rows in LAYOUTS.values() for row in rows),
        lambda path: robot_layout(path) is not None,
        robot_episodes,
    ),
)


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
    layout = next((layout for layout in EPISODE_LAYOUTS if layout.fits(path)), None)
    within = sorted(marker.parents[1] for marker in path.glob(f"*/{MARKER}"))
    if layout is not None and (layout is EPISODE_LAYOUTS[0] or not within):
        if layout is EPISODE_LAYOUTS[0]:
            return _lerobot(path, features, rate, numbers)
        return layout.read(path, features, rate)
    there = "nothing there" if not path.exists() else "another" if layout is None else "several"
    layouts = ", ".join(layout.name for layout in EPISODE_LAYOUTS)
    around = [folder for folder in path.absolute().parents[:3] if (folder / MARKER).is_file()]
    near = around or within
    remedy = f"; say the folder of one: {first_names(near, _NEAR)}" if near and path.exists() else ""
    raise DataError(f"expected a data set of episodes ({layouts}), got {there}: {path}{remedy}")
