"""An episode of robot data as a recording: columns by the names of its features, checked as those of any file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kineme.io.reading.formats import Format
from kineme.io.reading.merge_files import Recordings, merge_files
from kineme.io.reading.read_file import parsed_file
from kineme.movements.episodes import Episode, default_features, even_stamps, head_of
from kineme.movements.tables.columns import choose_roles
from kineme.movements.tables.layout import Layout, Parsed, no_lines
from kineme.movements.tables.table import Segments, Table, table_movements

_STAMP = "timestamp [s]"


def heads_of(episode: Episode) -> dict[str, tuple[str, ...]]:
    """Name the columns of each feature: by the entry alone in the feature that is read by default, which comes first.

    That is what `default_features` says, else the first of several numbers. Columns of the others, and those of several
    that are read by default, are ``feature.entry``, as `kineme.read_recordings` calls them.
    """
    widths = {feature: values.shape[1] for feature, values in episode.signals.items()}
    wide = [feature for feature, width in widths.items() if width > 1]
    usual = default_features(widths) or tuple(wide or widths)[:1]
    default = usual[0] if len(usual) == 1 else None
    heads: dict[str, tuple[str, ...]] = {}
    for feature in sorted(widths, key=lambda name: name not in usual):
        entries = episode.names.get(feature) or tuple(map(str, range(widths[feature])))
        short = feature == default and not any(not entry or entry.isdecimal() for entry in entries)
        heads[feature] = entries if short else tuple(head_of(feature, entry) for entry in entries)
    return heads


def episode_recordings(episode: Episode, name: str, columns: Sequence[str] = ()) -> Recordings:
    """Read an episode of the data set `name` as one movement, in these columns or in all of numbers.

    Stamps that lie within 0.1 ms of the declared rate become those of the rate. A `DataError` says why the episode is
    no movement.
    """
    heads = heads_of(episode)
    times = even_stamps(episode.times, episode.fps)
    values = [column for feature in heads for column in episode.signals[feature].T]
    names = (_STAMP, *(head for feature in heads for head in heads[feature]))
    segments = Segments(np.array([0, len(episode)]), [episode.label], [episode.task])
    table = Table(names, [times, *values], len(episode), no_lines, segments=segments, maker="episodes")

    def parse(layout: Layout) -> Parsed:
        return table_movements(table, choose_roles(names, ("number",) * len(names), layout), layout, "episode")

    layout = Layout(time=0, columns=tuple(columns) or tuple(range(1, len(names))))
    return merge_files([parsed_file(parse, Format(), Path(name), layout)], name, layout)
