"""A library on a PostgreSQL server: moved there and back, many writers, and whatever becomes of the connection."""

from __future__ import annotations

import json
import multiprocessing
import re
import signal
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from library_samples import contents, draw_movements, tables

from bench.postgres_server import PASSWORD
from kineme import ActionLibrary
from kineme.cli.main import main
from kineme.errors import DataError, SpecificationError, TrajectoryError
from kineme.library import calibration_cache
from kineme.library import learn as learning
from kineme.library.library import is_library
from kineme.library.recognize import LibraryRecognizer
from kineme.library.storage.address import Address, as_location
from kineme.library.storage.connection import BusyError, ConflictError
from kineme.library.storage.postgres import ServerConnection, translated
from kineme.library.storage.rows import insert
from kineme.library.storage.schema import SCHEMA_VERSION
from kineme.library.storage.store import repeated
from kineme.library.storage.symbols import make
from kineme.studio.page.write_page import write_page
from kineme.studio.server.app import create_app
from soaking import slow


@contextmanager
def _asking(address):
    """A connection of its own, past the library."""
    with closing(ServerConnection(as_location(address), 10.0)) as connection:
        yield connection


def _terminate_others(address):
    with _asking(address) as connection:
        connection.run("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid != pg_backend_pid()"
                       " AND backend_type = 'client backend'")  # fmt: skip


@pytest.fixture
def library(address):
    with ActionLibrary(address, create=True, wait=3.0) as library:
        library.learn(draw_movements(6, labels=["wave", "nod"] * 3))
        yield library


@pytest.fixture(scope="module")
def eventful(tmp_path_factory):
    """A folder whose library has rows in every table, and its export."""
    folder = tmp_path_factory.mktemp("origin")
    with ActionLibrary(folder / "actions", create=True) as library:
        library.learn(draw_movements(60, ragged=True, labels=["wave", "nod", "bow"] * 20), groups=["Ann", None] * 30)
        library.rename("wave", "naïve 'wave'; --")
        library.merge(["nod", "bow"], "head")
        library.split("head", library["head"].members[:20], "tilt")
        library.annotate("tilt", "to the side", prototype=int(library["tilt"].members[0]), threshold=0.25)
        library.delete([4, 5])
        library.export(folder / "one.kineme")
    return folder


def test_a_library_moves_to_a_server_and_back_with_every_row(eventful, address, tmp_path):
    with (
        ActionLibrary(eventful / "actions") as origin,
        ActionLibrary.import_(eventful / "one.kineme", address) as there,
    ):
        assert contents(there) == contents(origin)
        assert there.verify() == []
        assert there.export(tmp_path / "two.kineme").is_file()
        for version in range(origin.version + 1):
            with origin.at(version) as then, there.at(version) as copied:
                assert contents(copied) == contents(then)
    with ActionLibrary.import_(tmp_path / "two.kineme", tmp_path / "back") as back:
        assert back.verify() == []
        assert tables(tmp_path / "back") == tables(eventful / "actions")
    with pytest.raises(DataError, match=r"expected a new library, but postgresql://.* is there already"):
        ActionLibrary.import_(eventful / "one.kineme", address)


def test_an_export_of_a_server_is_the_same_file_as_that_of_its_import(library, tmp_path):
    library.assign([4, 2], "wave")  # members in another order than by their ids
    library.export(tmp_path / "one")
    with ActionLibrary.import_(tmp_path / "one", tmp_path / "copy") as copy:
        copy.export(tmp_path / "two")
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_a_library_answers_alike_in_both_places_and_keeps_its_caches_to_its_user(
    eventful, address, tmp_path, monkeypatch
):
    monkeypatch.setattr(calibration_cache, "_FEW", 1)
    questions = list(draw_movements(5, seed=3))
    with (
        ActionLibrary(eventful / "actions") as origin,
        ActionLibrary.import_(eventful / "one.kineme", address) as there,
    ):
        for exhaustive in (2500, 1):
            answers = [LibraryRecognizer(where.store, exhaustive).recognize(questions) for where in (origin, there)]
            for ours, theirs in zip(*answers, strict=True):
                assert (ours.label, dict(ours.p_values)) == (theirs.label, pytest.approx(dict(theirs.p_values)))
                assert ours.confidence == pytest.approx(theirs.confidence, abs=1e-5)
        caches = sorted((tmp_path / "cache").rglob("*.cache"))
        assert [path.name for path in caches] == sorted(
            ["calibration.cache", "calibration_of_all.cache", "reduced_features.cache"]
        )
        folder = caches[0].parent
        assert folder.stat().st_mode & 0o777 == 0o700
        assert there.store.cache_path("x") == folder / "x"
        folder.parent.chmod(0o777)  # anybody might put another folder there
        assert there.store.cache_path("x") is None
        assert LibraryRecognizer(there.store, 1).recognize(questions)[0].label == answers[0][0].label


def test_eight_writers_at_once_lose_and_duplicate_nothing(address):
    """Each learns movements of its own, and some that two learn; one also names movements meanwhile."""
    demos = draw_movements(8 * 30, labels=[f"kind {k % 5}" for k in range(8 * 30)], n_samples=12)
    ids = {}

    def write(k):
        with ActionLibrary(address, create=True, wait=60.0) as library:
            for first in range(30 * k, 30 * k + 30, 10):
                rows = [*range(first, first + 10), (first + 30) % len(demos)]  # the last one is another's, too
                ids.update(zip(rows, library.learn(demos[rows]).ids.tolist(), strict=True))
                if k == 3:
                    library.assign(library.ids()[:1], f"changed {first}")

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(write, range(8)))
    with ActionLibrary(address) as library:
        assert library.verify() == []
        assert library.ids().tolist() == list(range(1, len(demos) + 1))
        assert [version.id for version in library.history()] == list(range(1, library.version + 1))
        assert sum(version.detail.get("added", 0) for version in library.history()) == len(demos)
        for row, movement in zip(ids, library.movements(ids=list(ids.values())), strict=True):
            np.testing.assert_allclose(movement.positions, demos[row].positions, atol=1e-5)
        assert library.learn(demos).duplicates == len(demos)


def test_writers_overlap_and_one_that_fails_stops_no_other(library):
    """The first has reserved its keys and not written yet; a second writes meanwhile, and waits for its turn."""
    begun, go = threading.Event(), threading.Event()
    counts = {"version": 1, "movement": 2, "source": 0, "member": 0, "symbol": 0, "symbol_state": 0}

    def fail():
        with ActionLibrary(library.folder) as first, first.store.writing("learn", reserve=counts) as change:
            assert (change.version, change.next_key("movement")) == (2, 7)
            begun.set()
            assert go.wait(20)
            raise ZeroDivisionError

    def learn():
        with ActionLibrary(library.folder, wait=20.0) as second, _noted(second) as reserved:
            return second.learn(draw_movements(3, seed=8)), reserved

    with ThreadPoolExecutor(2) as pool:
        failing = pool.submit(fail)
        assert begun.wait(20)
        learning = pool.submit(learn)
        _until_locks_are_waited_for(library.folder, "advisory")
        assert library.version == 1
        go.set()
        with pytest.raises(ZeroDivisionError):
            failing.result()
        report, reserved = learning.result()
    assert [first["movement"] for first in reserved] == [9, 7]  # behind those of the first; and again, in their place
    assert report.ids.tolist() == [7, 8, 9]
    assert report.version == 2
    assert library.verify() == []


@contextmanager
def _noted(library):
    """The first keys that each transaction of a library reserves."""
    reserved, transaction = [], library.store._transaction

    @contextmanager
    def noted(*arguments):
        with transaction(*arguments) as first:
            reserved.append(first)
            yield first

    library.store._transaction = noted
    yield reserved


def _until_locks_are_waited_for(address, kind):
    with _asking(address) as connection:
        waiting = f"SELECT count(*) FROM pg_locks WHERE locktype = '{kind}' AND NOT granted"
        while not connection.run(waiting).fetchone()[0]:
            pass


@pytest.mark.parametrize(("held", "stored", "first"), [
    ({"movement": 20}, [], [7]),
    ({"version": 2, "movement": 20}, [], [21, 7]),
    ({"version": 2, "movement": 20}, [(2, "2026-01-01T00:00:00.000", "note", "{}", 6, 6, 2)], [21, 7]),
])  # fmt: skip
def test_locks_of_a_writer_that_stores_less_leave_no_gap(library, monkeypatch, held, stored, first):
    """Those of one that is about to end do not count; behind one that is under way, keys are reserved anew."""
    waited = ServerConnection.wait_for_turn
    with _asking(library.folder) as other, _noted(library) as reserved:
        other.begin()
        for table, end in held.items():
            other.run("SELECT pg_advisory_xact_lock(%s, %s)", [other._places[table], end])

        def released(self, keys):
            if other._inside:
                insert(other, "version", stored)
                other.run("COMMIT")
                other._inside = False
            waited(self, keys)

        monkeypatch.setattr(ServerConnection, "wait_for_turn", released)
        assert library.learn(draw_movements(2, seed=3)).ids.tolist() == [7, 8]
    assert [keys["movement"] for keys in reserved] == first
    assert library.verify() == []


def test_writers_of_the_same_new_symbol_learn_beside_each_other(address):
    """The second waits for the first, which makes the symbol, and then writes beside a third that is under way."""
    demos = draw_movements(9, labels=["new"] * 9)
    ActionLibrary(address, create=True).close()
    begun, go = threading.Event(), threading.Event()

    def hold(library):
        insert = library.store.writing

        @contextmanager
        def held(*arguments, **options):
            with insert(*arguments, **options) as change:
                yield change
                if not begun.is_set():
                    begun.set()
                    assert go.wait(20)

        library.store.writing = held

    def learn(k):
        with ActionLibrary(address, wait=20.0) as library, _noted(library) as reserved:
            if k == 0:
                hold(library)
            library.learn(demos[3 * k : 3 * k + 3])
            return reserved

    with ThreadPoolExecutor(3) as pool:
        writing = [pool.submit(learn, 0)]
        assert begun.wait(20)
        writing += [pool.submit(learn, k) for k in (1, 2)]
        _until_locks_are_waited_for(address, "transactionid")
        go.set()
        reserved = [future.result() for future in writing]
    assert all(first for firsts in reserved for first in firsts)  # nobody had to write alone
    with ActionLibrary(address) as library:
        assert len(library["new"]) == 9
        assert library.verify() == []


def test_a_name_that_another_writer_gave_meanwhile_is_a_conflict_which_is_tried_again(library):
    with pytest.raises(ConflictError, match=r"got in the way of another process"), library.store.writing("x") as change:
        make(change, "wave")  # as if it had not been there when it was looked for


def test_movements_of_other_dimensions_are_refused_also_if_they_come_at_the_same_time(place, monkeypatch):
    commit = learning.commit.commit
    with ActionLibrary(place, create=True) as library:

        def after_another(*arguments):
            monkeypatch.undo()
            with ActionLibrary(library.folder) as other:
                other.learn(draw_movements(2, d=3))
            return commit(*arguments)

        monkeypatch.setattr(learning.commit, "commit", after_another)
        with pytest.raises(TrajectoryError, match="expected movements of 3 dimensions, as another process"):
            library.learn(draw_movements(2))
        assert library.verify() == []


def test_who_waits_too_long_for_a_turn_is_told_so(library):
    with ActionLibrary(library.folder, wait=0.2) as other, library.store.writing("note"):
        with pytest.raises(BusyError, match=r"got no turn: another process has been writing for more than 0\.2 s"):
            other.learn(draw_movements(2, seed=4))
        with pytest.raises(BusyError, match="got no turn"):
            other.rename("wave", "hello")
    with _asking(library.folder) as other, ActionLibrary(library.folder, wait=0.2) as second:
        other.run("SELECT pg_advisory_lock_shared(%s, %s)", [other._places["version"], library.version + 1])
        with pytest.raises(BusyError, match="got no turn"):
            second.learn(draw_movements(2, seed=4))
        other.run("SELECT pg_advisory_unlock_all()")
        library.rename("wave", "hello")  # no lock is left


def test_a_change_that_others_get_in_the_way_of_is_made_again():
    tries = []

    @repeated
    def change(store):
        tries.append(store)
        if len(tries) < 3:
            raise ConflictError("deadlock")
        return len(tries)

    assert change("x") == 3
    with pytest.raises(ConflictError):
        repeated(lambda: (_ for _ in ()).throw(ConflictError("deadlock")))()


def test_a_deadlock_with_another_program_is_tried_again(library):
    """Another program locks a table and then wants to write as well: the server ends one of both."""
    with _asking(library.folder) as other, ThreadPoolExecutor(1) as pool:
        other.run("SET deadlock_timeout = '20s'")  # so that it is ours that is ended
        other.begin()
        other.run("LOCK TABLE symbol_state IN EXCLUSIVE MODE")
        renaming = pool.submit(library.rename, "wave", "hello")
        _until_locks_are_waited_for(library.folder, "relation")
        other.run("SELECT pg_advisory_xact_lock(%s)", [other._lock])
        other.run("COMMIT")
        renaming.result(20)
    assert "hello" in library


def _cut_before_commit(monkeypatch, cut):
    run, left = ServerConnection.run, [cut]

    def cut_first(self, query, parameters=None):
        if query == "COMMIT" and left:
            left.pop()()
        return run(self, query, parameters)

    monkeypatch.setattr(ServerConnection, "run", cut_first)


def test_a_connection_that_is_cut_before_a_commit_leaves_nothing(library, monkeypatch):
    _cut_before_commit(monkeypatch, lambda: _terminate_others(library.folder))
    with pytest.raises(DataError, match=r"got it cut .* nothing of this step was stored"):
        library.learn(draw_movements(4, seed=9))
    assert (len(library), library.version) == (6, 1)
    assert library.learn(draw_movements(4, seed=9)).added == 4
    assert library.verify() == []


@pytest.mark.parametrize("how", [signal.SIGINT, slow(signal.SIGQUIT)])
def test_a_server_that_stops_and_starts_in_mid_commit_leaves_nothing(library, server, monkeypatch, how):
    def restart():
        server.stop(how)
        server.start()

    _cut_before_commit(monkeypatch, restart)
    with pytest.raises(DataError, match=r"got it cut .* nothing of this step was stored"):
        library.rename("wave", "hello")
    assert library.version == 1
    library.rename("wave", "hello")
    assert library.verify() == []


def test_a_commit_that_was_done_when_the_connection_was_cut_counts(library, monkeypatch):
    run = ServerConnection.run

    def cut_after(self, query, parameters=None):
        cursor = run(self, query, parameters)
        if query == "COMMIT":
            monkeypatch.undo()
            self._session.close()
            raise DataError("expected the connection to last, got it cut")
        return cursor

    monkeypatch.setattr(ServerConnection, "run", cut_after)
    library.rename("wave", "hello")
    assert library.version == 2
    assert library.learn(draw_movements(2, seed=5)).added == 2


def test_a_server_that_does_not_come_back_leaves_the_outcome_open(library, server, monkeypatch):
    monkeypatch.setattr("kineme.library.storage.postgres._PATIENCE", 0.3)
    library.store._writer.wait = 0.3
    _cut_before_commit(monkeypatch, lambda: server.stop(signal.SIGQUIT))
    try:
        with pytest.raises(DataError, match=r"stored as a whole or not at all: look at kineme library history"):
            library.rename("wave", "hello")
    finally:
        server.start()
    assert library.version == 1


def test_a_connection_that_was_cut_while_idle_is_opened_again(library):
    library.learn(draw_movements(2, seed=5))
    _terminate_others(library.folder)
    assert len(library) == 8
    _terminate_others(library.folder)
    assert library.learn(draw_movements(2, seed=6)).added == 2


def test_no_message_shows_a_password(server, address, tmp_path, monkeypatch):
    """By the network a password is asked for: in the address, in PGPASSWORD, or in a file."""
    schema = as_location(address).schema.replace(" ", "%20")
    ActionLibrary(address, create=True).close()
    wrong = server.network_address("wr%6Fng word".replace(" ", "%20"), schema)
    with pytest.raises(DataError, match="password authentication failed") as caught:
        ActionLibrary(wrong)
    texts = [str(caught.value), repr(as_location(wrong)), str(as_location(wrong)), f"{caught.value.__cause__}"]
    for text in texts:
        assert not re.search("wr%6Fng|wrong|word%20|wrong word", text)
    assert f"kineme:***@127.0.0.1:{server.port}" in str(caught.value)
    other = as_location(f"postgresql://h/d?password=sec%20ret&sslpassword=two&sslmode=require&schema={schema}")
    assert str(other) == f"postgresql://h/d?password=***&sslpassword=***&sslmode=require&schema={schema}"
    assert other.without_secrets("sec ret, sec%20ret") == "***, ***"
    with ActionLibrary(server.network_address(PASSWORD.replace(" ", "%20"), schema)) as library:
        assert PASSWORD not in repr(library)
        library.learn(draw_movements(2))
        assert "***" not in json.dumps([version.detail for version in library.history()])
    monkeypatch.setenv("PGPASSWORD", PASSWORD)
    ActionLibrary(server.network_address(schema=schema)).close()
    monkeypatch.delenv("PGPASSWORD")
    (tmp_path / "passwords").write_text(f"127.0.0.1:*:*:kineme:{PASSWORD}\n")
    (tmp_path / "passwords").chmod(0o600)
    monkeypatch.setenv("PGPASSFILE", str(tmp_path / "passwords"))
    ActionLibrary(server.network_address(schema=schema)).close()


@pytest.mark.parametrize("name", ["a \"b'; DROP TABLE x", "é%", "kineme", "x" * 63])
def test_a_schema_has_any_name(server, name):
    address = Address(server.address("x").replace("&schema=x", ""), name, "shown")
    with ActionLibrary(address, create=True) as library:
        library.learn(draw_movements(2))
    with ActionLibrary(address) as library:
        assert len(library) == 2


@pytest.mark.parametrize("query", ["schema=a&schema=b", "schema=", "schema=pg_x", f"schema={'x' * 64}", "schema=a%00"])
def test_a_name_that_no_schema_can_have_is_refused(query):
    with pytest.raises(SpecificationError, match="expected one schema"):
        as_location(f"postgresql://host/database?{query}")


def test_an_address_that_became_a_path_is_refused():
    with pytest.raises(SpecificationError, match="paths drop a slash"):
        ActionLibrary(Path("postgresql://host/database"), create=True)


def test_what_is_not_there_is_told(server, address):
    with pytest.raises(DataError, match=r"expected a library in postgresql://.*, found none there; make one by"):
        ActionLibrary(address)
    with pytest.raises(DataError, match=r'expected a connection to .*, got none \(.*database "nothing" does not exist'):
        ActionLibrary(address.replace("/postgres?", "/nothing?"))
    with pytest.raises(DataError, match=r"expected a connection to .*, got none"):
        ActionLibrary("postgresql://127.0.0.1:9/x?connect_timeout=2")


def test_without_its_package_a_server_is_refused_with_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(DataError, match=r"pip install 'kineme\[postgres\]'"):
        ActionLibrary("postgresql://host/database")


def test_tables_of_others_are_left_alone(address):
    with _asking(address) as connection:
        connection.run(f"CREATE SCHEMA {connection.quoted_schema}")
        connection.run("CREATE TABLE theirs (a int)")
    with pytest.raises(DataError, match=r"expected an empty schema, or none.*holds 'theirs'; choose another"):
        ActionLibrary(address, create=True)


def test_a_later_schema_is_refused_and_an_earlier_one_brought_up_to_date(address, monkeypatch):
    with monkeypatch.context() as earlier:
        for module in ("postgres_store", "store"):
            earlier.setattr(f"kineme.library.storage.{module}.SCHEMA_VERSION", 1)
        with ActionLibrary(address, create=True) as library:
            library.learn(draw_movements(3, labels=["a", "b", "a"]))
    with ActionLibrary(address, read_only=True) as library:
        assert library.store._reader.schema_version == 1
        assert library.groups().tolist() == [None] * 3
        assert library.verify() == []
    with ActionLibrary(address) as library:
        library.learn(draw_movements(3), groups=["Ann", "Ben", None])
        assert library.groups().tolist() == ["Ann", "Ben", None]
        assert library.verify() == []
        assert library.store._reader.schema_version == SCHEMA_VERSION
    with _asking(address) as connection:
        connection.set_schema_version(SCHEMA_VERSION + 1)
    with pytest.raises(DataError, match=rf"or earlier, got {SCHEMA_VERSION + 1}; upgrade kineme"):
        ActionLibrary(address)


@pytest.mark.parametrize("change", [
    "ALTER TABLE movement ADD COLUMN more bigint", "DROP TABLE feature", "DROP INDEX movement_digest",
    "ALTER TABLE movement ALTER COLUMN t0 TYPE real",
])  # fmt: skip
def test_other_definitions_are_refused(library, change):
    with _asking(library.folder) as connection:
        connection.run(change)
    with pytest.raises(DataError, match=r"expected .* to define the tables and indexes of a library"):
        ActionLibrary(library.folder)


def test_a_library_that_is_replaced_meanwhile_is_not_written_to(library, eventful):
    with _asking(library.folder) as connection:
        connection.run(f"DROP SCHEMA {connection.quoted_schema} CASCADE")
    with pytest.raises(DataError, match="to hold the tables of a library, got others"):
        len(library)
    ActionLibrary.import_(eventful / "one.kineme", library.folder).close()
    with pytest.raises(DataError, match="as it was opened, but it was replaced"):
        library.rename("wave", "hello")


@pytest.mark.parametrize(("damage", "words"), [
    ("UPDATE feature SET rows = rows || '\\x00'::bytea WHERE movement = 2", "the features of movement 2: damaged"),
    ("UPDATE symbol_state SET name = 'nix' WHERE name = 'nod'", "row 2 of table symbol_state: damaged bytes"),
    ("DELETE FROM raw WHERE movement = 3", "the samples of movement 3: not there"),
    ("DELETE FROM movement WHERE id = 3", "refers to a row of table movement that is not there"),
    ("UPDATE member SET symbol = 99 WHERE id = 1", "row 1 of table member: damaged bytes"),
])  # fmt: skip
def test_damage_is_found(library, damage, words):
    with _asking(library.folder) as connection:
        connection.run(damage)
    assert words in "\n".join(map(str, library.verify()))


def test_text_that_a_server_cannot_store_is_refused_and_looked_for_in_vain(library):
    demos = draw_movements(1, seed=7)
    named = type(demos).from_arrays([demos.positions], names=["a\0b"])
    with pytest.raises(DataError, match="expected values that a PostgreSQL server can store"):
        library.learn(named)
    assert "a\0b" not in library
    assert library.verify() == []


def test_a_user_who_may_only_read_reads(library, server):
    with _asking(library.folder) as connection:
        schema = connection.quoted_schema
        connection.run("DROP ROLE IF EXISTS reader")
        connection.run("CREATE ROLE reader LOGIN")
        connection.run(f"GRANT USAGE ON SCHEMA {schema} TO reader")
        connection.run(f"GRANT SELECT ON ALL TABLES IN SCHEMA {schema} TO reader")
    theirs = Address(library.folder.uri.replace("kineme@", "reader@"), library.folder.schema, "theirs")
    with ActionLibrary(theirs, read_only=True) as reading:
        assert contents(reading) == contents(library)
        with pytest.raises(DataError, match="open for reading only"):
            reading.rename("wave", "hello")
    with ActionLibrary(theirs) as writing, pytest.raises(DataError, match="expected permission to read or write"):
        writing.rename("wave", "hello")
    with pytest.raises(DataError, match="expected permission to read or write"):
        ActionLibrary(Address(theirs.uri, "new", "theirs"), create=True)


def _read_in_child(library, queue):
    queue.put(len(library))


def test_a_forked_child_opens_its_own_connection(library):
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    child = context.Process(target=_read_in_child, args=(library, queue))
    child.start()
    assert queue.get() == 6
    child.join()
    assert len(library) == 6
    assert library.learn(draw_movements(2, seed=3)).added == 2


def test_commands_take_an_address(address, tmp_path, monkeypatch):
    secret = address.replace("kineme@", "kineme:secret@")
    (tmp_path / "shown" / "wave").mkdir(parents=True)
    for k, movement in enumerate(draw_movements(4)):
        columns = np.column_stack((np.linspace(0, 1, len(movement)), movement.positions))
        np.savetxt(tmp_path / "shown" / "wave" / f"{k}.csv", columns, delimiter=",", header="t,x,y", comments="")

    def run(*arguments):
        result = CliRunner().invoke(main, [*map(str, arguments), "--library", secret], catch_exceptions=False)
        assert result.exit_code == 0, result.output
        assert "secret" not in result.output
        return result.output

    learned = json.loads(run("learn", tmp_path / "shown", "--json"))
    assert learned["library"] == str(as_location(secret))
    assert "4 movements, 1 symbol" in run("library", "list")
    run("library", "rename", "wave", "hello")
    assert "nothing wrong" in run("library", "verify")
    run("library", "export", tmp_path / "one.kineme")
    monkeypatch.setenv("KINEME_LIBRARY", secret + "2")
    result = CliRunner().invoke(main, ["library", "import", str(tmp_path / "one.kineme")], catch_exceptions=False)
    assert result.exit_code == 0
    assert "secret" not in result.output
    with ActionLibrary(secret) as library, ActionLibrary(secret + "2") as copy:
        assert contents(copy) == contents(library)


def test_a_studio_shows_a_library_on_a_server(address, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # as in the tests of the studio
        from fastapi.testclient import TestClient
    secret = address.replace("kineme@", "kineme:secret@")
    assert not is_library(secret)
    app = create_app(secret, "t" * 32)
    with TestClient(app, "http://127.0.0.1:8420", headers={"Authorization": f"Bearer {'t' * 32}"}) as client:
        with ActionLibrary(secret) as library:
            library.learn(draw_movements(4, labels=["wave", "nod"] * 2))
            page = write_page(tmp_path / "page.html", library)
        text = client.get("/api/library").text
    assert json.loads(text)["n_movements"] == page.header["n_movements"] == 4
    assert "secret" not in text
    assert f"<title>{as_location(address).name}" in (tmp_path / "page.html").read_text()
    assert is_library(secret)


def test_statements_are_translated():
    assert translated("SELECT a FROM t WHERE a = ? AND b IN (SELECT value FROM json_each(:keys)) AND c = :c::int") == (
        "SELECT a FROM t WHERE a = %s AND b = ANY(%(keys)s) AND c = %(c)s::int"
    )
    assert translated("typeof(a) = 'text' AND a GLOB 'x-[0-9]' AND b GLOB '[0-9]*' AND c IS ? AND d LIKE '%'") == (
        "a IS NOT NULL AND a ~ '^x-[0-9]$' AND b ~ '^[0-9]' AND c IS NOT DISTINCT FROM %s AND d LIKE '%%'"
    )
