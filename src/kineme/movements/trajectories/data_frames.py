"""From data frames to one contiguous block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from kineme.errors import DataError, TrajectoryError, warn
from kineme.movements.channels.coordinates import in_order
from kineme.movements.channels.detect import find_channels
from kineme.movements.channels.one_unit import in_one_unit
from kineme.movements.tables.parsed import Parsed
from kineme.movements.trajectories.channels import of_channels
from kineme.movements.trajectories.collect import collect_arrays
from kineme.movements.trajectories.movements import Movements

if TYPE_CHECKING:
    from kineme.movements.tables.layout import Layout


def is_data_frame(value: Any) -> bool:
    """Whether this is a data frame, of pandas, of polars, or of another package with their names."""
    return hasattr(value, "columns") and hasattr(value, "to_numpy") and hasattr(value, "__getitem__")


def frames_of(value: Any) -> list[Any] | None:
    """The data frames of one, of its groups as ``groupby`` makes them, or of a list of (key, group); else None."""
    if is_data_frame(value):
        return [value]
    if not hasattr(value, "get_group") and not isinstance(value, list):
        return None
    pairs = list(value)
    if pairs and all(isinstance(one, tuple) and len(one) == 2 and is_data_frame(one[1]) for one in pairs):
        return [frame for _, frame in pairs]
    return None


def collect_data_frames(frames: Sequence[Any], layout: Layout) -> Movements:
    """The movements of all frames, with their dimensions' names; see `Demonstrations.from_dataframe`."""
    if not frames:
        raise TrajectoryError("expected at least one data frame, got none")
    parsed = [_parse(frame, i, layout) for i, frame in enumerate(frames)]
    if converted := [*dict.fromkeys(said for one in parsed for said in one.detected.converted)]:
        warn(f"units are converted to those of most columns: {', '.join(converted)}", UserWarning, 3)
    dimensions = parsed[0].detected.columns
    for i, one in enumerate(parsed):
        if one.detected.columns != dimensions:
            raise TrajectoryError(
                f"data frame {i}: expected the coordinates {list(dimensions)} as in data frame 0, got "
                f"{list(one.detected.columns)}; say which with columns= of Demonstrations.from_dataframe"
            )
    blocks = [one.block for one in parsed]
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
    from kineme.movements.tables.data_frame import parse_data_frame  # what columns mean loads with the first frame

    if not is_data_frame(frame):
        raise TrajectoryError(f"expected data frames, got {type(frame).__name__} at index {i}; pass them one by one")
    try:
        detected, block, left_out = parse_data_frame(frame, layout)
        detected, block = in_one_unit(detected, block)
    except DataError as error:
        raise TrajectoryError(f"data frame {i}: {error} (of Demonstrations.from_dataframe)") from error
    return Parsed(detected, block, left_out)
