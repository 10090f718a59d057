"""Rows of the tables, each with a checksum that detects damage."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

from kineme.errors import DataError, SpecificationError
from kineme.library.storage.schema import BLOBS, COLUMNS, GOOD, MAX_TEXT, OPTIONAL_BLOBS, SINCE

Row = tuple[Any, ...]

_PARAMETERS = 999  # parameters per statement that every build of SQLite allows


class Database(Protocol):
    """A connection to the tables of a library. Statements are those of SQLite, which that of a server translates."""

    def execute(self, statement: str, parameters: Any = ..., /) -> Any:
        """Execute a statement."""

    def executemany(self, statement: str, parameters: Any, /) -> Any:
        """Execute a statement with each of several parameters."""

    def close(self) -> None:
        """Close the connection."""


#: A row at version :v.
ALIVE = "added <= :v AND (removed IS NULL OR removed > :v)"


def seal(table: str, row: Row) -> int:
    """Return CRC-32 over all columns of a row, its key first."""
    if table in (*BLOBS, *OPTIONAL_BLOBS):
        crc: int = row[0] & 0xFFFFFFFF
        for blob in row[1:]:
            crc = zlib.crc32(blob or b"", crc)
        return crc
    return zlib.crc32(repr(row).encode())


def insert(connection: Database, table: str, rows: Sequence[Row]) -> None:
    """Add rows, in the order of `COLUMNS`, each with its seal; many per statement: between two the GIL moves."""
    if copy_rows := getattr(connection, "copy_rows", None):  # of a server
        copy_rows(table, [(*row, seal(table, row)) for row in rows])
        return
    width = len(COLUMNS[table]) + 1
    step = _PARAMETERS // width
    mark = f"({', '.join('?' * width)})"
    for k in range(0, len(rows), step):
        some = rows[k : k + step]
        values = [value for row in some for value in (*row, seal(table, row))]
        connection.execute(f"INSERT INTO {table} VALUES {', '.join([mark] * len(some))}", values)


def select(
    connection: Database, table: str, where: str = "TRUE", parameters: dict[str, Any] | None = None
) -> list[Row]:
    """Return rows of a table ordered by key, with checked seals and values, without the seals."""
    columns = COLUMNS[table]
    query = f"SELECT {', '.join(columns)}, crc, {GOOD[table]} FROM {table} WHERE {where} ORDER BY {columns[0]}"
    rows = connection.execute(query, parameters or {}).fetchall()
    for row in rows:
        if not row[-1] or seal(table, row[:-2]) != row[-2]:
            raise damaged(table, row) if not sealed(table, row[:-1]) else strange(table, row)
    return [row[:-2] for row in rows]


def has_table(connection: Database, table: str) -> bool:
    """Tell whether a library has a table: one of an earlier version that is only read lacks the later ones."""
    version = getattr(connection, "schema_version", None)  # of a server
    if version is None:
        version = connection.execute("PRAGMA user_version").fetchone()[0]
    return bool(version >= SINCE.get(table, 1))


def sealed(table: str, row: Row) -> bool:
    """Tell whether a row matches its seal, which is its last column."""
    try:
        return seal(table, row[:-1]) == row[-1]
    except TypeError:  # a value of another type than was stored
        return False


def damaged(table: str, row: Row) -> DataError:
    """Return the error for a row whose seal does not match."""
    return damage(f"{row_name(table, row[0])} as stored", "damaged bytes")


def strange(table: str, row: Row) -> DataError:
    """Return the error for a row that matches its seal but has an invalid value."""
    return damage(f"{row_name(table, row[0])} as a library stores it", "values that no library holds")


def parsed(text: str) -> Any:
    """Return JSON as plain data; a ValueError if it is invalid, or nested too deeply."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("expected JSON, got some that is nested too deeply") from error


def parsed_column(table: str, row: Row, column: str, kind: type) -> Any:
    """Return the JSON of a column, which must be a list or an object."""
    try:
        value = parsed(row[COLUMNS[table].index(column)])
    except ValueError:
        value = None
    if not isinstance(value, kind):
        raise strange(table, row)
    return value


def damage(expected: str, got: str) -> DataError:
    """Return the error for damage, with a description."""
    return DataError(
        f"expected {expected}, got {got}; kineme library verify names all that is damaged: "
        "take the file from a backup or an export"
    )


def row_name(table: str, key: Any) -> str:
    """Return the name of a row in messages."""
    of_movement = {
        "raw": "the samples",
        "primitive": "the primitive",
        "feature": "the features",
        "recorded": "the recorded columns",
    }
    return f"{of_movement[table]} of movement {key}" if table in of_movement else f"row {key} of table {table}"


def among(column: str) -> str:
    """Return SQL condition that `column` is in the list that is passed as parameter ``keys``, see `listed`."""
    return f"{column} IN (SELECT value FROM json_each(:keys))"


def listed(values: Iterable[Any]) -> str:
    """Return numbers or texts as the parameter of `among`."""
    return json.dumps([value if isinstance(value, str) else int(value) for value in values])


def next_key(connection: Database, table: str) -> int:
    """Return the key of the next row of a table; keys are never reused."""
    largest = connection.execute(f"SELECT max({COLUMNS[table][0]}) FROM {table}").fetchone()[0]
    return (largest or 0) + 1


def as_text(value: Any) -> str:
    """Return text that the database can store: bytes that are not Unicode, as in some file names, are escaped."""
    text = str(value).encode("utf-8", "backslashreplace").decode("utf-8")
    check_text("a name", text, MAX_TEXT)
    return text


def check_text(what: str, text: str, most: int) -> None:
    """Refuse a text with lone surrogates, or of more bytes than `most`."""
    try:
        size = len(text.encode())
    except UnicodeEncodeError as error:
        raise SpecificationError(
            f"expected {what} in Unicode, got {text[:40]!r}, which holds half of a character; decode it again"
        ) from error
    if size > most:
        raise SpecificationError(
            f"expected {what} of at most {most:,} bytes, got {size:,}: {text[:40]!r}...; shorten it"
        )
