"""Libraries that somebody has made to harm: refused on import, found by `verify`, and never obeyed."""

from __future__ import annotations

import lzma
import os
import shutil
import sqlite3
import time
from contextlib import closing, suppress
from pathlib import Path

import numpy as np
import pytest
from library_attacks import DEFINITIONS, ROWS, attack, copy_of, make_endless, make_victim
from library_samples import contents

from kineme import ActionLibrary
from kineme.errors import DataError, KinemeError
from kineme.library.storage import safety
from kineme.library.storage.connection import FILE, connect
from kineme.library.storage.schema import SCHEMA_VERSION
from soaking import some


@pytest.fixture(scope="module")
def victim(tmp_path_factory):
    """A good library, and its export."""
    folder = make_victim(tmp_path_factory.mktemp("victim") / "actions")
    with ActionLibrary(folder, read_only=True) as library:
        assert library.verify() == []
        library.export(folder.parent / "export")
    return folder


@pytest.fixture
def export(victim, tmp_path):
    """A copy of the export, to attack."""
    return copy_of(victim.parent / "export", tmp_path / "export")


def _opened(export, tmp_path):
    """The attacked file as a library that was never imported."""
    (tmp_path / "planted").mkdir(parents=True)
    shutil.copyfile(export, tmp_path / "planted" / FILE)
    return tmp_path / "planted"


def test_a_good_library_whose_checksums_were_computed_anew_is_a_good_library(export, victim, tmp_path):
    """Else every attack below would be refused for its checksums alone."""
    attack(export)
    with ActionLibrary.import_(export, tmp_path / "copy") as copy, ActionLibrary(victim, read_only=True) as library:
        assert contents(copy) == contents(library)


@pytest.mark.parametrize("name", ROWS)
def test_rows_that_no_library_holds_are_not_imported(export, tmp_path, name):
    statements, words = ROWS[name]
    try:
        attack(export, statements)
    except sqlite3.IntegrityError:  # the definitions alone forbid it
        assert words is None
        return
    with pytest.raises(DataError, match=rf"(?s)expected .*{export}.*({words})"):
        ActionLibrary.import_(export, tmp_path / "copy")
    assert list((tmp_path / "copy").iterdir()) == []


@pytest.mark.parametrize("name", ROWS)
def test_rows_that_no_library_holds_are_found_where_they_are_and_end_nothing_but_the_question(export, tmp_path, name):
    statements, words = ROWS[name]
    if words is None:
        return
    attack(export, statements)
    try:
        with ActionLibrary(_opened(export, tmp_path), read_only=True) as library:
            assert library.verify()
            for read in (contents, lambda it: it.recognize(it.movements()), lambda it: it.ground("wave")):
                with suppress(KinemeError):
                    read(library)
    except DataError:
        pass


@pytest.mark.parametrize("name", DEFINITIONS)
def test_definitions_that_are_not_ours_are_neither_imported_nor_opened(export, tmp_path, name):
    definitions, master = DEFINITIONS[name]
    attack(export, (), definitions, master)
    with pytest.raises(DataError, match=r"to define the tables and indexes of a library and nothing else|damaged"):
        ActionLibrary.import_(export, tmp_path / "copy")
    assert list((tmp_path / "copy").iterdir()) == []
    try:
        with ActionLibrary(_opened(export, tmp_path), read_only=True) as library:
            assert "pages" in name or "page" in name
            assert library.verify()
    except DataError:
        pass


def test_a_library_of_the_first_release_opens_imports_and_is_whole(tmp_path):
    """Its definitions are what every later version must still write, word for word."""
    released = Path(__file__).with_name("library_0.1.0.xz")
    (tmp_path / "export").write_bytes(lzma.decompress(released.read_bytes()))
    planted = _opened(tmp_path / "export", tmp_path)
    with ActionLibrary(planted) as library, ActionLibrary.import_(tmp_path / "export", tmp_path / "copy") as copy:
        assert library.verify() == copy.verify() == []
        assert contents(library) == contents(copy)
        assert [symbol.name for symbol in library.symbols()] == ["head", "naïve 'wave'; --", "tilt"]
        assert library["tilt"].threshold == 0.25
        copy.rename("tilt", "lean")
        assert copy.verify() == []


def test_a_library_of_the_first_release_is_read_as_it_is(tmp_path):
    """Whoever only reads it changes no byte, and is told of no people; whoever writes adds the table of people."""
    released = Path(__file__).with_name("library_0.1.0.xz")
    (tmp_path / "export").write_bytes(lzma.decompress(released.read_bytes()))
    planted = _opened(tmp_path / "export", tmp_path)
    before = (planted / FILE).read_bytes()
    with ActionLibrary(planted, read_only=True) as library:
        expected, first = contents(library), library.ids()[:3]
        assert library.verify() == []
        assert library.groups().tolist() == [None] * len(library)
        assert library.recognize(library.movements(ids=first))[0].label is not None
    assert (planted / FILE).read_bytes() == before
    with ActionLibrary(planted) as library:
        assert contents(library) == expected
        new = library.learn(library.movements(ids=first), groups=["anna"] * 3).ids
        assert library.groups(np.append(new, first)).tolist() == ["anna"] * 3 + [None] * 3
        assert library.verify() == []


def _is_refused(path, tmp_path, words):
    with pytest.raises(DataError, match=words):
        ActionLibrary.import_(path, tmp_path / "copy")
    assert not (tmp_path / "copy").exists() or list((tmp_path / "copy").iterdir()) == []


def test_what_is_no_file_is_not_imported(tmp_path):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for name, got in {
        "folder": "something else",
        "pipe": "something else",
        "loop": "no file",
        "zero": "something",
    }.items():
        _is_refused(tmp_path / name, tmp_path, rf"expected an exported library at .*{name}, found {got}")


def test_a_link_to_an_export_is_copied_never_moved_or_linked(export, victim, tmp_path):
    (tmp_path / "link").symlink_to(export)
    with ActionLibrary.import_(tmp_path / "link", tmp_path / "copy") as copy:
        assert not (copy.folder / FILE).is_symlink()
        copy.rename("wave", "other")
    assert export.read_bytes() == (victim.parent / "export").read_bytes()


@pytest.mark.parametrize("end", ["-wal", "-journal"])
def test_an_export_with_a_log_beside_it_is_not_imported(export, tmp_path, end):
    """With it the file would be another library."""
    Path(f"{export}{end}").write_bytes(b"x" * 512)
    _is_refused(export, tmp_path, rf"with changes beside it in export{end}; export it, and import that file")


@pytest.mark.parametrize("end", ["-wal", "-journal"])
def test_no_library_is_made_where_the_log_of_another_one_lies(export, tmp_path, end):
    """SQLite would add those changes to the new library, and call it whole."""
    left = tmp_path / "copy" / f"{FILE}{end}"
    left.parent.mkdir()
    left.write_bytes(b"x" * 512)
    for make in (
        lambda: ActionLibrary.import_(export, left.parent),
        lambda: ActionLibrary(left.parent, create=True),
    ):
        with pytest.raises(DataError, match=rf"expected no log without its library, found .*{FILE}{end} and no"):
            make()
    assert [path.name for path in left.parent.iterdir()] == [left.name]


def test_a_file_of_holes_does_not_fill_the_disk(export, tmp_path, monkeypatch):
    os.truncate(export, 1 << 43)
    monkeypatch.setattr(shutil, "copyfile", None)  # it must not come to that
    _is_refused(export, tmp_path, r"expected room for the 8,796,093,022,208 bytes of .*export in .*copy, got")


def test_texts_in_another_encoding_are_refused(export, tmp_path):
    with closing(sqlite3.connect(export)) as narrow, closing(sqlite3.connect(tmp_path / "wide")) as other:
        other.execute("PRAGMA encoding = 'UTF-16'")
        for statement in narrow.iterdump():
            other.execute(statement)
        other.execute(f"PRAGMA application_id = {narrow.execute('PRAGMA application_id').fetchone()[0]}")
        other.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        other.commit()
    _is_refused(tmp_path / "wide", tmp_path, r"libraries? and nothing else, got texts in UTF-16|got texts in UTF-16le")


ENDLESS = {
    "movement": [lambda it: it.movements(), lambda it: it.export(it.folder / "more")],
    "feature": [lambda it: it.export(it.folder / "more")],
    "member": [lambda it: it.symbols(), lambda it: it.export(it.folder / "more")],
    "version": [lambda it: it.history()],
    "symbol_state": [lambda it: it.recognize(it.movements()), lambda it: it.rename("wave", "other")],
}


@pytest.mark.parametrize("table", some(ENDLESS, 0, -1))
def test_a_library_that_was_never_imported_is_not_read_without_end(export, tmp_path, table):
    make_endless(export, table)
    start = time.monotonic()
    with ActionLibrary(_opened(export, tmp_path)) as library:
        for read in ENDLESS[table]:
            with pytest.raises(DataError, match=rf"{FILE} to be read within a time that its size|{FILE} once, got dam"):
                read(library)
        assert {path.name for path in library.folder.iterdir()} <= {FILE, f"{FILE}-wal", f"{FILE}-shm"}
    assert time.monotonic() - start < 3000


def test_pages_that_lead_to_each_other_do_not_hang(export, tmp_path, monkeypatch):
    """A tree of ten levels, in which every branch is the same one: there is no end of rows, and no loop to be seen."""
    make_endless(export)
    start = time.monotonic()
    _is_refused(export, tmp_path, r"damaged bytes")
    monkeypatch.setattr(safety, "_SECONDS", 0.2)
    with ActionLibrary(_opened(export, tmp_path), read_only=True) as library:
        assert any("interrupted" in str(problem) for problem in library.verify())
    assert time.monotonic() - start < 300


@pytest.mark.parametrize("mode", ["ro", "rw"])
def test_what_a_file_defines_is_never_trusted(victim, tmp_path, mode):
    """By SQLite's own switches too, should a definition slip past the comparison."""
    path = copy_of(victim / FILE, tmp_path / FILE)
    with closing(connect(path, mode, 1.0)) as connection:
        assert connection.execute("PRAGMA trusted_schema").fetchone() == (0,)
        assert connection.execute("PRAGMA cell_size_check").fetchone() == (1,)
        if hasattr(connection, "getconfig"):  # from Python 3.12 on
            assert not any(connection.getconfig(getattr(sqlite3, name)) for name in safety._OFF)
        safety.defend_foreign(connection, path)
        assert connection.execute("PRAGMA query_only").fetchone() == (1,)
        assert connection.getlimit(sqlite3.SQLITE_LIMIT_TRIGGER_DEPTH) == 0
        assert connection.getlimit(sqlite3.SQLITE_LIMIT_LENGTH) == max(1 << 20, path.stat().st_size)
        with pytest.raises(sqlite3.OperationalError, match="too many attached"):
            connection.execute("ATTACH ':memory:' AS other")


def _undo_all(library):
    _again_and_again(library.undo)


def _again_and_again(undo):
    while True:
        undo()


def _learn(library):
    library.learn([np.column_stack((np.linspace(0, 1, 9), np.linspace(0, 1, 9) ** 2))], ["new"])


#: Rows that are valid one by one, with right seals -> what fails on them.
MISFITS = {
    "a member that is nowhere": ("UPDATE member SET movement = 77 WHERE id = 1", _undo_all),
    "a state that ends later": (
        "UPDATE symbol_state SET removed = 77 WHERE id = (SELECT min(id) FROM symbol_state)", _undo_all,
    ),
    "a number after which there is none": (
        f"UPDATE member SET id = {2**63 - 1} WHERE id = (SELECT max(id) FROM member)", _learn,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", MISFITS)
def test_rows_that_do_not_fit_together_are_the_fault_of_the_file(export, tmp_path, name):
    statement, act = MISFITS[name]
    attack(export, [statement])
    with ActionLibrary(_opened(export, tmp_path)) as library:
        with pytest.raises(DataError, match=r"to fit together, got .*; take it from a backup"):
            act(library)
        assert library.verify()


def test_an_error_of_the_program_around_a_hostile_library_stays_its_own(export, tmp_path):
    attack(export, [MISFITS["a member that is nowhere"][0]])
    with pytest.raises(KeyError, match="mine"), ActionLibrary(_opened(export, tmp_path)):
        raise KeyError("mine")
    with pytest.raises(TypeError, match="argument"), ActionLibrary(_opened(export, tmp_path / "again")) as library:
        library.undo(wrong=1)


def test_an_error_of_a_function_over_the_store_is_that_of_the_file_too(export, tmp_path):
    from kineme.library.storage.undo import undo

    attack(export, [MISFITS["a state that ends later"][0]])
    library = ActionLibrary(_opened(export, tmp_path))
    with pytest.raises(sqlite3.IntegrityError) as raised:
        _again_and_again(lambda: undo(library.store))
    with pytest.raises(DataError, match="to fit together, got"):
        library.__exit__(type(raised.value), raised.value, None)
