"""Recordings that hold one movement after the other, each of so many samples, as microcontrollers log them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kineme.errors import DataError
from kineme.movements.tables.parsed import Parsed


def in_blocks(parsed: Parsed, every: int) -> Parsed:
    """Cut each movement of a file into movements of `every` samples.

    Raises
    ------
    DataError
        A movement whose number of samples is not divisible by it: nobody knows where the others begin.
    """
    block = parsed.block
    lengths = np.diff(block.offsets)
    if (odd := np.flatnonzero(lengths % every)).size:
        i = int(odd[0])
        where = f" in movement {block.places[i]}" if block.places[i] else ""
        raise DataError(
            f"expected blocks of {every} samples, got {lengths[i]} samples{where}: {lengths[i] // every} blocks and "
            f"{lengths[i] % every} more; give the right number, or repair the file"
        )
    counts = lengths // every
    owners = np.repeat(np.arange(len(lengths)), counts).tolist()
    numbers = (np.arange(len(owners)) - np.repeat(np.cumsum(counts) - counts, counts)).tolist()
    places = [f"{block.places[i]}/{k}" if block.places[i] else str(k) for i, k in zip(owners, numbers, strict=True)]
    cut = replace(
        block,
        offsets=np.arange(len(owners) + 1) * every,
        labels=[block.labels[i] for i in owners],
        places=places,
        people=block.people and [block.people[i] for i in owners],
    )
    detected = parsed.detected._replace(layout=f"{parsed.detected.layout}, blocks of {every} samples")
    return parsed._replace(detected=detected, block=cut)
