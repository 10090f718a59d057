"""Sources of movements: a file as it was when it was read, and what was read from the files of a library."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from kineme.library.storage.rows import parsed
from kineme.library.storage.store import Store
from kineme.movements.channels.channel import recorded_names
from kineme.movements.tables.layout import Known


@dataclass(frozen=True)
class Source:
    """A file of recordings.

    - `path`: as given by the user; never opened again.
    - `sha256`: hash of its bytes. Equal bytes read with equal options are the same source, whatever their path.
    - `size`: in bytes; `kind`: format, "csv", "npz", ...; `read_at`: time, ISO 8601.
    - `options`: of the reader: columns, units; anything that JSON can represent.
    """

    path: str
    sha256: str
    size: int
    kind: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)
    read_at: str = ""

    @property
    def options_json(self) -> str:
        """The options as canonical JSON."""
        return json.dumps(dict(self.options), sort_keys=True)


def known_sources(store: Store) -> Known:
    """Return the topics and frames that the movements were read from, and their columns."""
    with store.reading() as connection:
        texts = connection.execute("SELECT DISTINCT options FROM source").fetchall()
    every = [_choice(text) for (text,) in texts]
    choices = tuple(dict.fromkeys(choice for choice in every if any(choice)))
    if (channels := store.channels) is None:
        return Known(choices)
    moving = recorded_names(tuple(channel for channel in channels if channel.coordinates))
    return Known(choices, recorded_names(channels), sum(channel.kind == "orientation" for channel in channels), moving)


def _choice(text: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return topics and frames among the options of a source; none of what is no such option."""
    try:
        options = parsed(text)
    except ValueError:
        options = None
    chosen = [options.get(name) if isinstance(options, dict) else None for name in ("topic", "frame")]
    several = ([value] if isinstance(value, str) else value if isinstance(value, list) else [] for value in chosen)
    topics, frames = (tuple(name for name in names if isinstance(name, str)) for names in several)
    return topics, frames
