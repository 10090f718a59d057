"""Take changes back: the state of an earlier version again, as a new version."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from numbers import Integral
from typing import NamedTuple

from kineme.errors import SpecificationError
from kineme.library.storage.rows import ALIVE, Row, among, has_table, listed, next_key, parsed_column, select
from kineme.library.storage.schema import BLOBS, COLUMNS, CONTINUES, OPTIONAL_BLOBS, RESTORE, RETURNS, UNDO
from kineme.library.storage.store import NOW, Change, Store

_MOVEMENT = {name: k for k, name in enumerate(COLUMNS["movement"])}
_STATE = {name: k for k, name in enumerate(COLUMNS["symbol_state"])}


class Undone(NamedTuple):
    """What `undo` did: it made `version`, whose state is that of version `to`.

    `action` is what it took back; "restore" where it was asked for that version.
    """

    version: int
    to: int
    action: str


def undo(store: Store, expected: int | None = None, to: int | None = None) -> Undone:
    """Take back the last change that was not taken back yet, or restore a version; see `ActionLibrary.undo`."""
    detail: dict[str, int] = {}
    with store.writing(UNDO if to is None else RESTORE, detail) as change:
        last = change.version - 1
        if expected is not None and expected != last:
            what = "take back" if to is None else "replace"
            raise SpecificationError(
                f"expected to {what} version {expected}, the library is at version {last} by now; "
                f"look at what has changed, and {'undo' if to is None else 'restore'} again"
            )
        action, back = _last_change(change.connection, last) if to is None else (RESTORE, _earlier(change, to))
        detail |= {"to": back}
        _return_to(change, back)
    return Undone(change.version, back, action)


def _last_change(connection: sqlite3.Connection, last: int) -> tuple[str, int]:
    """The action to take back, and the version before it."""
    undone = _effective(connection, last)
    if undone == 0:
        raise SpecificationError("expected a change to take back, the library has none left; nothing was changed")
    return _version(connection, undone)[2], _begin(connection, undone) - 1


def _earlier(change: Change, to: int) -> int:
    """The version to restore, checked: an earlier one, with another state."""
    last = change.version - 1
    if not (isinstance(to, Integral) and not isinstance(to, bool) and 0 <= to < last):
        raise SpecificationError(f"expected a version before {last} to restore, got {to!r}; see history()")
    if _effective(change.connection, int(to), RETURNS) == _effective(change.connection, last, RETURNS):
        raise SpecificationError(
            f"expected a version to restore, the library is as at version {to}; nothing was changed"
        )
    return int(to)


def can_undo(store: Store) -> bool:
    """Whether there is a change to take back."""
    with store.reading() as connection:
        return not store.read_only and _effective(connection, store.moment(connection).version) > 0


def _effective(connection: sqlite3.Connection, version: int, returns: tuple[str, ...] = (UNDO,)) -> int:
    """The version whose change the library is at: that of the state that an undo returned to, else the version.

    With `RETURNS`, the first version that had its state, as far as the history says so.
    """
    while version > 0:
        row = _version(connection, version)
        to = parsed_column("version", row, "detail", dict).get("to")
        if row[2] not in returns or not isinstance(to, int) or not 0 <= to < version:
            return version
        version = to
    return 0


def _begin(connection: sqlite3.Connection, version: int) -> int:
    """The first of the versions in a row that one call made."""
    while version > 1:
        row = _version(connection, version)
        if parsed_column("version", row, "detail", dict).get(CONTINUES) != version - 1:
            break
        version -= 1
    return version


def _version(connection: sqlite3.Connection, version: int) -> Row:
    return select(connection, "version", "id = :v", {"v": version})[0]


def _return_to(change: Change, version: int) -> None:
    """Make the rows alive those of an earlier version. A movement that was deleted gets a new id, as learned again."""
    ids = _return_movements(change, version)
    then, now = (_rows(change, "member", at) for at in (version, NOW))
    wanted = {(ids[row[1]], row[2], row[3]) for row in then}
    change.retire("member", [row for row in now if row[1:4] not in wanted])
    _return_states(change, version, ids)
    have = {row[1:4] for row in now}
    new = sorted(wanted - have)
    key = next_key(change.connection, "member")
    change.insert("member", [(key + k, *one, change.version, None) for k, one in enumerate(new)])
    _retire_movements(change, set(ids.values()))


def _return_movements(change: Change, version: int) -> dict[int, int]:
    """The id now of every movement of that version; those that are not there any more are stored again."""
    then, now = (_rows(change, "movement", at) for at in (version, NOW))
    digest = _MOVEMENT["digest"]
    alive = {row[digest]: row[0] for row in now}
    lost = [row for row in then if row[digest] not in alive]
    key = next_key(change.connection, "movement")
    again = {row[0]: key + k for k, row in enumerate(lost)}
    _free_places(change, lost, now)
    change.insert("movement", [(again[row[0]], *row[1:-2], change.version, None) for row in lost])
    _copy(change, again)
    return {row[0]: again.get(row[0], alive.get(row[digest], 0)) for row in then}


def _free_places(change: Change, lost: list[Row], now: list[Row]) -> None:
    """Remove movements that were learned later from the positions of the lost ones in their files.

    What refers to them is of no earlier version, and is retired with all that is not.
    """
    at = {row[1:3] for row in lost if row[1] is not None}
    change.retire("movement", [row for row in now if row[1] is not None and row[1:3] in at])


def _copy(change: Change, again: Mapping[int, int]) -> None:
    """The samples, primitives, features and people of movements, for their new ids."""
    keys = {"keys": listed(again)}
    for table in (*BLOBS, *OPTIONAL_BLOBS, "shown_by"):
        if again and has_table(change.connection, table):
            for row in select(change.connection, table, among("movement"), keys):
                later = (*row[1:-1], change.version) if table == "shown_by" else row[1:]
                change.insert(table, [(again[row[0]], *later)])


def _return_states(change: Change, version: int, ids: Mapping[int, int]) -> None:
    """Names, descriptions and prototypes of the symbols as they were."""
    prototype = _STATE["prototype"]
    then, now = (_rows(change, "symbol_state", at) for at in (version, NOW))
    wanted = {(*row[1:prototype], ids.get(row[prototype]), *row[prototype + 1 : -2]) for row in then}
    change.retire("symbol_state", [row for row in now if row[1:-2] not in wanted])
    have = {row[1:-2] for row in now}
    key = next_key(change.connection, "symbol_state")
    new = sorted(wanted - have, key=lambda one: int(one[0]))
    change.insert("symbol_state", [(key + k, *one, change.version, None) for k, one in enumerate(new)])


def _retire_movements(change: Change, kept: set[int]) -> None:
    change.retire("movement", [row for row in _rows(change, "movement", NOW) if row[0] not in kept])


def _rows(change: Change, table: str, version: int) -> list[Row]:
    return select(change.connection, table, ALIVE, {"v": version})
