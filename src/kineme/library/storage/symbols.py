"""Symbols, and the rows that store them."""

from __future__ import annotations

import difflib
import json
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any
from unicodedata import normalize

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError, warn
from kineme.io.records import NO_SYMBOLS
from kineme.library.storage import rows as sql
from kineme.library.storage.read import groups, movements, records
from kineme.library.storage.schema import COLUMNS, MAX_TEXT
from kineme.library.storage.store import Change, Moment, Store

_ALIKE = 100  # characters of names that are compared: the time of the search is quadratic

#: How a movement was assigned to its symbol.
HOW = ("label", "anchored", "recognized")


@dataclass(frozen=True, eq=False)
class Symbol:
    """A name for movements of one class.

    - `id`: "sym-..."; stays when the name changes.
    - `members` (k,): ids of its movements, ascending; read-only. `prototype`: id of the most typical, or None.
    - `threshold`: largest nonconformity of a member, if set.
    - `parents`: ids of the symbols that it was merged or split from.
    - `created`, `changed`: versions that created it, and that last changed its name, description, prototype or
      threshold.
    """

    id: str
    name: str
    description: str
    members: NDArray[np.int64]
    prototype: int | None
    threshold: float | None
    parents: tuple[str, ...]
    created: int
    changed: int

    def __len__(self) -> int:
        return len(self.members)

    def __repr__(self) -> str:
        return f"Symbol({self.name!r}, {self.id}, {len(self)} movements)"


def symbols(store: Store) -> tuple[Symbol, ...]:
    """Return all symbols, by name."""
    with store.reading() as connection:
        moment = store.moment(connection)
        states = sql.select(connection, "symbol_state", sql.ALIVE, {"v": moment.version})
        if len(states) != moment.symbols:
            raise sql.damage(f"{moment.symbols} symbols", f"{len(states)}: damaged bytes")
        return tuple(sorted(_with_members(connection, moment, states), key=lambda symbol: symbol.name))


def symbol(store: Store, who: str) -> Symbol:
    """Return the symbol of that name or id."""
    with store.reading() as connection:
        moment = store.moment(connection)
        return _with_members(connection, moment, [state_of(connection, who, moment.version)])[0]


def exists(store: Store, who: object) -> bool:
    """Tell whether there is a symbol of that name or id."""
    try:
        with store.reading() as connection:
            return bool(state_of(connection, str(who), store.as_of))
    except SpecificationError:
        return False


def state_of(connection: sql.Database, who: str, version: int) -> sql.Row:
    """Return the row of `symbol_state` of a name or, where no symbol has that name, of an id."""
    spelled = spellings(who) if isinstance(who, str) else ()
    conditions = [("name = :who", name) for name in spelled]
    conditions += [("symbol IN (SELECT key FROM symbol WHERE id = :who)", name) for name in spelled[:1]]
    for condition, name in conditions:
        try:
            states = sql.select(connection, "symbol_state", f"{condition} AND {sql.ALIVE}", {"who": name, "v": version})
        except UnicodeEncodeError:
            break
        if states:
            return states[0]
    names = [name for (name,) in connection.execute(f"SELECT name FROM symbol_state WHERE {sql.ALIVE}", {"v": version})]
    like = difflib.get_close_matches(str(who)[:_ALIKE], [name[:_ALIKE] for name in names], 3) or sorted(names)[:5]
    others = f"there are {len(names)}, such as {', '.join(map(repr, like))}" if names else "the library has none"
    raise SpecificationError(f"expected the name or id of a symbol, got {who!r}; {others}")


def _with_members(connection: sql.Database, moment: Moment, states: Sequence[sql.Row]) -> list[Symbol]:
    keys = [row[1] for row in states]
    about = {row[0]: row[1:] for row in sql.select(connection, "symbol", sql.among("key"), {"keys": sql.listed(keys)})}
    if lost := set(keys) - about.keys():
        raise sql.damaged("symbol", (min(lost),))
    members, every = _members(connection, keys, moment), []
    for row in states:
        _, key, name, description, prototype, threshold, _, added, _ = row
        parents = tuple(sql.parsed_column("symbol_state", row, "parents", list))
        id_, created = about[key]
        every.append(Symbol(id_, name, description, members[key], prototype, threshold, parents, created, added))
    return every


def _members(connection: sql.Database, keys: list[int], moment: Moment) -> dict[int, NDArray[np.int64]]:
    rows = sql.select(
        connection, "member", f"{sql.among('symbol')} AND {sql.ALIVE}", {"keys": sql.listed(keys), "v": moment.version}
    )
    n = connection.execute(f"SELECT count(*) FROM member WHERE {sql.ALIVE}", {"v": moment.version}).fetchone()[0]
    if n != moment.members:
        raise sql.damage(f"{moment.members} members of symbols", f"{n}: damaged bytes")
    table = np.array([(row[2], row[1]) for row in rows], dtype=np.int64).reshape(-1, 2)
    table = table[np.lexsort((table[:, 1], table[:, 0]))]
    table.setflags(write=False)
    first = np.searchsorted(table[:, 0], keys)
    last = np.searchsorted(table[:, 0], keys, side="right")
    return {key: table[a:b, 1] for key, a, b in zip(keys, first, last, strict=True)}


def check_name(name: Any) -> str:
    """Return a name in its composed form (NFC) without blanks around it, so that one that looks the same is the same.

    It is any Unicode text without U+0000, which NumPy, C and shells treat as the end of a text.
    """
    if not isinstance(name, str) or not name.strip():
        raise SpecificationError(f"expected a name of at least one character that is no blank, got {name!r}")
    name = normalize("NFC", name).strip()
    sql.check_text("a name", name, MAX_TEXT)
    if "\0" in name:
        raise SpecificationError(f"expected a name without the character U+0000, got {name!r}; leave it out")
    return name


def check_symbol(name: Any) -> str:
    """Return a name that a symbol gets; warn of one that annotations have where there is none."""
    name = check_name(name)
    if name.lower() in NO_SYMBOLS:
        warn(
            f"a symbol named {name!r} counts as none in annotations that are corrected, and answers with it read as if "
            "they had none; give it another name, or learn its movements without a label",
            UserWarning,
            2,
        )
    return name


def spellings(name: str) -> tuple[str, ...]:
    """Return a name as it is given, composed, decomposed, and without blanks around it, as other places have it."""
    forms = (name, normalize("NFC", name), normalize("NFD", name))
    return tuple(dict.fromkeys((*forms, *map(str.strip, forms))))


def keys_by_name(change: Change, names: Iterable[str]) -> tuple[dict[str, int], tuple[str, ...]]:
    """Return the name or id -> key of its symbol, and the names whose symbols were created."""
    names = list(names)
    keys = stored_keys(change.connection, names)
    new = tuple(name for name in names if name not in keys)
    for name in new:
        keys[name] = make(change, name)
    return keys, new


def stored_keys(connection: sql.Database, names: Iterable[str]) -> dict[str, int]:
    """Return the name or id -> key of its symbol, of those that there are."""
    alive = "FROM symbol_state JOIN symbol ON symbol.key = symbol_state.symbol WHERE removed IS NULL"
    spelled = {name: spellings(name) for name in names}
    every = sql.listed({text for texts in spelled.values() for text in texts})
    keys: dict[str, int] = {}
    for column in ("symbol.id", "name"):  # a name takes precedence over an id, as in `state_of`
        query = f"SELECT {column}, symbol.key {alive} AND {sql.among(column)}"
        there: dict[str, int] = dict(connection.execute(query, {"keys": every}))
        keys |= {name: there[text] for name, texts in spelled.items() for text in reversed(texts) if text in there}
    return keys


def check_no_id(connection: sql.Database, name: str) -> None:
    """Refuse a name that is the id of a symbol, also of one that is no more: ids mean the same for good."""
    if sql.select(connection, "symbol", "id = :name", {"name": name}):
        query = "SELECT name FROM symbol_state WHERE removed IS NULL AND parents LIKE :id ORDER BY name"
        names = [repr(into) for (into,) in connection.execute(query, {"id": f'%"{name}"%'})]
        after = f", from which came {', '.join(names)}" if names else ""
        raise SpecificationError(
            f"expected a name, got {name!r}, which is the id of a symbol for good{after}; choose another"
        )


def make(change: Change, name: str, parents: Sequence[str] = ()) -> int:
    """Create a symbol; return its key."""
    check_no_id(change.connection, name)
    key = change.next_key("symbol")
    change.insert("symbol", [(key, f"sym-{secrets.token_hex(6)}", change.version)])
    state = change.next_key("symbol_state")
    text = json.dumps(list(parents))
    change.insert("symbol_state", [(state, key, name, "", None, None, text, change.version, None)])
    return key


def add_members(change: Change, pairs: Sequence[tuple[int, int]], how: str) -> None:
    """Add movements without a symbol as members: pairs (movement, key of the symbol)."""
    first = change.next_key("member")
    rows = [(first + k, movement, key, how, change.version, None) for k, (movement, key) in enumerate(pairs)]
    change.insert("member", rows)


def symbol_report(store: Store, who: str) -> dict[str, Any]:
    """Return a symbol as plain data, with a record of each of its ``members``."""
    shown = symbol(store, who)
    members = []
    if len(shown):
        about = records(store, shown.members)
        keys = {record["source"] for record in about if record["source"] is not None}
        with store.reading() as connection:
            rows = sql.select(connection, "source", sql.among("id"), {"keys": sql.listed(keys)})
        files = {row[0]: row[COLUMNS["source"].index("path")] for row in rows}
        people = groups(store, shown.members).tolist()
        for record, movement, person in zip(about, movements(store, shown.members), people, strict=True):
            members.append(
                {
                    "id": record["id"],
                    "name": record["name"],
                    "source": files.get(record["source"]),
                    "place": record["place"],
                    "person": person,
                    "samples": record["n_samples"],
                    "duration": record["duration"],
                    "start": movement.positions[0].tolist(),
                    "goal": movement.positions[-1].tolist(),
                }
            )
    plain = {name: getattr(shown, name) for name in ("id", "name", "description", "prototype")}
    return plain | {"parents": list(shown.parents), "members": members}
