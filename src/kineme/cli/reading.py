"""Read recordings for a command: the options for the columns, and the standard input."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

STANDARD_INPUT = "standard input.csv"


class Unit(click.ParamType):  # type: ignore[type-arg]
    """A unit of time by name, or its length in seconds."""

    name = "s|ms|us|ns|SECONDS"

    def convert(self, value: Any, param: Any, ctx: Any) -> str | float:
        """A number if the text is one, else the name of a unit."""
        try:
            return float(value)
        except ValueError:
            return str(value)


class Heads(click.ParamType):  # type: ignore[type-arg]
    """Columns separated by commas, as heads or as numbers counted from 0."""

    name = "a,b,..."

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[str, ...]:
        """The columns."""
        return value if isinstance(value, tuple) else tuple(part.strip() for part in value.split(","))


class Kind(click.ParamType):  # type: ignore[type-arg]
    """Columns and their kind, as ``gripper=discrete`` or ``a,b,c,d=xyzw``."""

    name = "COLUMNS=KIND"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[str, str]:
        """The columns and the kind."""
        if isinstance(value, tuple):
            return value
        columns, mark, kind = value.rpartition("=")
        if not mark or not columns:
            self.fail(f"expected columns and their kind, as gripper=discrete, got {value!r}", param, ctx)
        return columns.strip(), kind.strip()


def _or_none(ctx: Any, param: Any, value: tuple[Any, ...]) -> tuple[Any, ...] | None:
    """None where an option is not given: libraries store those that are."""
    return value or None


_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    click.option("--time", metavar="COLUMN", help="Column of the time stamps."),
    click.option("--columns", type=Heads(), help="Columns of the coordinates."),
    click.option("--movement", type=Heads(), help="Columns that distinguish the movements of a table."),
    click.option("--label-column", metavar="COLUMN", help="Column of the labels."),
    click.option("--units", type=Unit(), help="Unit of the time stamps, by name or in seconds."),
    click.option(
        "--skip", type=click.Choice(["movement", "sample"]), default="movement", show_default=True,
        help="What is dropped for a missing or repeated sample.",
    ),
    click.option(
        "--kind", "kinds", type=Kind(), multiple=True, callback=_or_none,
        help="What columns are: position, angle, discrete; of four, wxyz or xyzw, a quaternion. May be repeated.",
    ),
    click.option("--topic", multiple=True, callback=_or_none, help="Topic of a ROS bag; several are put side by side."),
    click.option(
        "--frame", multiple=True, callback=_or_none, metavar="PARENT:CHILD",
        help="Pose of one frame of a ROS bag in another.",
    ),
    click.option("--follow-links", is_flag=True, help="Also read links that lead out of the folder."),
)  # fmt: skip


#: Names of the parameters that `layout_options` adds.
LAYOUT_OPTIONS = (
    "time", "columns", "movement", "label_column", "units", "skip", "kinds", "topic", "frame", "follow_links",
)  # fmt: skip


def layout_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for the roles of a table's columns; by default the roles are detected."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def read(path: Path, options: dict[str, Any]) -> Any:
    """Read recordings from a folder, a file, or - the standard input, with the `layout_options`."""
    from kineme.files.limits import read_limited
    from kineme.files.recordings import read_recordings, read_recordings_from_bytes
    from kineme.movements.tables.layout import Layout

    known = {"label" if name == "label_column" else name: value for name, value in options.items()}
    follow_links = known.pop("follow_links", False)
    known["kinds"] = dict(known.get("kinds") or ()) or None
    if str(path) == "-":
        return read_recordings_from_bytes(read_limited(sys.stdin.buffer), STANDARD_INPUT, Layout(**known))
    return read_recordings(path, **known, follow_links=follow_links, progress=_watched)


def _watched(files: Any) -> Any:
    from tqdm import tqdm

    return tqdm(files, desc="reading", unit="file", leave=False, disable=None)  # None: on a terminal only
