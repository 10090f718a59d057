"""The tables of a library, and the migrations of older ones.

Every committed transaction is a version. Rows are added and, at most once, removed: ``added`` and ``removed`` are
version numbers, so the state at version v is ``added <= v AND (removed IS NULL OR removed > v)``. Nothing is deleted.
"""

from __future__ import annotations

APPLICATION_ID = 0x6B696E65  # "kine", in the header of the file
SCHEMA_VERSION = 2
READABLE = 1  # the earliest version that is read as it is, since later ones added tables only
MAX_TEXT, MAX_DOCUMENT = 1 << 24, 1 << 26  # largest number of bytes of a name, and of a description or JSON
LARGEST_ID = (1 << 62) - 1  # of versions and rows; adding one does not overflow in SQLite and NumPy
UNDO, RESTORE = "undo", "restore"
RETURNS = (UNDO, RESTORE)  # actions of versions with the state of an earlier one, "to" in their detail
CONTINUES = "continues"  # in the detail of a version: the one before it, which was learned in the same call
PAGE_SIZE = 32768  # a row of features fills at most a seventh of it, so that little of a page is unused

#: Table -> its columns, the key first. Every table ends with a checksum of all of them, see `rows.seal`.
COLUMNS: dict[str, tuple[str, ...]] = {
    "meta": ("key", "value"),
    "version": ("id", "at", "action", "detail", "movements", "members", "symbols"),
    "source": ("id", "path", "sha256", "size", "read_at", "kind", "options", "added"),
    "movement": (
        "id", "source", "place", "digest", "name", "label", "n_samples", "t0", "duration", "added", "removed",
    ),
    "raw": ("movement", "start", "positions", "times"),
    "primitive": ("movement", "boundary", "weights"),
    "feature": ("movement", "rows"),
    "symbol": ("key", "id", "created"),
    "symbol_state": (
        "id", "symbol", "name", "description", "prototype", "threshold", "parents", "added", "removed",
    ),
    "member": ("id", "movement", "symbol", "how", "added", "removed"),
    "shown_by": ("movement", "person", "added"),
    "recorded": ("movement", "columns"),
}  # fmt: skip

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

#: Statements that create a library of version 1, with the columns of `COLUMNS`. No character may change, blanks
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
    ),
}
