"""What changed, when: one entry per version."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from kineme.library.storage.rows import parsed_column, select
from kineme.library.storage.store import Store


@dataclass(frozen=True)
class Version:
    """One change.

    Attributes
    ----------
    id : int
        Its number, from 1.
    at : str
        When it was committed, ISO 8601, UTC.
    action : str
        "learn", "rename", ...
    detail : mapping
        What there is to say about it.
    """

    id: int
    at: str
    action: str
    detail: Mapping[str, Any]


def history(store: Store) -> tuple[Version, ...]:
    """Every change up to the version shown, the first one first."""
    with store.reading() as connection:
        rows = select(connection, "version", "id <= :v", {"v": store.as_of})
    return tuple(Version(row[0], row[1], row[2], parsed_column("version", row, "detail", dict)) for row in rows)
