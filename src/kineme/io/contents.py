"""What a recording holds besides the movements that are read of it: topics, frames, features."""

from __future__ import annotations

from typing import NamedTuple


class Contents(NamedTuple):
    """A list of things in a recording, as a table.

    Attributes
    ----------
    name : str
        What they are: ``"topics"``.
    heads : tuple of str
    rows : tuple of tuple of str or int
    note : str
        What should be known about the list.
    """

    name: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str | int, ...], ...]
    note: str = ""
