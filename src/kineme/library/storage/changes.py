"""Changes to symbols and their members; each creates one version, which it returns, and none deletes earlier rows."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from kineme.errors import SpecificationError
from kineme.library.storage.read import as_ids
from kineme.library.storage.rows import Database, Row, among, check_text, listed, next_key, parsed_column, select
from kineme.library.storage.schema import COLUMNS, CONTINUES, MAX_DOCUMENT
from kineme.library.storage.store import NOW, Change, Store, repeated
from kineme.library.storage.symbols import HOW, add_members, check_no_id, check_symbol, make, state_of
from kineme.validation import check_choice, check_number

_STATE = COLUMNS["symbol_state"]
_NAME = _STATE.index("name")  # the history says names, whatever the symbol was asked for by
_SAID = ("description", "prototype", "threshold")  # the columns that `annotate` changes


@repeated
def rename(store: Store, old: str, new: str) -> int:
    """Rename a symbol; its id stays."""
    new = check_symbol(new)
    with store.writing("rename") as change:
        state = state_of(change.connection, old, NOW)
        change.detail.update(old=state[_NAME], new=new)
        _check_free(change.connection, new)
        _replace_state(change, state, name=new)
    return change.version


@repeated
def annotate(store: Store, who: str, **values: Any) -> int:
    """Change description, prototype (id of a member) and threshold of a symbol; what it has already is no version."""
    store.check_writable()
    for name in values:
        check_choice("what is annotated", name, _SAID)
    if (prototype := values.get("prototype")) is not None:
        values["prototype"] = int(as_ids(store, prototype)[0])
    if (threshold := values.get("threshold")) is not None:
        check_number("threshold", threshold)
        values["threshold"] = float(threshold)
    if "description" in values:
        _check_description(values["description"])
    with store.reading() as connection:
        state = state_of(connection, who, NOW)
        if all(state[_STATE.index(name)] == value for name, value in values.items()):
            return store.moment(connection).version
    with store.writing("annotate") as change:
        state = state_of(change.connection, who, NOW)
        if prototype is not None:
            _check_member(change.connection, state, values["prototype"])
        change.detail.update(symbol=state[_NAME], **values)
        _replace_state(change, state, **values)
    return change.version


@repeated
def delete_symbol(store: Store, who: str) -> int:
    """Delete a symbol; its movements stay, without a symbol."""
    with store.writing("delete") as change:
        state = state_of(change.connection, who, NOW)
        change.detail["symbol"] = state[_NAME]
        _leave(change, "symbol = :key", {"key": state[1]})
        change.retire("symbol_state", [state])
    return change.version


@repeated
def delete_movements(store: Store, ids: Any, continues: int | None = None) -> int:
    """Delete movements; a symbol whose prototype is among them loses it. `continues` as in `assign`."""
    wanted = as_ids(store, ids)
    with store.writing("delete", {"movements": len(wanted), "first": int(wanted[0])}) as change:
        continue_from(change, continues)
        keys = {"keys": listed(wanted)}
        _leave(change, among("movement"), keys)
        for state in select(change.connection, "symbol_state", f"removed IS NULL AND {among('prototype')}", keys):
            _replace_state(change, state, prototype=None)
        gone = select(change.connection, "movement", f"removed IS NULL AND {among('id')}", keys)
        change.retire("movement", gone)
    return change.version


@repeated
def merge(store: Store, names: Sequence[str], into: str) -> int:
    """Merge several symbols into one, see `ActionLibrary.merge`; `into` is its name, or the id of one that exists."""
    if isinstance(names, str) or len(set(names)) < 1:
        raise SpecificationError(f"expected a list of symbols to merge, got {names!r}")
    with store.writing("merge") as change:
        states = {state[1]: state for state in (state_of(change.connection, name, NOW) for name in names)}
        target = _find(change.connection, into)
        into = check_symbol(into) if target is None else target[_NAME]
        merged_names = [state[_NAME] for state in states.values()]
        change.detail.update(names=merged_names, into=into)
        merged = [state for key, state in states.items() if target is None or key != target[1]]
        if not merged:
            raise SpecificationError(f"expected symbols other than {into!r} to merge into it, got {list(names)}")
        parents = _ids_of(change.connection, merged)
        if target is None:
            key = make(change, into, parents)
        else:
            key = target[1]
            _replace_state(
                change, target, parents=json.dumps([*parsed_column("symbol_state", target, "parents", list), *parents])
            )
        for state in merged:
            _move_members(change, _leave(change, "symbol = :key", {"key": state[1]}), key)
            change.retire("symbol_state", [state])
    return change.version


@repeated
def split(store: Store, name: str, ids: Any, new: str) -> int:
    """Split a symbol: some of its members become a new symbol, and the old one becomes its parent."""
    new = check_symbol(new)
    wanted = as_ids(store, ids)
    with store.writing("split") as change:
        state = state_of(change.connection, name, NOW)
        change.detail.update(symbol=state[_NAME], new=new, movements=len(wanted))
        _check_free(change.connection, new)
        key = make(change, new, _ids_of(change.connection, [state]))
        where = f"symbol = :key AND {among('movement')}"
        members = _leave(change, where, {"key": state[1], "keys": listed(wanted)})
        if len(members) != len(set(wanted.tolist())):
            strange = sorted(set(wanted.tolist()) - {row[1] for row in members})
            raise SpecificationError(f"expected movements of {name!r}, got {strange[0]}, which is not one of them")
        _forget_prototypes(change, members)
        _move_members(change, members, key)
    return change.version


@repeated
def assign(  # noqa: PLR0913, PLR0917 - what a symbol gets
    store: Store,
    ids: Any,
    who: str,
    how: str = "anchored",
    medoid: int | None = None,
    description: str | None = None,
    continues: int | None = None,
) -> int:
    """Assign movements to a symbol, created if needed, then with the medoid as prototype; they leave the one before.

    `continues` is the version that the same call made before, if any: an undo takes back both.
    """
    check_choice("how", how, HOW)
    wanted = as_ids(store, ids)
    values: dict[str, Any] = {}
    if description is not None:
        _check_description(description)
        values["description"] = description
    with store.writing("assign") as change:
        state = _find(change.connection, who)
        who = check_symbol(who) if state is None else state[_NAME]
        change.detail.update(symbol=who, movements=len(wanted), how=how, **values)
        continue_from(change, continues)
        key = make(change, who) if state is None else state[1]
        left = _leave(change, among("movement"), {"keys": listed(wanted)})
        _forget_prototypes(change, [row for row in left if row[2] != key])
        add_members(change, [(movement, key) for movement in sorted(set(wanted.tolist()))], how)
        if state is None and medoid in wanted.tolist():
            values["prototype"] = medoid
        if values:
            _replace_state(change, state_of(change.connection, who, NOW), **values)
    return change.version


@repeated
def release(store: Store, ids: Any) -> int:
    """Remove movements from their symbols."""
    wanted = as_ids(store, ids)
    with store.writing("release", {"movements": len(wanted)}) as change:
        _forget_prototypes(change, _leave(change, among("movement"), {"keys": listed(wanted)}))
    return change.version


def continue_from(change: Change, before: int | None) -> None:
    """Note the version that the same call made before, if any, so that an undo takes back both."""
    if before is not None:
        change.detail[CONTINUES] = before


def _replace_state(change: Change, state: Row, **values: Any) -> None:
    """Give a symbol other values from this version on."""
    change.retire("symbol_state", [state])
    record = dict(zip(_STATE, state, strict=True)) | values
    record |= {"id": next_key(change.connection, "symbol_state"), "added": change.version, "removed": None}
    change.insert("symbol_state", [tuple(record[name] for name in _STATE)])


def _leave(change: Change, where: str, parameters: dict[str, Any]) -> list[Row]:
    """End memberships; return the rows that were ended."""
    rows = select(change.connection, "member", f"removed IS NULL AND {where}", parameters)
    change.retire("member", rows)
    return rows


def _forget_prototypes(change: Change, left: Sequence[Row]) -> None:
    """Clear the prototypes that are among the members that left."""
    pairs = {(row[2], row[1]) for row in left}
    keys = {"keys": listed(key for key, _ in pairs)}
    for state in select(change.connection, "symbol_state", f"removed IS NULL AND {among('symbol')}", keys):
        if (state[1], state[4]) in pairs:
            _replace_state(change, state, prototype=None)


def _check_member(connection: Database, state: Row, movement: int) -> None:
    where = "removed IS NULL AND symbol = :key AND movement = :movement"
    if not select(connection, "member", where, {"key": state[1], "movement": movement}):
        raise SpecificationError(
            f"expected a movement of {state[_NAME]!r} as its prototype, got {movement}, which is not one of them; "
            "choose a member, or assign it first"
        )


def _move_members(change: Change, members: Sequence[Row], key: int) -> None:
    for how in HOW:
        add_members(change, [(row[1], key) for row in members if row[3] == how], how)


def _find(connection: Database, who: str) -> Row | None:
    try:
        return state_of(connection, who, NOW)
    except SpecificationError:
        return None


def _ids_of(connection: Database, states: Sequence[Row]) -> list[str]:
    keys = listed(state[1] for state in states)
    return [row[1] for row in select(connection, "symbol", among("key"), {"keys": keys})]


def _check_description(text: Any) -> None:
    if not isinstance(text, str):
        raise SpecificationError(f"expected a description, got {text!r}")
    check_text("a description", text, MAX_DOCUMENT // 2)  # the history repeats it, in JSON


def _check_free(connection: Database, name: str) -> None:
    if select(connection, "symbol_state", "removed IS NULL AND name = :name", {"name": name}):
        raise SpecificationError(f"expected a name that no symbol has, got {name!r}; merge the two, or choose another")
    check_no_id(connection, name)
