"""Libraries as an attacker makes them: a good one, changed by SQL, with all checksums computed anew.

The checksums have no key, so that anybody can; what is left to tell a hostile file by is what it defines and holds.
"""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing
from itertools import pairwise

import numpy as np
from library_samples import draw_movements

from kineme import ActionLibrary
from kineme.library.storage.connection import schema_seal
from kineme.library.storage.rows import seal
from kineme.library.storage.schema import COLUMNS
from kineme.library.storage.source import Source

SAMPLES = 8  # of every movement of a victim, in two dimensions


def make_victim(folder):
    """A library in which every table has rows, some of them removed; movements 1 to 6 have even stamps, 7 to 9 none."""
    kinds = ["wave", "nod", "bow"] * 2
    with ActionLibrary(folder, create=True) as library:
        library.learn(
            draw_movements(6, n_samples=SAMPLES, labels=kinds),
            source=Source("a.csv", "ab" * 32, 5, "csv", {"time": "t"}, "2024-01-01"),
            places=list(map(str, range(6))),
            groups=["anna", "ben", "anna", None, "ben", "anna"],
        )
        library.learn(draw_movements(3, seed=1, ragged=True, labels=["wave"] * 3))
        library.annotate("wave", "with the hand", prototype=1, threshold=0.5)
        library.merge(["nod"], "bow")
        library.assign([2], "nod")
        library.delete([6])
        library.release([9])
        with library.store.writing("reject", {"movements": [9]}):
            pass
    return folder


def reseal(connection):
    """Compute every checksum anew, as anybody can."""
    for table, columns in COLUMNS.items():
        key = columns[0]
        try:
            rows = connection.execute(f"SELECT {', '.join(columns)} FROM {table}").fetchall()
        except sqlite3.Error:
            continue
        for row in rows:
            try:
                crc = seal(table, row)
            except TypeError:  # no bytes where bytes should be: there is no right checksum
                crc = 0
            connection.execute(f"UPDATE {table} SET crc = ? WHERE {key} IS ?", (crc, row[0]))


def attack(path, statements=(), definitions=(), master=()):
    """Change a library: rows, then definitions, then the texts of definitions; all checksums fit afterwards."""
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        for statement in statements:
            connection.execute(*([statement] if isinstance(statement, str) else statement))
        reseal(connection)
        for statement in definitions:
            connection.execute(statement)
        if master:
            connection.execute("PRAGMA writable_schema = ON")
            for statement in master:
                connection.execute(statement)
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:  # reads the definitions anew
        try:
            value = schema_seal(connection)
            crc = seal("meta", ("schema", value))
            connection.execute("UPDATE meta SET value = ?, crc = ? WHERE key = 'schema'", (value, crc))
        except (sqlite3.Error, UnicodeDecodeError):
            pass  # such definitions that nobody can read on
    return path


def copy_of(source, target):
    """A copy to attack."""
    shutil.copyfile(source, target)
    return target


def make_endless(path, table="feature", levels=10):
    """Put pages behind the file, each with a hundred branches to the next one, before the root of a table."""
    with closing(sqlite3.connect(path)) as connection:
        size = connection.execute("PRAGMA page_size").fetchone()[0]
        root = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = ?", (table,)).fetchone()[0]
        pages = connection.execute("PRAGMA page_count").fetchone()[0]
    data = bytearray(path.read_bytes())
    leaf = bytes(data[(root - 1) * size : root * size])
    numbers = [root, *range(pages + 1, pages + levels + 1)]
    for at, to in pairwise(numbers):
        page = bytearray(size)
        cells = 100
        page[0:12] = (
            b"\x05\0\0"
            + cells.to_bytes(2, "big")
            + (size - 5 * cells).to_bytes(2, "big")
            + b"\0"
            + to.to_bytes(4, "big")
        )
        for k in range(cells):
            place = size - 5 * (k + 1)
            page[12 + 2 * k : 14 + 2 * k] = place.to_bytes(2, "big")
            page[place : place + 5] = to.to_bytes(4, "big") + bytes([k + 1])
        start = (at - 1) * size
        data[start : start + size] = page
    data[(numbers[-1] - 1) * size :] = leaf
    data[28:32] = (pages + levels).to_bytes(4, "big")
    path.write_bytes(data)


def floats(kind, *places, value=np.nan, size=16):
    """Bytes of small ascending numbers, with one value at some places."""
    numbers = np.linspace(0.1, 1, size).astype(kind)
    numbers[list(places)] = value
    return numbers.tobytes()


def _set(key, place, value):
    return f"UPDATE meta SET value = json_set(value, '$.{place}', {value}) WHERE key = '{key}'"


def _text(name, old, new):
    return f"UPDATE sqlite_master SET sql = replace(sql, '{old}', '{new}') WHERE name = '{name}'"


WIDE = SAMPLES * 2

#: Name -> (statements, definitions, texts of definitions, words of the error).
ROWS = {
    "duration is text": (["UPDATE movement SET duration = 'long' WHERE id = 2"], "duration is not a finite number"),
    "duration is infinite": (["UPDATE movement SET duration = 9e999 WHERE id = 2"], "duration is not a finite number"),
    "duration is negative": (["UPDATE movement SET duration = -1.0 WHERE id = 2"], "duration is not a finite number"),
    "duration is zero": (["UPDATE movement SET duration = 0.0 WHERE id = 2"], "duration is not a finite number"),
    "duration is lost beside t0": (["UPDATE movement SET t0 = 1e300 WHERE id = 2"], "time stamps of their own"),
    "duration and t0 overflow": (
        ["UPDATE movement SET t0 = 1.7e308, duration = 1.7e308 WHERE id = 2"],
        "duration is not a finite number",
    ),
    "t0 is infinite": (["UPDATE movement SET t0 = -9e999 WHERE id = 2"], "t0 is not a finite number"),
    "t0 is bytes": (["UPDATE movement SET t0 = x'00' WHERE id = 2"], "t0 is not a finite number"),
    "t0 of text beside stamps": (["UPDATE movement SET t0 = 'x' WHERE id = 8"], "t0 is not a finite number"),
    "samples of text beside stamps": (
        ["UPDATE movement SET n_samples = 'x' WHERE id = 8"],
        "n_samples is not a whole number",
    ),
    "stamps of no bytes": (["UPDATE raw SET times = x'' WHERE movement = 8"], "of the wrong size"),
    "no samples": (["UPDATE movement SET n_samples = 0 WHERE id = 2"], "n_samples is not a whole number from 4"),
    "samples below zero": (
        ["UPDATE movement SET n_samples = -8 WHERE id = 2"],
        "n_samples is not a whole number from 4",
    ),
    "samples as text": (["UPDATE movement SET n_samples = 'many' WHERE id = 2"], "n_samples is not a whole number"),
    "samples without end": (
        ["UPDATE movement SET n_samples = 1 << 60 WHERE id = 2"],
        "n_samples is not a whole number",
    ),
    "more samples than stored": (
        ["UPDATE movement SET n_samples = 1 << 39 WHERE id = 2"],
        "samples of movement 2: of the wrong size",
    ),
    "a digest of text": (["UPDATE movement SET digest = 'none' WHERE id = 2"], "digest is not a whole number"),
    "a name of bytes": (["UPDATE movement SET name = x'ff00' WHERE id = 2"], "name is not text"),
    "a label of bytes": (["UPDATE movement SET label = x'41' WHERE id = 2"], "label is not text"),
    "a label with U+0000": (
        ["UPDATE movement SET label = 'wave' || char(0) WHERE id = 2"],
        "label is not text .* without U[+]0000",
    ),
    "a name that is no Unicode": (
        ["UPDATE symbol_state SET name = CAST(x'77ff61' AS TEXT) WHERE id = 1"],
        "decode|cannot be read",
    ),
    "a symbol of bytes": (["UPDATE symbol_state SET name = x'41' WHERE id = 1"], "name is not text"),
    "a symbol without a name": (["UPDATE symbol_state SET name = '' WHERE id = 1"], "name is not text of 1"),
    "a symbol's name with U+0000": (
        ["UPDATE symbol_state SET name = 'a' || char(0) WHERE id = 1"],
        "name is not text .* without U[+]0000",
    ),
    "a name without end": (
        [("UPDATE symbol_state SET name = ? WHERE id = 1", ("x" * ((1 << 24) + 1),))],
        "name is not text of 1 to 16777216",
    ),
    "an id that a terminal obeys": (
        ["UPDATE symbol SET id = char(27) || '[2Jxxxxxxxxxxxx' WHERE key = 1"],
        "id is not 'sym-'",
    ),
    "an id with more behind U+0000": (
        ["UPDATE symbol SET id = id || char(0) || 'x' WHERE key = 1"],
        "id is not 'sym-'",
    ),
    "parents that are no JSON": (["UPDATE symbol_state SET parents = 'none' WHERE id = 1"], "parents that are no JSON"),
    "parents that are a number": (["UPDATE symbol_state SET parents = '17' WHERE id = 1"], "parents that are no JSON"),
    "parents that are numbers": (
        ["UPDATE symbol_state SET parents = '[1, 2]' WHERE id = 1"],
        "parents that are no JSON",
    ),
    "parents nested without end": (
        [("UPDATE symbol_state SET parents = ? WHERE id = 1", ("[" * 100_000,))],
        "parents that are no JSON",
    ),
    "a number of ten thousand digits": (
        [("UPDATE symbol_state SET parents = ? WHERE id = 1", (f"[{'9' * 10_000}]",))],
        "parents that are no JSON",
    ),
    "a threshold of text": (
        ["UPDATE symbol_state SET threshold = 'low' WHERE id = 1"],
        "threshold is not a finite number",
    ),
    "an infinite threshold": (
        ["UPDATE symbol_state SET threshold = 9e999 WHERE id = 1"],
        "threshold is not a finite number",
    ),
    "a prototype that is deleted": (
        ["UPDATE symbol_state SET prototype = 6 WHERE removed IS NULL AND prototype = 1"],
        "when its prototype is not",
    ),
    "a detail that is no JSON": (
        ["UPDATE version SET detail = '{' || char(10) WHERE id = 1"],
        "detail that is no JSON",
    ),
    "a detail that is a list": (["UPDATE version SET detail = '[]' WHERE id = 1"], "detail that is no JSON object"),
    "a rejection of nothing": (
        ["UPDATE version SET detail = '{}' WHERE action = 'reject'"],
        "a rejection without its list of movements",
    ),
    "a rejection of text": (
        ["""UPDATE version SET detail = '{"movements": ["x"]}' WHERE action = 'reject'"""],
        "a rejection without its list",
    ),
    "a time that is none": (["UPDATE version SET at = char(27) || '[31m' WHERE id = 1"], "at is not a time"),
    "an action of bytes": (["UPDATE version SET action = x'00' WHERE id = 1"], "action is not text"),
    "a version that is missing": (
        ["PRAGMA foreign_keys = OFF", "DELETE FROM version WHERE id = 2"],
        "refers to a row of table version|numbered from 1",
    ),
    "other counts": (
        ["UPDATE version SET movements = movements + 1 WHERE id = 3"],
        "counts other movements than there are",
    ),
    "counts of text": (["UPDATE version SET members = 'all' WHERE id = 3"], "members is not a whole number from 0"),
    "two symbols for one movement": (
        [
            "DROP INDEX member_now",
            "INSERT INTO member SELECT 100, movement, 1 + symbol % 2, how, added, removed, 0 FROM member WHERE id = 1",
            "UPDATE version SET members = members + 1",
            "CREATE UNIQUE INDEX member_now ON member (movement) WHERE removed IS NULL",
        ],
        None,
    ),
    "two symbols for one movement, then": (
        [
            "INSERT INTO member SELECT 100, movement, symbol, how, 1, 2, 0 FROM member WHERE id = 1",
            "UPDATE version SET members = members + 1 WHERE id = 1",
        ],
        "the movement shows two symbols at a time",
    ),
    "a member of what is deleted": (
        [
            "INSERT INTO member SELECT 100, 6, 1, 'label', max(id), NULL, 0 FROM version",
            "UPDATE version SET members = members + 1 WHERE id = (SELECT max(id) FROM version)",
        ],
        "is there when its movement is not",
    ),
    "a member of no symbol": (["UPDATE member SET symbol = 77 WHERE id = 1"], "refers to a row of table symbol"),
    "a member of text": (["UPDATE member SET movement = 'two' WHERE id = 1"], "movement is not a whole number"),
    "a member of infinity": (["UPDATE member SET movement = 9e999 WHERE id = 1"], "movement is not a whole number"),
    "shown by nobody": (["UPDATE shown_by SET person = '' WHERE movement = 2"], "person is not text of 1"),
    "shown by bytes": (["UPDATE shown_by SET person = x'41' WHERE movement = 2"], "person is not text"),
    "shown by whom a terminal ends": (
        ["UPDATE shown_by SET person = 'a' || char(0) WHERE movement = 2"],
        "person is not text .* without U[+]0000",
    ),
    "shown by somebody without a movement": (
        ["UPDATE shown_by SET movement = 77 WHERE movement = 2"],
        "refers to a row of table movement",
    ),
    "a strange way to a symbol": (["UPDATE member SET how = 'magic' WHERE id = 1"], "how|CHECK constraint"),
    "removed before it was added": (
        ["UPDATE member SET added = 3, removed = 1 WHERE id = 1"],
        "removed is not no version before",
    ),
    "a life that never began": (["UPDATE movement SET added = 'once' WHERE id = 2"], "added is not a whole number"),
    "positions that are NaN": (
        [("UPDATE raw SET positions = ? WHERE movement = 2", (floats(np.float32, 5, size=WIDE),))],
        "not finite",
    ),
    "positions that are infinite": (
        [("UPDATE raw SET positions = ? WHERE movement = 2", (floats(np.float32, 5, value=np.inf, size=WIDE),))],
        "not finite",
    ),
    "a start that is NaN": (
        [("UPDATE raw SET start = ? WHERE movement = 2", (floats(np.float64, 1, size=2),))],
        "not finite",
    ),
    "positions of text": (
        [("UPDATE raw SET positions = ? WHERE movement = 2", ("x" * 8 * WIDE,))],
        "positions is not bytes|damaged bytes",
    ),
    "positions of odd length": (["UPDATE raw SET positions = x'001122' WHERE movement = 2"], "wrong size|not finite"),
    "no positions": (["UPDATE raw SET positions = x'' WHERE movement = 2"], "of the wrong size"),
    "a movement that rests": (
        [f"UPDATE raw SET positions = zeroblob({4 * WIDE}) WHERE movement = 2"],
        "a movement that does not move",
    ),
    "stamps that stand still": (
        ["UPDATE raw SET times = zeroblob(length(times)) WHERE movement = 8"],
        "time stamps that do not lead",
    ),
    "stamps that are NaN": (
        [
            "UPDATE raw SET times = replace(hex(zeroblob(length(times) / 2)), '0', char(127)) WHERE movement = 8",
            "UPDATE raw SET times = CAST(times AS BLOB) WHERE movement = 8",
        ],
        "time stamps that do not lead",
    ),
    "stamps that go on after the end": (
        ["UPDATE movement SET duration = duration / 2 WHERE id = 8"],
        "time stamps that do not lead",
    ),
    "features that are NaN": (
        [("UPDATE feature SET rows = ? WHERE movement = 2", (floats(np.float32, 9, size=600),))],
        "not finite",
    ),
    "features of other size": (["UPDATE feature SET rows = zeroblob(8) WHERE movement = 2"], "features .* wrong size"),
    "weights that are infinite": (
        [("UPDATE primitive SET weights = ? WHERE movement = 2", (floats(np.float32, 9, value=-np.inf, size=80),))],
        "not finite",
    ),
    "a boundary that is NaN": (
        [("UPDATE primitive SET boundary = ? WHERE movement = 2", (floats(np.float64, 3, size=8),))],
        "not finite",
    ),
    "the samples of nobody": (
        ["UPDATE raw SET movement = 99 WHERE movement = 2"],
        "samples of movement 2: not there|refers to",
    ),
    "dimensions of text": (["UPDATE meta SET value = 'two' WHERE key = 'n_dims'"], "how many dimensions .* 'two'"),
    "no dimensions": (["UPDATE meta SET value = '0' WHERE key = 'n_dims'"], "how many dimensions .* '0'"),
    "dimensions below zero": (["UPDATE meta SET value = '-2' WHERE key = 'n_dims'"], "how many dimensions .* '-2'"),
    "dimensions without end": (["UPDATE meta SET value = '99999999999' WHERE key = 'n_dims'"], "how many dimensions"),
    "other dimensions": (["UPDATE meta SET value = '3' WHERE key = 'n_dims'"], "of the wrong size"),
    "dimensions not said": (
        ["DELETE FROM meta WHERE key = 'n_dims'"],
        "row n_dims of table meta: not there|wrong size",
    ),
    "more about the library": (["INSERT INTO meta VALUES ('evil', '1', 0)"], "nothing but .* got 'evil'"),
    "no id": (["DELETE FROM meta WHERE key = 'id'"], "its specification, as"),
    "a specification that is no JSON": (
        ["UPDATE meta SET value = '{' WHERE key = 'dmp'"],
        "specification that does not fit",
    ),
    "a specification that is a list": (
        ["UPDATE meta SET value = '[]' WHERE key = 'recognizer'"],
        "specification that does not fit",
    ),
    "a specification nested without end": (
        [("UPDATE meta SET value = ? WHERE key = 'recognizer'", ("[" * 100_000,))],
        "specification that does not fit",
    ),
    "points without end": (
        [_set("recognizer", "representations[0].n_points", "1000000000")],
        "specification that does not fit .*n_points",
    ),
    "points of text": (
        [_set("recognizer", "representations[0].n_points", "'x'")],
        "specification that does not fit .*n_points",
    ),
    "basis functions without end": (
        [_set("dmp", "n_basis", "1000000000")],
        "specification .*n_basis",
    ),
    "a stiffness that is none": (
        [_set("recognizer", "representations[1].stiffness", "-1")],
        "specification that does not fit .*stiffness",
    ),
    "an angle of text": (
        [_set("recognizer", "max_angle", "'wide'")],
        "specification .*max_angle",
    ),
    "a scale that is none": (
        [_set("recognizer", "scale", "'evil'")],
        "specification .*scale",
    ),
    "a mean that is none": (
        [_set("recognizer", "mean", "'evil'")],
        "specification .*mean",
    ),
    "a classifier that is none": (
        [_set("recognizer", "classifier", "'evil'")],
        "specification .*classifier",
    ),
    "weights of text": (
        [_set("recognizer", "weights", "json('[1, \"x\", 2]')")],
        "specification that does not fit",
    ),
    "no representation": (
        [_set("recognizer", "representations", "json('[]')")],
        "specification that does not fit",
    ),
    "options that are no JSON": (["UPDATE source SET options = 'a=b' WHERE id = 1"], "options that are no JSON object"),
    "a path of bytes": (["UPDATE source SET path = x'2f' WHERE id = 1"], "path is not text"),
    "a size below zero": (["UPDATE source SET size = -5 WHERE id = 1"], "size is not a whole number from 0"),
}

_ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT max(i) AS id FROM n"

#: Name -> (definitions, texts of definitions): the words of the error are the same for all.
DEFINITIONS = {
    "a trigger that deletes": (["CREATE TRIGGER t AFTER INSERT ON member BEGIN DELETE FROM movement; END"], ()),
    "a trigger on updates": (["CREATE TRIGGER t BEFORE UPDATE ON movement BEGIN SELECT RAISE(IGNORE); END"], ()),
    "a view beside the tables": ([f"CREATE VIEW more AS {_ENDLESS}"], ()),
    "an endless view for a table": (
        ["ALTER TABLE version RENAME TO kept", f"CREATE VIEW version AS {_ENDLESS.replace('AS id', 'AS id, 1 AS at')}"],
        (),
    ),
    "a table more": (["CREATE TABLE evil (a)"], ()),
    "a virtual table": (["CREATE VIRTUAL TABLE evil USING fts5(a)"], ()),
    "a virtual table of no module": (
        (),
        ["INSERT INTO sqlite_master VALUES ('table', 'v', 'v', 0, 'CREATE VIRTUAL TABLE v USING evil(a)')"],
    ),
    "statistics": (["ANALYZE"], ()),
    "a sequence": (["CREATE TABLE evil (a INTEGER PRIMARY KEY AUTOINCREMENT)", "DROP TABLE evil"], ()),
    "an index more": (["CREATE INDEX evil ON movement (name)"], ()),
    "an index of an expression": (["CREATE INDEX evil ON movement (abs(t0))"], ()),
    "an index less": (["DROP INDEX member_now"], ()),
    "a table less": (["DROP TABLE feature"], ()),
    "a column more": (["ALTER TABLE movement ADD COLUMN evil"], ()),
    "a computed column": (["ALTER TABLE movement ADD COLUMN evil AS (zeroblob(1000000000))"], ()),
    "a default that computes": (["ALTER TABLE source ADD COLUMN evil DEFAULT 'x'"], ()),
    "a table without row ids": (
        (),
        ["UPDATE sqlite_master SET sql = sql || ' WITHOUT ROWID' WHERE name = 'feature'"],
    ),
    "strict tables": ((), ["UPDATE sqlite_master SET sql = sql || ' STRICT' WHERE name = 'member'"]),
    "a check that calls a function": (
        (),
        [_text("member", "how IN", "load_extension(''x'') OR how IN")],
    ),
    "a collation that is unknown": (
        (),
        [
            "UPDATE sqlite_master SET sql = replace(sql, 'name TEXT NOT NULL', 'name TEXT COLLATE evil NOT NULL') "
            "WHERE name = 'symbol_state'"
        ],
    ),
    "a collation that is blind": (
        (),
        [_text("symbol_name", "(name)", "(name COLLATE NOCASE)")],
    ),
    "no uniqueness": ((), [_text("member_now", "UNIQUE ", "")]),
    "another blank": ((), [_text("meta", ", value", ",  value")]),
    "names that are exchanged": (
        (),
        [
            "UPDATE sqlite_master SET name = 'raw', tbl_name = 'raw', "
            "sql = replace(sql, 'TABLE primitive', 'TABLE raw') WHERE name = 'primitive'"
        ],
    ),
    "pages that are exchanged": (
        (),
        [
            "UPDATE sqlite_master SET rootpage = (SELECT rootpage FROM sqlite_master WHERE name = 'raw') "
            "WHERE name = 'primitive'"
        ],
    ),
    "a page that is not there": ((), ["UPDATE sqlite_master SET rootpage = 99999 WHERE name = 'raw'"]),
    "a definition of nothing": ((), ["UPDATE sqlite_master SET sql = NULL WHERE name = 'raw'"]),
    "a definition that is no SQL": ((), ["UPDATE sqlite_master SET sql = 'CREATE TABLE raw (' WHERE name = 'raw'"]),
    "a definition of bytes": (
        (),
        ["UPDATE sqlite_master SET sql = CAST(x'435245ff' AS TEXT) WHERE name = 'source_sha256'"],
    ),
}
