"""The tables of a library, the migrations of older ones, and the valid values of every column.

Every committed transaction is a version. Rows are added and, at most once, removed: ``added`` and ``removed`` are
version numbers, so the state at version v is ``added <= v AND (removed IS NULL OR removed > v)``. Nothing is deleted.

A checksum detects changes of a row, but anybody can compute it: a file from elsewhere may contain anything under right
checksums. Therefore types and ranges of every column are checked too, by one SQL condition each, which SQLite evaluates
with the row: when rows are read, on import and by `verify`.
"""

from __future__ import annotations

from typing import NamedTuple

from kineme.validation import MIN_SAMPLES

APPLICATION_ID = 0x6B696E65  # "kine", in the header of the file
SCHEMA_VERSION = 2
READABLE = 1  # the earliest version that is read as it is, since later ones added tables only
MAX_TEXT, MAX_DOCUMENT = 1 << 24, 1 << 26  # largest number of bytes of a name, and of a description or JSON
LARGEST_ID = (1 << 62) - 1  # of versions and rows; adding one does not overflow in SQLite and NumPy
UNDO, RESTORE = "undo", "restore"
RETURNS = (UNDO, RESTORE)  # actions of versions with the state of an earlier one, "to" in their detail
CONTINUES = "continues"  # in the detail of a version: the one before it, which the same call made
PAGE_SIZE = 32768  # a row of features fills at most a seventh of it, so that little of a page is unused

#: Keys of the table `meta`; those of the second are written with the first movement, "channels" if they are known.
META = frozenset({"id", "recognizer", "dmp", "schema"})
LATER_META = frozenset({"n_dims", "channels"})

#: Table -> the schema version that added it, if not the first.
SINCE = {"shown_by": 2, "recorded": 2}

#: Tables of a key and bytes, one row per movement.
BLOBS = ("raw", "primitive", "feature")

#: As `BLOBS`, for movements with channels that their positions do not say.
OPTIONAL_BLOBS = ("recorded",)

#: Tables whose rows are alive or removed; each version stores the number of alive rows, in columns of these names.
COUNTED = {"movement": "movements", "member": "members", "symbol_state": "symbols"}

#: Statements that create a library of version 1, with the columns of `CHECKS`. No character may change, blanks
#: included: SQLite stores these texts, and a library with other texts is refused.
CREATE = (
    "CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL, crc INTEGER NOT NULL)",
    """CREATE TABLE version (
        id INTEGER PRIMARY KEY, at TEXT NOT NULL, action TEXT NOT NULL, detail TEXT NOT NULL,
        movements INTEGER NOT NULL, members INTEGER NOT NULL, symbols INTEGER NOT NULL, crc INTEGER NOT NULL)""",
    """CREATE TABLE source (
        id INTEGER PRIMARY KEY, path TEXT NOT NULL, sha256 TEXT NOT NULL, size INTEGER NOT NULL, read_at TEXT NOT NULL,
        kind TEXT NOT NULL, options TEXT NOT NULL, added INTEGER NOT NULL REFERENCES version, crc INTEGER NOT NULL)""",
    """CREATE TABLE movement (
        id INTEGER PRIMARY KEY, source INTEGER REFERENCES source, place TEXT, digest INTEGER NOT NULL, name TEXT,
        label TEXT, n_samples INTEGER NOT NULL, t0 REAL NOT NULL, duration REAL NOT NULL,
        added INTEGER NOT NULL REFERENCES version, removed INTEGER REFERENCES version, crc INTEGER NOT NULL)""",
    """CREATE TABLE raw (
        movement INTEGER PRIMARY KEY REFERENCES movement, start BLOB NOT NULL, positions BLOB NOT NULL, times BLOB,
        crc INTEGER NOT NULL)""",
    """CREATE TABLE primitive (
        movement INTEGER PRIMARY KEY REFERENCES movement, boundary BLOB NOT NULL, weights BLOB NOT NULL,
        crc INTEGER NOT NULL)""",
    """CREATE TABLE feature (
        movement INTEGER PRIMARY KEY REFERENCES movement, rows BLOB NOT NULL, crc INTEGER NOT NULL)""",
    """CREATE TABLE symbol (
        key INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, created INTEGER NOT NULL REFERENCES version,
        crc INTEGER NOT NULL)""",
    """CREATE TABLE symbol_state (
        id INTEGER PRIMARY KEY, symbol INTEGER NOT NULL REFERENCES symbol, name TEXT NOT NULL,
        description TEXT NOT NULL, prototype INTEGER REFERENCES movement, threshold REAL, parents TEXT NOT NULL,
        added INTEGER NOT NULL REFERENCES version, removed INTEGER REFERENCES version, crc INTEGER NOT NULL)""",
    """CREATE TABLE member (
        id INTEGER PRIMARY KEY, movement INTEGER NOT NULL REFERENCES movement, symbol INTEGER NOT NULL
        REFERENCES symbol, how TEXT NOT NULL CHECK (how IN ('label', 'anchored', 'recognized')),
        added INTEGER NOT NULL REFERENCES version, removed INTEGER REFERENCES version, crc INTEGER NOT NULL)""",
    # Among alive rows a recording is stored once, a name belongs to one symbol, a movement to at most one symbol.
    "CREATE UNIQUE INDEX movement_digest ON movement (digest) WHERE removed IS NULL",
    "CREATE UNIQUE INDEX movement_place ON movement (source, place) WHERE removed IS NULL AND source IS NOT NULL",
    "CREATE UNIQUE INDEX symbol_name ON symbol_state (name) WHERE removed IS NULL",
    "CREATE UNIQUE INDEX symbol_now ON symbol_state (symbol) WHERE removed IS NULL",
    "CREATE UNIQUE INDEX member_now ON member (movement) WHERE removed IS NULL",
    "CREATE INDEX source_sha256 ON source (sha256)",
)

#: Schema version -> the statements from it to the next one, for an existing library and for a new one.
MIGRATIONS: dict[int, tuple[str, ...]] = {
    1: (
        """CREATE TABLE shown_by (
        movement INTEGER PRIMARY KEY REFERENCES movement, person TEXT NOT NULL,
        added INTEGER NOT NULL REFERENCES version, crc INTEGER NOT NULL)""",
        """CREATE TABLE recorded (
        movement INTEGER PRIMARY KEY REFERENCES movement, columns BLOB NOT NULL, crc INTEGER NOT NULL)""",
    )
}

_LARGEST_REAL = "1.7976931348623157e308"


class Check(NamedTuple):
    """A SQL condition that is TRUE for valid values, its text for messages, and a cheaper part of it."""

    condition: str
    words: str
    quick: str = ""


def _integer(name: str, least: int = 1, most: int = LARGEST_ID) -> Check:
    limits = f"a whole number from {least}" if most == LARGEST_ID else f"a whole number from {least} to {most}"
    return Check(f"typeof({name}) = 'integer' AND {name} BETWEEN {least} AND {most}", limits)


def _real(name: str) -> Check:
    return Check(f"typeof({name}) = 'real' AND {name} BETWEEN -{_LARGEST_REAL} AND {_LARGEST_REAL}", "a finite number")


def _text(name: str, least: int = 0, most: int = MAX_TEXT) -> Check:
    size = f"length(CAST({name} AS BLOB))"
    kind = f"typeof({name}) = 'text'"
    return Check(f"{kind} AND {size} BETWEEN {least} AND {most}", f"text of {least} to {most} bytes", kind)


def _name(name: str) -> Check:
    text = _text(name, 1)
    return Check(f"{text.condition} AND instr({name}, char(0)) = 0", f"{text.words} without U+0000", text.quick)


def _bytes(name: str) -> Check:
    return Check(f"typeof({name}) = 'blob'", "bytes")


def _or_none(name: str, check: Check) -> Check:
    quick = f"({name} IS NULL OR {check.quick})" if check.quick else ""
    return Check(f"({name} IS NULL OR ({check.condition}))", f"{check.words}, or nothing", quick)


#: The versions from which and until which a row is alive.
_ADDED = {"added": _integer("added")}
_ALIVE = _ADDED | {
    "removed": Check(
        "(removed IS NULL OR (typeof(removed) = 'integer' AND removed >= added))", "no version before `added`"
    )
}

#: Table -> column, in the order of the table -> the condition on its values.
CHECKS: dict[str, dict[str, Check]] = {
    "meta": {"key": _text("key", 1), "value": _text("value", 1, MAX_DOCUMENT)},
    "version": {
        "id": _integer("id"),
        "at": Check(
            "typeof(at) = 'text' AND at GLOB '[0-9][0-9][0-9][0-9]-[0-9]*' AND length(CAST(at AS BLOB)) < 40", "a time"
        ),
        "action": _text("action", 1, 64),
        "detail": _text("detail", 2, MAX_DOCUMENT),
        **{count: _integer(count, 0) for count in COUNTED.values()},
    },
    "source": {
        "id": _integer("id"),
        "path": _text("path"),
        "sha256": _text("sha256"),
        "size": _integer("size", 0),
        "read_at": _text("read_at"),
        "kind": _text("kind"),
        "options": _text("options", 2, MAX_DOCUMENT),
        **_ADDED,
    },
    "movement": {
        "id": _integer("id"),
        "source": _or_none("source", _integer("source")),
        "place": _or_none("place", _text("place")),
        "digest": Check("typeof(digest) = 'integer'", "a whole number"),
        "name": _or_none("name", _text("name")),
        "label": _or_none("label", _name("label")),
        "n_samples": _integer("n_samples", MIN_SAMPLES, 1 << 40),
        "t0": _real("t0"),
        "duration": Check(
            f"{_real('duration').condition} AND duration > 0 AND t0 + duration / (n_samples - 1) > t0 "
            f"AND t0 + duration - duration / (n_samples - 1) < t0 + duration AND t0 + duration <= {_LARGEST_REAL}",
            "a finite number above 0, in which its samples have time stamps of their own",
        ),
        **_ALIVE,
    },
    "raw": {
        "movement": _integer("movement"),
        "start": _bytes("start"),
        "positions": _bytes("positions"),
        "times": _or_none("times", _bytes("times")),
    },
    "primitive": {"movement": _integer("movement"), "boundary": _bytes("boundary"), "weights": _bytes("weights")},
    "feature": {"movement": _integer("movement"), "rows": _bytes("rows")},
    "symbol": {
        "key": _integer("key"),
        "id": Check(
            f"typeof(id) = 'text' AND length(CAST(id AS BLOB)) = 16 AND id GLOB 'sym-{'[0-9a-f]' * 12}'",
            "'sym-' and twelve hexadecimal digits",
        ),
        "created": _integer("created"),
    },
    "symbol_state": {
        "id": _integer("id"),
        "symbol": _integer("symbol"),
        "name": _name("name"),
        "description": _text("description", most=MAX_DOCUMENT),
        "prototype": _or_none("prototype", _integer("prototype")),
        "threshold": _or_none("threshold", _real("threshold")),
        "parents": _text("parents", 2, MAX_DOCUMENT),
        **_ALIVE,
    },
    "member": {
        "id": _integer("id"),
        "movement": _integer("movement"),
        "symbol": _integer("symbol"),
        "how": Check("how IN ('label', 'anchored', 'recognized')", "how a movement came to its symbol"),
        **_ALIVE,
    },
    "shown_by": {"movement": _integer("movement"), "person": _name("person"), **_ADDED},
    "recorded": {"movement": _integer("movement"), "columns": _bytes("columns")},
}

#: Table -> its columns, the key first. Every table ends with a checksum of all of them, see `rows.seal`.
COLUMNS = {table: tuple(checks) for table, checks in CHECKS.items()}

#: Table -> the condition that is checked whenever a row is read, and the one of import and `verify`.
GOOD = {
    table: f"({' AND '.join(check.quick or check.condition for check in checks.values())}) IS TRUE"
    for table, checks in CHECKS.items()
}
ALL_GOOD = {
    table: f"({' AND '.join(check.condition for check in checks.values())}) IS TRUE" for table, checks in CHECKS.items()
}
