"""A library as one file, and back, bit for bit."""

from __future__ import annotations

import os
import re
import shutil
import time

import pytest
from library_samples import contents, draw_movements, tables

from kineme import ActionLibrary
from kineme.errors import DataError
from kineme.library.storage.connection import FILE


@pytest.fixture(scope="module")
def eventful(tmp_path_factory):
    """A library with a past: every table has rows, some of them removed."""
    folder = tmp_path_factory.mktemp("origin") / "actions"
    with ActionLibrary(folder, create=True) as library:
        library.learn(draw_movements(12, ragged=True, labels=["wave", "nod", "bow"] * 4))
        library.rename("wave", "naïve 'wave'; --")
        library.merge(["nod", "bow"], "head")
        library.split("head", library["head"].members[:2], "tilt")
        library.annotate("tilt", "to the side", prototype=int(library["tilt"].members[0]), threshold=0.25)
        library.delete([4, 5])
    return folder


def test_every_row_of_every_table_comes_back(eventful, tmp_path):
    with ActionLibrary(eventful) as library:
        assert library.export(tmp_path / "one.kineme") == tmp_path / "one.kineme"
        expected = contents(library)
        with ActionLibrary.import_(tmp_path / "one.kineme", tmp_path / "copy") as copy:
            assert contents(copy) == expected
            assert tables(tmp_path / "copy") == tables(eventful)
            assert copy.verify() == []
            for version in range(library.version + 1):
                with library.at(version) as then, copy.at(version) as copied:
                    assert contents(copied) == contents(then)


def test_an_export_of_an_import_is_the_same_file(eventful, tmp_path):
    with ActionLibrary(eventful, read_only=True) as library:
        library.export(tmp_path / "one")
    with ActionLibrary.import_(tmp_path / "one", tmp_path / "copy") as copy:
        copy.export(tmp_path / "two")
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["copy", "one", "two"]


def test_an_imported_library_is_a_library_like_any_other(eventful, tmp_path):
    with ActionLibrary(eventful) as library:
        library.export(tmp_path / "one")
    with ActionLibrary.import_(tmp_path / "one", tmp_path / "copy", wait=0.5) as copy:
        assert copy.learn(draw_movements(12, ragged=True)).duplicates == 10  # two were deleted
        copy.rename("tilt", "lean")
    with ActionLibrary(eventful) as library:
        assert "tilt" in library
        assert "lean" not in library


def test_an_export_holds_what_was_committed_when_it_began(eventful, tmp_path):
    shutil.copytree(eventful, tmp_path / "actions")
    with ActionLibrary(tmp_path / "actions") as library, library.store.writing("note") as change:
        change.connection.execute("DELETE FROM member")
        library.export(tmp_path / "one")
        change.connection.rollback()
        change.connection.execute("BEGIN")
    with ActionLibrary.import_(tmp_path / "one", tmp_path / "copy") as copy:
        assert len(copy["head"]) == 5


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda data: data[: len(data) // 2], r"damaged bytes"),
        (
            lambda data: data.replace(b"to the side", b"to the left"),
            r"\(2 problems, the first: row 5 of table version: damaged bytes\); nothing was imported: export it again",
        ),
        (
            lambda data: b"not a database" * 100,
            r"to be a library, got a file that is no database .*; correct the path, or take it from a backup",
        ),
        (lambda data: b"", r"got an empty file; correct the path, or take it from a backup"),
    ],
)
def test_a_spoiled_export_is_not_imported(eventful, tmp_path, spoil, message):
    with ActionLibrary(eventful) as library:
        library.export(tmp_path / "one")
    (tmp_path / "two").write_bytes(spoil((tmp_path / "one").read_bytes()))
    with pytest.raises(DataError, match=message):
        ActionLibrary.import_(tmp_path / "two", tmp_path / "copy")
    assert list((tmp_path / "copy").iterdir()) == []


def test_a_library_in_use_is_not_taken_for_an_export(tmp_path):
    """Its newest changes lie in the log beside it."""
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(3))
        with pytest.raises(
            DataError, match=r"got .*library.sqlite with changes beside it in library.sqlite-wal; export"
        ):
            ActionLibrary.import_(tmp_path / "actions" / FILE, tmp_path / "copy")
    with ActionLibrary.import_(tmp_path / "actions" / FILE, tmp_path / "copy") as copy:  # closed, it is whole
        assert len(copy) == 3


def test_a_linked_library_is_read_with_the_log_beside_its_file(tmp_path, monkeypatch):
    """Where the folder is read-only, a file without a log is taken for one that does not change."""
    (tmp_path / "link").mkdir()
    (tmp_path / "link" / FILE).symlink_to(tmp_path / "actions" / FILE)
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(3))
        monkeypatch.setattr(os, "access", lambda *_, **__: False)
        with ActionLibrary(tmp_path / "link", read_only=True) as linked:
            library.learn(draw_movements(6))
            assert len(linked) == len(library) == 6
        with pytest.raises(DataError, match=f"with changes beside it in {FILE}-wal; export it"):
            ActionLibrary.import_(tmp_path / "link" / FILE, tmp_path / "copy")


def test_a_copy_of_the_file_alone_holds_what_an_open_library_has_committed(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(3))
        library.delete([1])
        (tmp_path / "backup").mkdir()
        (tmp_path / "backup" / FILE).write_bytes((tmp_path / "actions" / FILE).read_bytes())
        with ActionLibrary(tmp_path / "backup") as backup:
            assert contents(backup) == contents(library)


def test_what_a_killed_export_left_is_deleted_by_one_of_another_day(eventful, tmp_path):
    with ActionLibrary(eventful) as library:
        library.export(tmp_path / "one")
        exported, long_ago = (tmp_path / "one").read_bytes(), time.time() - 2 * 86400
        old = [".one.1.0123abcd", ".other.kinemelib.1.89abcdef", ".one.1.0123abcd-journal"]
        others = [".one.1.aaaaaaaa", ".mine.1.0123abcd", ".library.1.0123abcdef", "one.1.0123abcd", ".one.0123abcd"]
        for name in old + others:
            (tmp_path / name).write_bytes(b"mine" if name == ".mine.1.0123abcd" else exported)
            if name != ".one.1.aaaaaaaa":  # one that another process writes now
                os.utime(tmp_path / name, (long_ago, long_ago))
        library.export(tmp_path / "two")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*others, "one", "two"])


def test_nothing_is_overwritten(eventful, tmp_path):
    (tmp_path / "taken").write_text("mine")
    with ActionLibrary(eventful) as library:
        with pytest.raises(DataError, match=rf"expected a new file, but {re.escape(str(tmp_path))}/taken is there"):
            library.export(tmp_path / "taken")
        with pytest.raises(DataError, match=r"expected a folder .*nowhere to write one into, there is none; create it"):
            library.export(tmp_path / "nowhere" / "one")
        library.export(tmp_path / "one")
    before = (eventful / FILE).read_bytes()
    with pytest.raises(DataError, match=rf"expected a new file, but .*{FILE} is there already; choose another"):
        ActionLibrary.import_(tmp_path / "one", eventful)
    with pytest.raises(DataError, match=r"expected an exported library at .*three, found no file there"):
        ActionLibrary.import_(tmp_path / "three", tmp_path / "copy")
    assert (eventful / FILE).read_bytes() == before
    assert (tmp_path / "taken").read_text() == "mine"
