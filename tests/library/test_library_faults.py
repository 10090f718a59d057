"""Crashes, full disks, other writers, missing permissions: nothing is lost, and the error says what to do."""

from __future__ import annotations

import os
import re
import resource
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from library_crashes import check_what_is_left, kill_while_learning
from library_samples import contents, draw_movements

from kineme import ActionLibrary
from kineme.errors import DataError
from kineme.library import commit
from kineme.library.storage import connection, store
from kineme.library.storage.connection import FILE


@pytest.fixture
def folder(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as actions:
        actions.learn(draw_movements(12, labels=["wave", "nod", "bow"] * 4))
    return tmp_path / "actions"


@pytest.fixture(scope="module")
def open_place():
    """A folder that another user may enter, which pytest's own are not."""
    place = Path(tempfile.mkdtemp())
    place.chmod(0o755)
    yield place
    shutil.rmtree(place)


@contextmanager
def nobody():
    """Without the rights of root, for whom nothing is read-only."""
    root = os.geteuid() == 0
    if root:
        try:
            os.seteuid(65534)
        except OSError as error:  # some containers know no other user
            pytest.skip(f"root cannot become another user here: {error}")
    try:
        yield
    finally:
        if root:
            os.seteuid(0)


@contextmanager
def files_up_to(size):
    """As on a full disk: no file of this process grows beyond `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_process_killed_while_learning_leaves_whole_batches(tmp_path):
    """`make soak` kills a hundred."""
    before = 0
    for after in (0.013, 0.101):
        acknowledged = kill_while_learning(tmp_path, after)
        n = check_what_is_left(tmp_path, acknowledged)
        assert n >= before
        before = n


def test_a_full_disk_stores_nothing_of_a_batch_and_all_of_those_before(folder):
    with ActionLibrary(folder) as library:
        before = contents(library)
        with files_up_to(1 << 20), pytest.raises(DataError, match=r"run it again"):
            library.learn(draw_movements(2000, seed=1))
        assert contents(library) == before
        assert library.verify() == []
        assert library.learn(draw_movements(2000, seed=1)).added == 2000


def test_a_full_disk_leaves_no_half_an_export_and_no_half_a_library(folder, tmp_path):
    with ActionLibrary(folder) as library:
        with files_up_to(1 << 16), pytest.raises(DataError, match=r"x\.kineme"):
            library.export(tmp_path / "x.kineme")
        library.export(tmp_path / "y.kineme")
    with files_up_to(1 << 16), pytest.raises(DataError, match=r"y\.kineme|library\.sqlite"):
        ActionLibrary.import_(tmp_path / "y.kineme", tmp_path / "copy")
    with files_up_to(1 << 14), pytest.raises(DataError, match=FILE):
        ActionLibrary(tmp_path / "new", create=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["actions", "copy", "new", "y.kineme"]
    assert not list((tmp_path / "copy").iterdir())
    assert not list((tmp_path / "new").iterdir())


def test_a_second_writer_waits_for_its_turn(folder):
    with ActionLibrary(folder) as library, closing(_raw(folder)) as other:
        other.execute("BEGIN IMMEDIATE")
        timer = threading.Timer(0.2, other.execute, ["COMMIT"])
        timer.start()
        library.rename("wave", "greeting")
        timer.join()
        assert "greeting" in library


def test_a_second_writer_is_refused_when_its_turn_does_not_come(folder):
    with ActionLibrary(folder, wait=0.05) as library, closing(_raw(folder)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(DataError, match=r"got no turn: another process has been writing for more than 0\.05 s"):
            library.rename("wave", "greeting")
        assert library["wave"].name == "wave"  # reading goes on
        other.execute("ROLLBACK")
        library.rename("wave", "greeting")


def _raw(folder):
    return sqlite3.connect(folder / FILE, isolation_level=None, check_same_thread=False)


def test_two_writers_of_the_same_movements_store_them_once(tmp_path):
    batches = [draw_movements(20, seed=k, labels=["a", "b"] * 10) for k in range(8)]
    with ActionLibrary(tmp_path, create=True):
        pass

    def write(order):
        with ActionLibrary(tmp_path, wait=60) as library:
            return sum(library.learn(batches[k]).added for k in order)

    with ThreadPoolExecutor(2) as pool:
        added = list(pool.map(write, (range(8), range(7, -1, -1))))
    with ActionLibrary(tmp_path) as library:
        assert sum(added) == len(library) == 160
        assert sorted(len(symbol) for symbol in library.symbols()) == [80, 80]
        assert library.verify() == []


def test_what_another_writer_learned_meanwhile_is_no_version_of_its_own(tmp_path, monkeypatch):
    movements, serialize = draw_movements(4, labels=["a"] * 4), commit.serialize_new
    with ActionLibrary(tmp_path, create=True) as library, ActionLibrary(tmp_path) as other:

        def overtaken(*arguments):
            monkeypatch.setattr(commit, "serialize_new", serialize)
            other.learn(movements)
            serialize(*arguments)

        monkeypatch.setattr(commit, "serialize_new", overtaken)
        report = library.learn(movements)
        assert (report.added, report.duplicates, report.ids.tolist()) == (0, 4, [1, 2, 3, 4])
        assert len(library.history()) == 1
        library.undo()
        assert not len(library)


def test_readers_see_whole_versions_while_another_one_writes(tmp_path):
    done = threading.Event()
    with ActionLibrary(tmp_path, create=True) as library:
        library.learn(draw_movements(20, n_samples=10, labels=["a"] * 20))

        def read():
            looks = 0
            with ActionLibrary(tmp_path, read_only=True) as reader:
                while not done.is_set() or not looks:
                    ids = reader.ids()
                    assert len(ids) % 20 == 0
                    assert reader.features(ids[-20:]).shape == (
                        20,
                        400 + 134,
                    )  # those of two representations, and positions in detail
                    assert len(reader["a"]) % 20 == 0
                    looks += 1
            return looks

        with ThreadPoolExecutor(3) as pool:
            looks = [pool.submit(read) for _ in range(3)]
            for k in range(1, 12):
                library.learn(draw_movements(20, seed=k, n_samples=10, labels=["a"] * 20))
            done.set()
            assert all(look.result() for look in looks)


def test_reading_works_in_a_read_only_folder_and_writing_is_refused_there(open_place):
    folder = open_place / "actions"
    with ActionLibrary(folder, create=True) as library:
        library.learn(draw_movements(5, labels=["a"] * 5))
        expected = contents(library)
    (folder / FILE).chmod(0o444)
    folder.chmod(0o555)
    with nobody():
        if not os.access(folder, os.R_OK | os.X_OK, effective_ids=True):
            pytest.skip(f"other users cannot enter {tempfile.gettempdir()}")
        with ActionLibrary(folder, read_only=True) as library:
            assert contents(library) == expected
            assert library.verify() == []
            with pytest.raises(DataError, match=r"it is open for reading only; open it again to write"):
                library.rename("a", "b")
        with pytest.raises(DataError, match=r"read_only=True"), ActionLibrary(folder) as library:
            library.rename("a", "b")
        with pytest.raises(DataError, match=r"Permission denied"):
            ActionLibrary(folder / "inside", create=True)
    folder.chmod(0o755)
    assert [path.name for path in folder.iterdir()] == [FILE]


@pytest.mark.parametrize("gone", ["deleted", "replaced", "moved"])
def test_a_file_that_vanished_is_not_written_to_nor_called_damaged(folder, gone):
    with ActionLibrary(folder) as library:
        if gone == "moved":
            folder.rename(folder.with_name("elsewhere"))
        else:
            (folder / FILE).unlink()
            if gone == "replaced":
                (folder / FILE).write_bytes(b"something else")
        with pytest.raises(DataError, match=r"moved, deleted or replaced; nothing was written: put it back"):
            library.learn(draw_movements(3, seed=5))
        with pytest.raises(DataError, match=r"moved, deleted or replaced; nothing was read: put it back"):
            library.movements()


def test_a_library_of_a_later_version_is_refused_and_left_alone(folder):
    with closing(_raw(folder)) as other:
        other.execute("PRAGMA user_version = 7")
    before = (folder / FILE).read_bytes()
    for options in ({}, {"create": True}, {"read_only": True}):
        with pytest.raises(DataError, match=r"schema version 2 or earlier, got 7; upgrade kineme"):
            ActionLibrary(folder, **options)
    assert (folder / FILE).read_bytes() == before


def test_an_earlier_library_is_brought_up_to_date_in_one_step(folder, monkeypatch):
    for module in (connection, store):
        monkeypatch.setattr(module, "SCHEMA_VERSION", 4)
    monkeypatch.setattr(store, "READABLE", 4)
    steps = {
        **connection.MIGRATIONS,
        2: ("CREATE TABLE extra (a)",),
        3: ("INSERT INTO extra VALUES (1)", "not SQL"),
    }
    monkeypatch.setattr(connection, "MIGRATIONS", steps)
    with pytest.raises(DataError, match=r"schema version 4, got an earlier one; open it once without read_only"):
        ActionLibrary(folder, read_only=True)
    with pytest.raises(sqlite3.OperationalError, match="syntax"):
        ActionLibrary(folder)
    steps[3] = steps[3][:1]
    with ActionLibrary(folder) as library:  # the step before the one that failed has not been kept: it can run again
        assert len(library) == 12
    with closing(_raw(folder)) as other:
        assert other.execute("PRAGMA user_version").fetchone() == (4,)
        assert other.execute("SELECT a FROM extra").fetchall() == [(1,)]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: None, r"expected a library in .*, found no library\.sqlite there; make one by learning"),
        (lambda path: path.write_bytes(b"PK\x03\x04" * 500), r"to be a library, got a file that is no database"),
        (
            lambda path: path.write_bytes(b""),
            r"library of kineme, got an empty file; correct the path, or take it from a",
        ),
        (lambda path: sqlite3.connect(path).execute("CREATE TABLE t (a)").connection.close(), r"another program's"),
        (lambda path: path.mkdir(), r"unable to open database file|read_only"),
    ],
)
def test_what_is_no_library_is_refused_and_left_alone(tmp_path, make, message):
    make(tmp_path / FILE)
    before = (tmp_path / FILE).read_bytes() if (tmp_path / FILE).is_file() else None
    with pytest.raises(DataError, match=message):
        ActionLibrary(tmp_path)
    if before is not None:
        with pytest.raises(DataError, match=message):
            ActionLibrary(tmp_path, create=True)
        assert (tmp_path / FILE).read_bytes() == before


def test_a_header_of_no_known_format_is_damaged(folder):
    with (folder / FILE).open("rb+") as file:
        file.seek(47)  # the last byte of the schema format number
        file.write(b"\x09")
    with pytest.raises(DataError, match=r"damaged bytes"):
        ActionLibrary(folder)


def test_a_truncated_library_is_damaged(folder):
    stored = (folder / FILE).read_bytes()
    (folder / FILE).write_bytes(stored[: len(stored) // 2])
    with pytest.raises(DataError, match=r"damaged bytes"), ActionLibrary(folder) as library:
        contents(library)


def test_two_processes_may_make_a_library_at_the_same_time(tmp_path):
    with ThreadPoolExecutor(4) as pool:
        libraries = list(pool.map(lambda _: ActionLibrary(tmp_path / "actions", create=True), range(4)))
    assert len({library.store.id for library in libraries}) == 1
    for library in libraries:
        library.close()


def test_importing_the_front_door_does_not_open_a_database():
    code = "import sys, kineme; print('sqlite3' in sys.modules); kineme.ActionLibrary; print('sklearn' in sys.modules)"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert printed == ["False", "False"]


def _flip(path, at, mask=0xFF):
    data = bytearray(path.read_bytes())
    data[at] ^= mask
    path.write_bytes(data)


def _stored_bytes(folder, query):
    """Where the bytes of a cell are in the file."""
    with closing(_raw(folder)) as other:
        value = other.execute(query).fetchone()[0]
    where = (folder / FILE).read_bytes().find(value if isinstance(value, bytes) else value.encode())
    assert where > 0
    return where + 5


@pytest.mark.parametrize(
    ("query", "named", "read"),
    [
        ("SELECT positions FROM raw WHERE movement = 7", "the samples of movement 7", "movements"),
        ("SELECT start FROM raw WHERE movement = 7", "the samples of movement 7", "movements"),
        ("SELECT weights FROM primitive WHERE movement = 7", "the primitive of movement 7", "primitives"),
        ("SELECT boundary FROM primitive WHERE movement = 7", "the primitive of movement 7", "primitives"),
        ("SELECT rows FROM feature WHERE movement = 7", "the features of movement 7", "features"),
    ],
)
def test_flipped_bytes_are_named_and_never_read_as_numbers(folder, query, named, read):
    _flip(folder / FILE, _stored_bytes(folder, query))
    with ActionLibrary(folder, read_only=True) as library:
        (problem,) = library.verify()
        assert str(problem) == f"{named}: damaged bytes"
        assert problem.key == 7
        with pytest.raises(DataError, match=rf"expected {named} as stored, got damaged bytes; .*verify"):
            getattr(library, read)(ids=[6, 7, 8])
        assert len(getattr(library, read)(ids=[6, 8])) == 2


@pytest.mark.parametrize(
    ("query", "table", "read"),
    [
        ("SELECT name FROM movement WHERE id = 7", "movement", lambda library: library.movements()),
        ("SELECT at FROM version", "version", lambda library: library.history()),
        ("SELECT id FROM symbol WHERE key = 2", "symbol", lambda library: library.symbols()),
    ],
)
def test_flipped_text_is_noticed_too(folder, query, table, read):
    _flip(folder / FILE, _stored_bytes(folder, query) - 4, 0x01)
    with ActionLibrary(folder, read_only=True) as library:
        assert any(re.match(rf"row \d+ of table {table}: damaged bytes", str(problem)) for problem in library.verify())
        with pytest.raises(DataError, match=rf"row \d+ of table {table} as stored, got damaged bytes"):
            read(library)


def test_wherever_a_byte_is_flipped_what_is_read_is_right_or_refused(folder):
    with ActionLibrary(folder) as library:
        library.annotate("wave", "with the hand")
        expected = contents(library)
    stored = (folder / FILE).read_bytes()
    rng = np.random.default_rng(0)
    refused = harmless = 0
    for at in rng.choice(np.flatnonzero(np.frombuffer(stored, np.uint8)), 150, replace=False).tolist():
        _flip(folder / FILE, at, int(rng.integers(1, 256)))
        try:
            with ActionLibrary(folder, read_only=True) as library:
                problems = library.verify()
                try:
                    assert contents(library) == expected, f"byte {at}"
                    harmless += 1
                except DataError:
                    assert problems
                    refused += 1
        except DataError:
            refused += 1
        (folder / FILE).write_bytes(stored)
    assert refused > 100
    assert harmless + refused == 150


@pytest.mark.parametrize(
    ("table", "read", "message"),
    [
        ("movement", lambda library: library.ids(), r"12 ids of 12 movements, each once, got 11 of 11: damaged"),
        ("movement", lambda library: library.unlabeled(), r"0 ids of 12 movements, each once, got 0 of 11: damaged"),
        ("member", lambda library: library.unlabeled(), r"0 ids of 12 movements, each once, got 1 of 12: damaged"),
        ("member", lambda library: library["wave"], r"12 members of symbols, got 11: damaged"),
        ("symbol_state", lambda library: library.symbols(), r"3 symbols, got 2: damaged"),
        ("raw", lambda library: library.movements(), r"the samples of movement 2 as stored, got damaged"),
        ("primitive", lambda library: library.primitives(), r"the primitive of movement 2 as stored"),
        ("feature", lambda library: library.features(), r"the features of movement 2 as stored"),
    ],
)
def test_a_row_that_damage_hides_is_missed(folder, table, read, message):
    with closing(_raw(folder)) as other:
        other.execute(f"DELETE FROM {table} WHERE rowid = 2")
    with ActionLibrary(folder) as library, pytest.raises(DataError, match=message):
        read(library)


def test_verify_names_what_is_missing_or_refers_to_nothing(folder):
    with closing(_raw(folder)) as other:
        other.execute("DELETE FROM feature WHERE movement = 2")
        other.execute("DELETE FROM symbol WHERE key = 3")
        other.execute("UPDATE raw SET positions = zeroblob(12) WHERE movement = 5")
    with ActionLibrary(folder) as library:
        problems = {str(problem) for problem in library.verify()}
    assert problems == {
        "the features of movement 2: not there",
        "the samples of movement 5: damaged bytes",
        "the samples of movement 5: of the wrong size",
        *(f"row {k} of table member: refers to a row of table symbol that is not there" for k in (3, 6, 9, 12)),
        "row 3 of table symbol_state: refers to a row of table symbol that is not there",
    }
