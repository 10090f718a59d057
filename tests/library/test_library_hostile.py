"""Libraries that somebody has made to harm: refused on import, found by `verify`, and never obeyed."""

from __future__ import annotations

import shutil
import sqlite3
from contextlib import closing

import pytest
from library_attacks import DEFINITIONS, ROWS, attack, copy_of, make_victim
from library_samples import contents

from kineme import ActionLibrary, DataError, KinemeError
from kineme.library.connection import FILE


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
    (tmp_path / "planted").mkdir()
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
                try:
                    read(library)
                except KinemeError:
                    pass
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
