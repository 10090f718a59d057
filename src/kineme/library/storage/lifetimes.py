"""Checks across rows: the rows that are alive at each version, and references between them."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.library.storage.schema import COUNTED, LARGEST_ID, RETURNS

Whole = NDArray[np.int64]
Found = Iterator[tuple[str, int, str]]  # table, key, what is wrong


def lives(connection: sqlite3.Connection) -> Found:
    """Find contradictions between the lifetimes of rows. Expects a library whose rows are valid one by one."""
    yield from _counted(connection)
    movement = _columns(connection, "movement", "id")
    state = _columns(connection, "symbol_state", "symbol")
    member = _columns(connection, "member", "movement")
    symbol = _columns(connection, "member", "symbol")
    yield from _apart("member", member, "the movement shows two symbols at a time")
    returned = [key for (key,) in connection.execute("SELECT id FROM version WHERE action IN (?, ?)", RETURNS)]
    gaps = "is not there for a while"  # none but those of symbols that were deleted, until they were there again
    yield from _apart("symbol_state", state, "the symbol has two states at a time", gaps, returned)
    yield from _apart("symbol_state", _named(connection), "two symbols have its name at a time")
    yield from _within("member", member, movement, "its movement")
    yield from _within("member", symbol, _whole_lives(state), "its symbol")
    yield from _within("symbol_state", _columns(connection, "symbol_state", "prototype"), movement, "its prototype")


def _counted(connection: sqlite3.Connection) -> Found:
    """Check the number of rows that are alive, which each version states."""
    names = list(COUNTED.values())
    said = _table(connection, f"SELECT id, {', '.join(names)} FROM version ORDER BY id", 1 + len(names))
    n = len(said)
    for table, name in COUNTED.items():
        alive = np.zeros(n + 1, dtype=np.int64)
        for column, sign in (("added", 1), ("removed", -1)):
            query = f"SELECT {column}, count(*) FROM {table} WHERE {column} IS NOT NULL GROUP BY {column}"
            at = _table(connection, query, 2)
            alive[at[:, 0]] += sign * at[:, 1]
        wrong = np.flatnonzero(np.cumsum(alive)[1:] != said[:, 1 + names.index(name)])
        yield from (("version", int(said[k, 0]), f"counts other {name} than there are") for k in wrong)


def _table(connection: sqlite3.Connection, query: str, width: int) -> Whole:
    return np.array(connection.execute(query).fetchall(), dtype=np.int64).reshape(-1, width)


def _columns(connection: sqlite3.Connection, table: str, whose: str) -> Whole:
    """Rows (key, owner, added, removed), ordered by owner, then by time."""
    query = f"SELECT id, {whose}, added, coalesce(removed, {LARGEST_ID}) FROM {table} WHERE {whose} IS NOT NULL"
    rows = _table(connection, query, 4)
    return rows[np.lexsort((rows[:, 3], rows[:, 2], rows[:, 1]))]


def _named(connection: sqlite3.Connection) -> Whole:
    """As `_columns`, with the names numbered."""
    rows = connection.execute(f"SELECT id, name, added, coalesce(removed, {LARGEST_ID}) FROM symbol_state").fetchall()
    numbers: dict[str, int] = {}
    lives = [(key, numbers.setdefault(name, len(numbers)), *life) for key, name, *life in rows]
    table = np.array(lives, dtype=np.int64).reshape(-1, 4)
    return table[np.lexsort((table[:, 3], table[:, 2], table[:, 1]))]


def _apart(table: str, rows: Whole, words: str, gaps: str = "", returned: Sequence[int] = ()) -> Found:
    """Check that lifetimes of one owner do not overlap; and have no gaps, if `gaps` says what one would mean.

    At the versions of `returned` a gap may end.
    """
    same = rows[1:, 1] == rows[:-1, 1]
    yield from ((table, int(key), words) for key in rows[1:][same & (rows[1:, 2] < rows[:-1, 3]), 0])
    if gaps:
        later = same & (rows[1:, 2] > rows[:-1, 3]) & ~np.isin(rows[1:, 2], returned)
        yield from ((table, int(key), f"the symbol {gaps}") for key in rows[1:][later, 0])


def _whole_lives(rows: Whole) -> Whole:
    """One row per owner, from its first to its last version."""
    owners, first = np.unique(rows[:, 1], return_index=True)
    last = np.append(first[1:], len(rows)) - 1
    return np.stack([owners, owners, rows[first, 2], rows[last, 3]], axis=1) if len(rows) else rows


def _within(table: str, rows: Whole, owners: Whole, whose: str) -> Found:
    """Check that a row is alive only while the row that it refers to is."""
    if not len(rows):
        return
    place = np.searchsorted(owners[:, 1], rows[:, 1])
    there: Any = np.zeros(len(rows), dtype=bool)
    known = place < len(owners)
    referred = owners[place[known]]
    part = rows[known]
    never = part[:, 2] == part[:, 3]
    there[known] = (referred[:, 1] == part[:, 1]) & (
        never | ((referred[:, 2] <= part[:, 2]) & (part[:, 3] <= referred[:, 3]))
    )
    yield from ((table, int(key), f"is there when {whose} is not") for key in rows[~there, 0])
