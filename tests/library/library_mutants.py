"""Libraries damaged or made hostile at random, and what must hold of whatever is still read from them.

`make fuzz` runs many of them in child processes under limits, `make test` a few.
"""

from __future__ import annotations

import functools
import sqlite3
import tempfile
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
from library_attacks import attack, make_victim
from library_samples import contents

import kineme
from kineme import ActionLibrary
from kineme.errors import KinemeError
from kineme.library.storage.connection import FILE
from kineme.library.storage.schema import COLUMNS

VALUES = (
    "NULL", "0", "1", "-1", "2", "77", "9223372036854775807", "-9223372036854775808", "0.5", "-1e308", "9e999", "'x'",
    "''", "'two'", "'[]'", "'{}'", "'[1]'", "'null'", "char(0)", "char(27) || '[2J'", "x''", "x'00'", "x'ffffffff'",
    "zeroblob(64)", "randomblob(64)", "zeroblob(1000000)", "CAST(x'ff' AS TEXT)", "'sym-000000000000'",
    "'{\"movements\": [1]}'", "'2024-01-01'", "'wave'",
)  # fmt: skip
DEFINITIONS = (
    "CREATE TABLE evil (a)", "CREATE VIEW evil AS SELECT 1", "DROP INDEX member_now", "DROP TABLE feature", "ANALYZE",
    "CREATE TRIGGER evil AFTER INSERT ON version BEGIN DELETE FROM movement; END",
    "ALTER TABLE movement ADD COLUMN evil", "ALTER TABLE raw RENAME COLUMN start TO begin",
)  # fmt: skip


@functools.cache
def exported():
    """The bytes of a good library."""
    with tempfile.TemporaryDirectory() as place:
        with ActionLibrary(make_victim(Path(place) / "actions"), read_only=True) as library:
            library.export(Path(place) / "export")
        return (Path(place) / "export").read_bytes()


def hostile_rows(rng, data):
    """A few cells, rows or definitions changed at random, with all checksums computed anew."""
    tables = [name for name in COLUMNS for _ in COLUMNS[name]]
    statements, definitions = [], []
    for _ in range(int(rng.integers(1, 4))):
        table = str(rng.choice(tables))
        column = str(rng.choice(COLUMNS[table]))
        kind = rng.random()
        where = f"rowid IN (SELECT rowid FROM {table} ORDER BY rowid LIMIT 1 OFFSET {rng.integers(8)})"
        if kind < 0.75:
            statements.append(f"UPDATE OR IGNORE {table} SET {column} = {rng.choice(VALUES)} WHERE {where}")
        elif kind < 0.85:
            statements.append(f"DELETE FROM {table} WHERE {where}")
        elif kind < 0.95:
            other = str(rng.choice(COLUMNS[table]))
            statements.append(f"UPDATE OR IGNORE {table} SET {column} = {other} WHERE {where}")
        else:
            definitions.append(str(rng.choice(DEFINITIONS)))
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "export"
        path.write_bytes(data)
        with suppress(sqlite3.Error):  # the definitions forbid it
            attack(path, statements, definitions)
        return path.read_bytes()


def damaged_pages(rng, data):
    """Bytes, words or whole pages changed where a page begins, in its list of cells, or anywhere."""
    spoiled = bytearray(data)
    size = int.from_bytes(data[16:18], "big") or 65536
    n = len(data) // size
    for _ in range(int(rng.integers(1, 6))):
        page = int(rng.integers(n)) * size
        kind = rng.random()
        if kind < 0.35:
            spoiled[page + int(rng.integers(0, 120))] = int(rng.integers(256))
        elif kind < 0.6:
            spoiled[page + int(rng.integers(size))] = int(rng.integers(256))
        elif kind < 0.75:
            at = page + int(rng.integers(0, size - 4))
            spoiled[at : at + 4] = int(rng.choice([0, 1, 2, n, n + 1, 2**31 - 1, 2**32 - 1])).to_bytes(4, "big")
        elif kind < 0.85:
            other = int(rng.integers(n)) * size
            spoiled[page : page + size] = data[other : other + size]
        else:
            del spoiled[int(rng.integers(len(spoiled))) :]
            spoiled += bytes(int(rng.integers(0, 2 * size)))
            break
    return bytes(spoiled)


MUTANTS = {"rows": hostile_rows, "pages": damaged_pages}


def read_mutant(data):
    """Import a file, and open it as a library; what is read of either is good, or a `KinemeError` says what is not."""
    with tempfile.TemporaryDirectory() as place:
        export, planted = Path(place) / "export", Path(place) / "planted"
        export.write_bytes(data)
        planted.mkdir()
        (planted / FILE).write_bytes(data)
        with suppress(KinemeError), ActionLibrary(planted, read_only=True) as library:
            library.verify()
            _look(library)
        with ActionLibrary.import_(export, Path(place) / "copy") as library:  # raises where the mutant is refused
            assert library.verify() == []
            check(library)
            return len(library)


def _look(library):
    for read in (
        contents,
        lambda it: it.movements(),
        lambda it: it.recognize(it.movements()),
        lambda it: it.propose(),
        lambda it: it.review(),
        lambda it: it.ground(it.symbols()[0].name if it.symbols() else "none"),
        lambda it: it.at(1).symbols(),
    ):
        with suppress(KinemeError):
            read(library)


def check(library):
    """Of a library that was imported, everything can be read and used, and it can be written to."""
    movements = library.movements() if len(library) else None
    if movements is not None:
        assert np.isfinite(movements.positions).all()
        assert np.isfinite(library.features()).all()
        assert np.isfinite(library.primitives().rollout().positions).all()
        if any(map(len, library.symbols())):
            library.recognize(movements)
    for version in range(library.version + 1):
        with library.at(version) as then:
            contents(then)
    library.propose()
    t = np.linspace(0, 1, 20)
    library.learn([np.column_stack([np.sin((2 + k) * t) for k in range(library.n_dims or 2)])], ["new"])
    assert library.verify() == []
    with closing(sqlite3.connect(library.store.path)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    repr(kineme.ActionLibrary)
