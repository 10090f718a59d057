"""Versions of a library: what each changed, the rows alive at it, and the transaction that creates the next one."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from kineme.library.storage.rows import Row, damaged, insert, retire, select
from kineme.library.storage.schema import COUNTED


@dataclass(frozen=True)
class Version:
    """One version.

    Attributes
    ----------
    id : int
        Its number, from 1.
    at : str
        When it was committed, ISO 8601, UTC.
    action : str
        "learn", "rename", ...
    detail : mapping
        Details of the change.
    """

    id: int
    at: str
    action: str
    detail: Mapping[str, Any]


@dataclass(frozen=True)
class Moment:
    """A version and its numbers of alive rows, by which rows that damage has hidden are noticed."""

    version: int
    movements: int = 0
    members: int = 0
    symbols: int = 0


def moment_at(connection: sqlite3.Connection, version: int) -> Moment:
    """The last version up to the given one.

    Raises
    ------
    DataError
        Its row is damaged.
    """
    last = connection.execute("SELECT max(id) FROM version WHERE id <= :v", {"v": version}).fetchone()[0]
    if last is None:
        return Moment(0)
    rows = select(connection, "version", "id = :last", {"last": last})
    if not rows:
        raise damaged("version", (last,))
    return Moment(last, *rows[0][4:])


@dataclass(frozen=True)
class Change:
    """An open transaction."""

    connection: sqlite3.Connection
    version: int
    counts: dict[str, int]

    def insert(self, table: str, rows: Sequence[Row]) -> None:
        """Add rows to a table."""
        insert(self.connection, table, rows)
        self._count(table, len(rows))

    def retire(self, table: str, rows: Sequence[Row]) -> None:
        """Mark selected rows as removed from this version on."""
        retire(self.connection, table, rows, self.version)
        self._count(table, -len(rows))

    def _count(self, table: str, more: int) -> None:
        if table in COUNTED:
            self.counts[COUNTED[table]] += more
