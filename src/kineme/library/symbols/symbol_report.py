"""A report of one symbol: its movements, their sources, and how they vary."""

from __future__ import annotations

from typing import Any

from kineme.library.storage.read import groups, movements, records
from kineme.library.storage.rows import among, listed, select
from kineme.library.storage.schema import COLUMNS
from kineme.library.storage.store import Store
from kineme.library.storage.symbols import symbol


def symbol_report(store: Store, who: str) -> dict[str, Any]:
    """A symbol as plain data.

    Returns
    -------
    dict
        ``id``, ``name``, ``description``, ``prototype``, ``parents``, and ``members``: per movement its id, name, file,
        position in the file, person, n_samples, duration [s], start and goal.
    """
    shown = symbol(store, who)
    members = []
    if len(shown):
        about = records(store, shown.members)
        files = _files(store, sorted({one["source"] for one in about if one["source"] is not None}))
        people = groups(store, shown.members).tolist()
        for one, movement, person in zip(about, movements(store, shown.members), people, strict=True):
            members.append(
                {
                    "id": one["id"],
                    "name": one["name"],
                    "source": files.get(one["source"]),
                    "place": one["place"],
                    "person": person,
                    "samples": one["n_samples"],
                    "duration": one["duration"],
                    "start": movement.positions[0].tolist(),
                    "goal": movement.positions[-1].tolist(),
                }
            )
    return {
        "id": shown.id,
        "name": shown.name,
        "description": shown.description,
        "prototype": shown.prototype,
        "parents": list(shown.parents),
        "members": members,
    }


def _files(store: Store, keys: list[int]) -> dict[int, str]:
    """Key of a source -> its path, as given."""
    with store.reading() as connection:
        rows = select(connection, "source", among("id"), {"keys": listed(keys)})
    path = COLUMNS["source"].index("path")
    return {row[0]: row[path] for row in rows}
