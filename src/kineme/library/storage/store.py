"""The open database of a library: reading at one version, writing one version at a time."""

from __future__ import annotations

import json
import sqlite3
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import wraps
from numbers import Integral
from pathlib import Path
from threading import Lock, RLock
from typing import Any, NamedTuple, NoReturn, TypeVar

from kineme.errors import DataError, SpecificationError
from kineme.library.storage import connection as sqlite
from kineme.library.storage import safety
from kineme.library.storage.channels import channels_of_text
from kineme.library.storage.rows import Database, Row, damaged, insert, next_key, parsed_column, seal, select
from kineme.library.storage.safety import size_of
from kineme.library.storage.schema import COUNTED, LARGEST_ID, READABLE, SCHEMA_VERSION
from kineme.library.storage.specification import Specification, as_n_dims
from kineme.movements.channels.channel import Channels

Result = TypeVar("Result")

_TRIES = 4  # of a change that others get in the way of
_ROOM = 1 << 24  # bytes that a copy may have beyond twice the size of the file

NOW = LARGEST_ID  # later than every version: the current state


class Store:
    """The open database of a library, which is created by the specification if there is none.

    With `as_of`, it shows the library as it was at that version. It waits so long for another writer [s].
    """

    path: Any  # of the file; of a library on a server, its address
    many_write = False

    def __init__(
        self,
        path: Any,
        specification: Specification | None = None,
        *,
        read_only: bool = False,
        as_of: int | None = None,
        wait: float = 10.0,
    ) -> None:
        self.path = path
        self.read_only = read_only or as_of is not None
        self.wait = wait
        self._write_turn = RLock()
        # Threads share the reading connection, one at a time: Python's statement cache may give one statement to two
        # threads with the same query, and each would get rows of the other. Closing waits for its turn too, since
        # SQLite would free memory of a running statement.
        self._read_turn = RLock()
        self._n_reading = 0  # nesting depth of the thread that reads
        self._writer: Any = None
        self._waking, self._asleep, self._closed = Lock(), False, False
        self._n_dims: int | None = None  # these two are written once
        self._channels: Channels | None = None
        if not self.exists(path, wait):
            if specification is None or self.read_only:
                raise DataError(
                    f"expected a library in {self.folder}, found {self._missing()} there; "
                    "make one by learning (in Python, with create=True), or correct the path"
                )
            self._create({"id": str(uuid.uuid4()), **specification.to_json()})
        with sqlite.in_plain_words(self.path, wait), safety.awake():
            self._reader: Any = self._connect()
            try:
                self._check_kind()
                meta = sqlite.checked_meta(self._reader, self.path)
                self.id = meta["id"]
                self.specification = Specification.from_json(meta, self.path)
                last = int(self._reader.execute("SELECT coalesce(max(id), 0) FROM version").fetchone()[0])
                if as_of is not None and not (isinstance(as_of, Integral) and 0 <= as_of <= last):
                    raise SpecificationError(f"expected a version from 0 to {last}, got {as_of!r}; see history()")
                self.as_of = NOW if as_of is None else int(as_of)
            except BaseException:
                self._reader.close()
                raise
            safety.register(self)

    def __reduce__(self) -> NoReturn:
        raise SpecificationError(
            f"expected the folder or address of a library, got the open one in {self.folder} to be pickled or copied; "
            "pass that, and open it in each process: kineme.ActionLibrary(folder)"
        )

    @classmethod
    def exists(cls, path: Any, wait: float = 10.0) -> bool:
        """Tell whether there is a library."""
        return bool(path.exists())

    def _missing(self) -> str:
        return f"no {self.path.name}"

    def _create(self, meta: dict[str, str]) -> None:
        sqlite.create(self.path, meta)

    def _connect(self) -> Database:
        safety.refuse_if_lost(self.path)
        return sqlite.connect(self.path, "ro" if self.read_only else "rw", self.wait).allow_forks()

    def sleep(self) -> None:
        """Close the connections for a fork; the next read or write opens them again."""
        if not self._closed and not self._asleep:
            self._asleep = True
            for connection in (self._writer, self._reader):
                if connection is not None:
                    connection.close()
            self._writer = None

    def carried_over(self) -> list[Database]:
        """Return the connections that were open at a fork; see `safety`."""
        if self._closed or self._asleep:
            return []
        return [connection for connection in (self._writer, self._reader) if connection is not None]

    def _wake(self) -> None:
        with self._waking:
            if self._asleep:
                self._check_there("read")
                self._reader = self._connect()
                self._asleep = False

    def _check_kind(self) -> None:
        """Refuse what is not a library; migrate an older one, unless it is only read and can be as it is."""
        version = self._kind()
        if version == SCHEMA_VERSION or (self.read_only and version >= READABLE):
            return
        if self.read_only:
            raise DataError(
                f"expected {self.path} to have schema version {SCHEMA_VERSION}, got an earlier one; "
                "open it once without read_only to bring it up to date"
            )
        self._migrate()

    def _kind(self) -> int:
        """Return the version of the schema; refused if it is a later one, or no library."""
        self._file = self.path.stat().st_ino
        return sqlite.check_kind(self._reader, self.path)

    def _migrate(self) -> None:
        sqlite.migrate(self._reader, self.path)

    @property
    def folder(self) -> Any:
        """The folder of the library; of one on a server, its address."""
        return self.path.parent

    @property
    def name(self) -> str:
        """The name of the library's folder; of one on a server, that of its schema."""
        return str(self.folder.resolve().name)

    def cache_path(self, name: str) -> Path | None:
        """Return the path of a cache file; None where no file of this user's own can be."""
        return Path(self.folder / name)

    @contextmanager
    def database(self, copy: Path) -> Iterator[sqlite3.Connection]:
        """Context manager: the library as a database of SQLite of which a copy is written, within limits."""
        most = 2 * size_of(self.path) + _ROOM
        with closing(sqlite.connect(self.path, "ro", self.wait)) as file, file.stopping(lambda: size_of(copy) > most):
            yield file

    @contextmanager
    def snapshot(self) -> Iterator[Database]:
        """Context manager: a connection of its own that sees the library at one moment, within limits."""
        with closing(sqlite.connect(self.path, "ro", self.wait)) as connection, safety.limited(connection, self.path):
            connection.execute("BEGIN")
            yield connection

    @property
    def size(self) -> int:
        """Bytes of the database and of its log."""
        self._check_there("read")
        return size_of(self.path)

    @property
    def version(self) -> int:
        """Number of the last committed transaction, or of the one shown."""
        if self.as_of != NOW:
            return self.as_of
        with self.reading() as connection:
            return int(connection.execute("SELECT coalesce(max(id), 0) FROM version").fetchone()[0])

    @property
    def n_dims(self) -> int | None:
        """Dimensions that all movements share; None before the first one."""
        if self._n_dims is None and (text := self._meta("n_dims")) is not None:
            self._n_dims = as_n_dims(text, self.path)
        return self._n_dims

    @property
    def channels(self) -> Channels | None:
        """Channels that the movements were recorded as; None before the first one, and where that is not known."""
        if self._channels is None and (text := self._meta("channels")) is not None:
            self._channels = channels_of_text(text, self.n_dims or 0, self.path)
        return self._channels

    def _meta(self, key: str) -> str | None:
        with self.reading() as connection:
            rows = select(connection, "meta", "key = :key", {"key": key})
        return rows[0][1] if rows else None

    @contextmanager
    def reading(self) -> Iterator[Database]:
        """Context manager: the connection to read committed versions from, of one thread at a time, also nested."""
        with safety.awake(), sqlite.in_plain_words(self.path, self.wait):
            # Before the lock: in a forked child, a thread that does not exist may hold it.
            safety.refuse_if_lost(self.path)
            with self._read_turn:
                if not self._n_reading:
                    self._check_open()
                    self._wake()
                self._n_reading += 1
                try:
                    yield self._reader
                finally:
                    self._n_reading -= 1

    def moment(self, connection: Database) -> Moment:
        """Return the shown version, which stays the same while new ones are added."""
        last = connection.execute("SELECT max(id) FROM version WHERE id <= :v", {"v": self.as_of}).fetchone()[0]
        if last is None:
            return Moment(0)
        rows = select(connection, "version", "id = :last", {"last": last})
        if not rows:
            raise damaged("version", (last,))
        return Moment(last, *rows[0][4:])

    @property
    def counts(self) -> Moment:
        """The shown version, and its numbers of movements, members and symbols."""
        with self.reading() as connection:
            return self.moment(connection)

    @contextmanager
    def _transaction(self, writer: Any, reserve: Mapping[str, int]) -> Iterator[dict[str, int]]:
        """Return a transaction, and the first keys that are reserved in each table: none."""
        with sqlite.transaction(writer):
            yield {}

    @contextmanager
    def writing(
        self, action: str, detail: dict[str, Any] | None = None, reserve: Mapping[str, int] | None = None
    ) -> Iterator[Change]:
        """Context manager: one transaction, which becomes one version; its `detail` is stored in the history.

        `reserve` is how many rows it adds to numbered tables, if `many_write`: a ConflictError if these are others.
        """
        with safety.awake(), sqlite.in_plain_words(self.path, self.wait):
            # Before the lock: in a forked child, a thread that does not exist may hold it.
            safety.refuse_if_lost(self.path)
            with self._write_turn:
                self._check_open()
                self._wake()
                self.check_writable()
                if self._writer is None:
                    self._writer = self._connect()
                with self._transaction(self._writer, reserve or {}) as first:
                    self.check_writable()  # again: waiting for the turn may have taken long
                    version = first.get("version") or self.moment(self._writer).version + 1
                    change = Change(self._writer, version, detail or {}, dict(first))
                    yield change
                    if reserve and first:
                        self._writer.wait_for_turn({table: key for table, key in first.items() if reserve[table]})
                    last = self.moment(self._writer)
                    counts = (getattr(last, name) + change.counts.get(name, 0) for name in COUNTED.values())
                    at = datetime.now(UTC).isoformat(timespec="milliseconds")
                    text = json.dumps(change.detail, ensure_ascii=False)
                    change.insert("version", [(version, at, action, text, *counts)])
                    if (
                        reserve
                        and first
                        and any(change.reserved[table] != first[table] + reserve[table] for table in first)
                    ):
                        raise sqlite.ConflictError(f"expected {dict(reserve)} rows, got others; run it again")

    def check_writable(self) -> None:
        """Refuse to write if opened for reading, or if the file is another one: what a deleted one gets is lost."""
        if self.read_only:
            raise DataError(
                f"expected to write to {self.path}, but it is open for reading only; open it again to write"
            )
        self._check_there("written")

    def _check_open(self) -> None:
        if self._closed:
            raise DataError(f"expected an open library, got {self.path}, which has been closed; open it again")

    def _check_there(self, done: str) -> None:
        try:
            there = self.path.stat().st_ino == self._file
        except OSError:
            there = False
        if not there:
            raise DataError(
                f"expected {self.path} where it was opened, but it was moved, deleted or replaced; nothing was "
                f"{done}: put it back, or open the library again"
            )

    def __del__(self) -> None:
        if hasattr(self, "_reader"):
            self.close()

    def close(self) -> None:
        """Close both connections, once no thread uses them; the last process to close leaves a single file."""
        if safety.is_lost(self.path):
            return
        with safety.awake():
            self._closed = True  # no new reads or writes begin
            with self._read_turn:
                self._reader.close()
            with self._write_turn:  # not nested: a thread that reads may want to write
                if self._writer is not None:
                    self._writer.close()


def repeated(change: Callable[..., Result]) -> Callable[..., Result]:
    """Let a change of a store that another writer got in the way of be made again, a few times."""

    @wraps(change)
    def again(*arguments: Any, **options: Any) -> Result:
        for _ in range(_TRIES - 1):
            with suppress(sqlite.ConflictError):  # nothing of it was stored
                return change(*arguments, **options)
        return change(*arguments, **options)

    return again


def history(store: Store) -> tuple[Version, ...]:
    """Return every change up to the version shown, the first one first."""
    with store.reading() as connection:
        rows = select(connection, "version", "id <= :v", {"v": store.as_of})
    return tuple(Version(row[0], row[1], row[2], parsed_column("version", row, "detail", dict)) for row in rows)


@dataclass(frozen=True)
class Version:
    """A version: its number from 1, when it was committed (ISO 8601, UTC), "learn", "rename", ..., and details."""

    id: int
    at: str
    action: str
    detail: Mapping[str, Any]


class Moment(NamedTuple):
    """A version and its numbers of alive rows, by which rows that damage has hidden are noticed."""

    version: int
    movements: int = 0
    members: int = 0
    symbols: int = 0


@dataclass(frozen=True)
class Change:
    """An open transaction."""

    connection: Database
    version: int
    detail: dict[str, Any]  # of the version, for the history
    reserved: dict[str, int]  # table -> its next key, where keys were reserved before
    counts: dict[str, int] = field(default_factory=dict)  # by how much the numbers of alive rows change

    def insert(self, table: str, rows: Sequence[Row]) -> None:
        """Add rows to a table."""
        insert(self.connection, table, rows)
        self._count(table, len(rows))
        if table in self.reserved:
            self.reserved[table] += len(rows)

    def next_key(self, table: str) -> int:
        """Return the key of the next row of a table."""
        return self.reserved[table] if self.reserved else next_key(self.connection, table)

    def retire(self, table: str, rows: Sequence[Row]) -> None:
        """Mark selected rows, whose last column is ``removed``, as removed from this version on."""
        gone = [(*row[:-1], self.version) for row in rows]
        statement = f"UPDATE {table} SET removed = ?, crc = ? WHERE id = ?"
        self.connection.executemany(statement, [(self.version, seal(table, row), row[0]) for row in gone])
        self._count(table, -len(rows))

    def _count(self, table: str, more: int) -> None:
        if table in COUNTED:
            self.counts[COUNTED[table]] = self.counts.get(COUNTED[table], 0) + more
