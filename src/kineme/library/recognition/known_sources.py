"""What the movements of a library were read from, for recordings that are compared with them."""

from __future__ import annotations

import json

from kineme.library.storage.store import Store
from kineme.movements.channels.channel import recorded_names
from kineme.movements.tables.layout import Known


def known_sources(store: Store) -> Known:
    """The topics and frames that the movements were read from, and their columns."""
    with store.reading() as connection:
        texts = connection.execute("SELECT DISTINCT options FROM source").fetchall()
    told = [_choice(text) for (text,) in texts]
    choices = tuple(dict.fromkeys(one for one in told if any(one)))
    if (channels := store.channels) is None:
        return Known(choices)
    moving = recorded_names(tuple(one for one in channels if one.coordinates))
    return Known(choices, recorded_names(channels), sum(one.kind == "orientation" for one in channels), moving)


def _choice(text: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Topics and frames among the options of a source; none of what is no such option."""
    try:
        options = json.loads(text)
    except (ValueError, RecursionError):
        return (), ()
    topics, frames = (options.get(name) if isinstance(options, dict) else None for name in ("topic", "frame"))
    return _names(topics), _names(frames)


def _names(value: object) -> tuple[str, ...]:
    several = [value] if isinstance(value, str) else value if isinstance(value, list) else []
    return tuple(one for one in several if isinstance(one, str))
