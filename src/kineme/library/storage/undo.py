"""Take changes back: the state of an earlier version again, as a new version."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from numbers import Integral
from typing import NamedTuple

from kineme.errors import SpecificationError
from kineme.library.storage.read import people_by_movement
from kineme.library.storage.rows import ALIVE, Database, Row, among, has_table, listed, next_key, parsed_column, select
from kineme.library.storage.schema import BLOBS, COLUMNS, CONTINUES, OPTIONAL_BLOBS, RESTORE, RETURNS, UNDO
from kineme.library.storage.store import NOW, Change, Store, Version, history, repeated

_DIGEST, _PROTOTYPE = COLUMNS["movement"].index("digest"), COLUMNS["symbol_state"].index("prototype")


class Undone(NamedTuple):
    """Result of `undo`: the version that it made."""

    version: int
    to: int  # the version whose state it has
    action: str  # that it took back; "restore" where it was asked for that version


@repeated
def undo(store: Store, expected: int | None = None, to: int | None = None) -> Undone:
    """Take back the last change that was not taken back yet, or restore a version; see `ActionLibrary.undo`."""
    with store.writing(UNDO if to is None else RESTORE) as change:
        last = change.version - 1
        if expected is not None and expected != last:
            what = "take back" if to is None else "replace"
            raise SpecificationError(
                f"expected to {what} version {expected}, the library is at version {last} by now; "
                f"look at what has changed, and {'undo' if to is None else 'restore'} again"
            )
        if to is None:
            undone = _effective(change.connection, last)
            if undone == 0:
                raise SpecificationError(
                    "expected a change to take back, the library has none left; nothing was changed"
                )
            action, back = _version(change.connection, undone)[2], _begin(change.connection, undone) - 1
        else:
            if not (isinstance(to, Integral) and not isinstance(to, bool) and 0 <= to < last):
                raise SpecificationError(f"expected a version before {last} to restore, got {to!r}; see history()")
            action, back = RESTORE, int(to)
            if _effective(change.connection, back, RETURNS) == _effective(change.connection, last, RETURNS):
                raise SpecificationError(
                    f"expected a version to restore, the library is as at version {to}; nothing was changed"
                )
        change.detail["to"] = back
        _return_to(change, back)
    return Undone(change.version, back, action)


def can_undo(store: Store) -> bool:
    """Tell whether there is a change to take back."""
    with store.reading() as connection:
        return not store.read_only and _effective(connection, store.moment(connection).version) > 0


def in_effect(store: Store) -> Iterator[Version]:
    """Yield the versions whose changes were not taken back, the last one first."""
    last = store.as_of
    for version in reversed(history(store)):
        if version.id <= last:
            if version.action not in RETURNS:
                yield version
            else:  # those since the one that it returned to
                last = version.detail["to"]


def _effective(connection: Database, version: int, returns: tuple[str, ...] = (UNDO,)) -> int:
    """Return the version whose change the library is at: that of the state that an undo returned to, else the version.

    With `RETURNS`, the first version that had its state, as far as the history says so.
    """
    while version > 0:
        row = _version(connection, version)
        to = parsed_column("version", row, "detail", dict).get("to")
        if row[2] not in returns or not isinstance(to, int) or not 0 <= to < version:
            return version
        version = to
    return 0


def _begin(connection: Database, version: int) -> int:
    """Return the first of the versions in a row that one call made."""
    while version > 1:
        row = _version(connection, version)
        if parsed_column("version", row, "detail", dict).get(CONTINUES) != version - 1:
            break
        version -= 1
    return version


def _version(connection: Database, version: int) -> Row:
    return select(connection, "version", "id = :v", {"v": version})[0]


def _return_to(change: Change, version: int) -> None:
    """Make the rows alive those of an earlier version. One that was deleted gets a new id, as learned again."""
    ids = _return_movements(change, version)
    then, now = (_rows(change, "member", at) for at in (version, NOW))
    wanted = {(ids[row[1]], row[2], row[3]) for row in then}
    change.retire("member", [row for row in now if row[1:4] not in wanted])
    states_then, states = (_rows(change, "symbol_state", at) for at in (version, NOW))
    before = {
        (*row[1:_PROTOTYPE], ids.get(row[_PROTOTYPE]), *row[_PROTOTYPE + 1 : -2]) for row in states_then
    }  # names, descriptions and prototypes as they were
    change.retire("symbol_state", [row for row in states if row[1:-2] not in before])
    key = next_key(change.connection, "symbol_state")
    new = sorted(before - {row[1:-2] for row in states}, key=lambda row: int(row[0]))
    change.insert("symbol_state", [(key + k, *row, change.version, None) for k, row in enumerate(new)])
    key = next_key(change.connection, "member")
    new = sorted(wanted - {row[1:4] for row in now})
    change.insert("member", [(key + k, *row, change.version, None) for k, row in enumerate(new)])
    alive = set(ids.values())
    change.retire("movement", [row for row in _rows(change, "movement", NOW) if row[0] not in alive])


def _return_movements(change: Change, version: int) -> dict[int, int]:
    """Return the id now of every movement of that version; those that are not there as they were are stored again.

    Who showed a movement is said of its id once and for all, so that one of which that is another now gets a new id.
    """
    then, now = (_keyed_rows(change, at) for at in (version, NOW))
    ids = {key: row[0] for row, key in now}
    lost = [row for row, key in then if key not in ids]
    first = next_key(change.connection, "movement")
    again = {row[0]: first + k for k, row in enumerate(lost)}
    # Movements that were learned later leave the places of the lost ones in their files. What refers to them is of no
    # earlier version, and is retired with all that is not.
    places, digests = {row[1:3] for row in lost if row[1] is not None}, {row[_DIGEST] for row in lost}
    change.retire("movement", [row for row, _ in now if row[1:3] in places or row[_DIGEST] in digests])
    change.insert("movement", [(again[row[0]], *row[1:-2], change.version, None) for row in lost])
    _copy(change, again)
    people = [(again[row[0]], key[1], change.version) for row, key in then if row[0] in again and key[1] is not None]
    change.insert("shown_by", people)
    return {row[0]: again.get(row[0]) or ids[key] for row, key in then}


def _keyed_rows(change: Change, version: int) -> list[tuple[Row, tuple[int, str | None]]]:
    """Return the movements of a version, each with its digest and who showed it as far as that was known."""
    rows = _rows(change, "movement", version)
    people = people_by_movement(change.connection, [row[0] for row in rows], version)
    return [(row, (row[_DIGEST], people.get(row[0]))) for row in rows]


def _copy(change: Change, again: Mapping[int, int]) -> None:
    """Copy the samples, primitives and features of movements to their new ids."""
    keys = {"keys": listed(again)}
    for table in (*BLOBS, *OPTIONAL_BLOBS):
        if again and has_table(change.connection, table):
            for row in select(change.connection, table, among("movement"), keys):
                change.insert(table, [(again[row[0]], *row[1:])])


def _rows(change: Change, table: str, version: int) -> list[Row]:
    return select(change.connection, table, ALIVE, {"v": version})
