"""Topics of a bag that have the columns of movements that were read before."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kineme.errors import KinemeError
from kineme.files.ros.bags import Bag, Topic, messages_of
from kineme.files.ros.decode import decoder_of
from kineme.files.ros.message_types import TYPES, Heads
from kineme.movements.channels.detect import find_channels
from kineme.movements.tables.layout import Known

_LOOKED_AT = 16  # messages of a topic, of which the first ones may be none or hold no sample


def fitting_topics(bag: Bag, topics: Sequence[Topic], known: Known) -> list[Topic]:
    """The topics with columns of the same names; if there are none, with as many columns, of the same kinds."""
    if not known.columns:
        return []
    columns = {one.name: _first_sample(bag, one) for one in topics}
    same = [one for one in topics if sorted(columns[one.name][0]) == sorted(known.columns)]
    wanted = len(known.columns), known.n_orientations
    return same or [one for one in topics if _numbers(*columns[one.name]) == wanted]


def _first_sample(bag: Bag, topic: Topic) -> tuple[Heads, Sequence[float]]:
    """The columns and numbers of the first sample of a topic; nothing if it has none soon."""
    row_of = TYPES[topic.type].row if topic.type in TYPES else None
    if row_of is None:
        return (), ()
    try:
        decode = decoder_of(bag, topic)
        for (_, _, raw), _ in zip(messages_of(bag, [topic]), range(_LOOKED_AT), strict=False):
            heads, row = row_of(decode(raw))
            if heads:
                return heads, row
    except (KinemeError, ValueError):
        pass  # a topic that cannot be read fits nothing
    return (), ()


def _numbers(heads: Heads, row: Sequence[float]) -> tuple[int, int]:
    """How many columns there are, and how many quaternions among them."""
    if not heads:
        return 0, 0
    channels = find_channels(heads, np.array([row], dtype=float), np.array([0, 1]), {})
    return len(heads), sum(one.kind == "orientation" for one in channels)
