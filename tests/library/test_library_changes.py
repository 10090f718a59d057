"""Symbols change, ids stay, and every version can be seen again."""

from __future__ import annotations

from unicodedata import normalize

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from library_samples import contents, draw_movements

import kineme
from kineme import ActionLibrary
from kineme.errors import SpecificationError
from kineme.library.annotate import check_symbols
from kineme.library.storage import changes, symbols

N = 12
NAMES = ["wave", "nod", "a'b; DROP TABLE movement", "../etc/passwd", "é", "é", "a\n\tb", "$(reboot)", "%s", "名"]


@pytest.fixture
def library(place):
    with ActionLibrary(place, create=True) as actions:
        actions.learn(draw_movements(N, labels=["wave", "nod", "bow"] * 4))
        yield actions


class Model:
    """What a library should say, kept in two dictionaries."""

    def __init__(self):
        self.names = {}  # key -> name
        self.shows = dict.fromkeys(range(1, N + 1))  # movement -> key

    def key(self, name):
        return next((key for key, other in self.names.items() if other == name), None)

    def apply(self, action, a, b, ids):
        """Change the model as the library should; True if that is possible."""
        source, target = self.key(a), self.key(b)
        ids = [i for i in ids if i in self.shows]
        if action == "assign" and ids:
            self._show(ids, target if target is not None else self._make(b))
        elif action == "release" and ids:
            self._show(ids, None)
        elif action == "delete movements" and ids:
            for i in ids:
                del self.shows[i]
        elif action == "delete" and source is not None:
            self._show(self.members(source), None)
            del self.names[source]
        elif action == "rename" and source is not None and target is None:
            self.names[source] = b
        elif action == "merge" and source is not None and source != target:
            target = self._make(b) if target is None else target
            self._show(self.members(source), target)
            del self.names[source]
        elif action == "split" and source is not None and target is None and ids and {*ids} <= {*self.members(source)}:
            self._show(ids, self._make(b))
        else:
            return False
        return True

    def members(self, key):
        return [i for i, shown in self.shows.items() if shown == key]

    def said(self):
        return sorted((name, self.members(key)) for key, name in self.names.items()), sorted(self.shows)

    def _make(self, name):
        key = object()
        self.names[key] = name
        return key

    def _show(self, ids, key):
        for i in ids:
            self.shows[i] = key


def _do(library, action, a, b, ids):
    present = [i for i in ids if i in library.ids()]
    {
        "assign": lambda: library.assign(present, b),
        "release": lambda: library.release(present),
        "delete movements": lambda: library.delete(present),
        "delete": lambda: library.delete(a),
        "rename": lambda: library.rename(a, b),
        "merge": lambda: library.merge([a], b),
        "split": lambda: library.split(a, present, b),
    }[action]()


def _said(library):
    return [(symbol.name, symbol.members.tolist()) for symbol in library.symbols()], library.ids().tolist()


ACTIONS = ["assign", "release", "delete movements", "delete", "rename", "merge", "split"]
STEP = st.tuples(
    st.sampled_from(ACTIONS),
    st.sampled_from(NAMES[:4]),
    st.sampled_from(NAMES[:4]),
    st.lists(st.integers(1, N), max_size=4, unique=True),
)


@settings(max_examples=10)
@given(steps=st.lists(STEP, min_size=6, max_size=12))
def test_a_library_says_what_a_simple_model_says_at_every_version(tmp_path_factory, steps):
    folder, model, seen = tmp_path_factory.mktemp("actions"), Model(), []
    with ActionLibrary(folder, create=True) as library:
        library.learn(draw_movements(N, n_samples=8))
        seen.append(model.said())
        for step in [("assign", "", NAMES[0], [1, 2, 3, 4]), ("assign", "", NAMES[1], [5, 6]), *steps]:
            before, said = library.version, model.said()
            possible = model.apply(*step)
            if possible:
                _do(library, *step)
                assert library.version == before + 1
                seen.append(model.said())
            else:
                assert model.said() == said
                with pytest.raises(kineme.errors.KinemeError):
                    _do(library, *step)
                assert library.version == before
            assert _said(library) == model.said()
        for version, said in enumerate(seen, 1):
            with library.at(version) as past:
                assert _said(past) == said
        assert library.verify() == []
        assert len(library.history()) == library.version


def test_the_id_of_a_symbol_stays_when_its_name_changes(library):
    before = library["wave"]
    library.rename("wave", "greeting")
    after = library[before.id]
    assert (after.name, after.id, after.members.tolist()) == ("greeting", before.id, before.members.tolist())
    assert "greeting" in library
    assert "wave" not in library
    assert (after.created, after.changed) == (1, 2)


@pytest.mark.parametrize("name", NAMES)
def test_any_text_is_a_name_and_only_a_name(library, name, place, tmp_path):
    library.rename("bow", name + "!")
    library.delete("wave")
    library.delete("nod")
    library.rename(name + "!", name)
    library.assign([2], name + name)
    library.annotate(name, name)
    assert library[name].description == name
    assert library[name + name].members.tolist() == [2]
    assert library.movements(name).labels.tolist() == [name] * 4
    assert [symbol.name for symbol in library.symbols() if symbol.id == library[name].id] == [name]
    assert library.verify() == []
    assert sorted(path.name for path in tmp_path.rglob("*.sqlite")) == ["library.sqlite"] * (place == library.folder)


TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), min_size=1).filter(str.strip)


@pytest.mark.filterwarnings("ignore:a symbol named")  # ? and -
@given(names=st.lists(TEXT, min_size=30, max_size=30))
def test_names_come_back_as_they_were_given_but_composed_and_without_blanks_around(tmp_path_factory, names):
    with ActionLibrary(tmp_path_factory.mktemp("actions"), create=True) as library:
        library.learn(draw_movements(30, n_samples=8), labels=names)
        names = [normalize("NFC", name).strip() for name in names]
        assert {symbol.name for symbol in library.symbols()} == set(names)
        assert [library.movements(ids=[i + 1])[0].label for i in range(30)] == names


def test_one_name_in_two_forms_of_unicode_is_one_symbol(library):
    """File systems of Apple decompose names of folders, which are labels."""
    composed, decomposed = (normalize(form, "café") for form in ("NFC", "NFD"))
    library.rename("wave", decomposed)
    library.learn(draw_movements(2, seed=9), labels=[composed, decomposed], groups=[composed, decomposed])
    assert [symbol.name for symbol in library.symbols()] == ["bow", composed, "nod"]
    assert library.groups().tolist()[-2:] == [composed] * 2
    assert library[decomposed].id == library[composed].id
    assert check_symbols(library.store, [decomposed]) == [composed]


def test_a_name_is_without_the_blanks_around_it(library):
    library.rename("wave", " lead\t")
    library.learn(draw_movements(2, seed=9), labels=["lead", " lead"], groups=["ann ", "ann"])
    library.assign([int(library["nod"].members[0])], "\u00a0lead ")
    assert [symbol.name for symbol in library.symbols()] == ["bow", "lead", "nod"]
    assert library.groups().tolist()[-2:] == ["ann"] * 2
    assert len(library[" lead"]) == len(library["lead"])
    with pytest.raises(SpecificationError, match="that is no blank, got"):
        library.rename("bow", "  ")


def test_a_decomposed_name_of_an_earlier_library_is_found(library, monkeypatch):
    composed, decomposed = (normalize(form, "café") for form in ("NFC", "NFD"))
    with monkeypatch.context() as earlier:
        earlier.setattr(changes, "check_symbol", str)
        library.rename("wave", decomposed)
    assert library[composed].name == decomposed
    assert library.learn(draw_movements(1, seed=9), labels=[composed]).symbols == ()
    assert check_symbols(library.store, [composed]) == [decomposed]
    library.rename(composed, composed)
    assert library[decomposed].name == composed


def test_merging_and_splitting_record_where_symbols_come_from(library):
    wave, nod, bow = (library[name].id for name in ("wave", "nod", "bow"))
    library.merge(["wave", "nod"], "head or hand")
    merged = library["head or hand"]
    assert set(merged.parents) == {wave, nod}
    assert len(merged) == 8
    library.split("head or hand", merged.members[:3], "hand")
    assert library["hand"].parents == (merged.id,)
    library.merge(["bow", "hand"], "bow")
    assert library["bow"].id == bow
    assert len(library["bow"]) == 7


def test_a_prototype_that_leaves_is_no_prototype_any_more(library):
    first = int(library["wave"].members[0])
    library.annotate("wave", "with the hand", prototype=first, threshold=0.5)
    assert (library["wave"].prototype, library["wave"].threshold) == (first, 0.5)
    library.split("wave", [first], "other")
    assert (library["wave"].prototype, library["wave"].description) == (None, "with the hand")
    library.annotate("other", prototype=first)
    library.delete([first])
    assert library["other"].prototype is None
    assert library.verify() == []


def test_what_a_symbol_has_already_is_no_change(library):
    library.annotate("wave", "with the hand", prototype=1)
    version = library.version
    library.annotate("wave")
    library.annotate("wave", "with the hand", prototype=1)
    assert library.version == version


@pytest.mark.parametrize("leave", [lambda it: it.assign([1, 2], "nod"), lambda it: it.release([1, 2])])
def test_a_prototype_that_shows_another_symbol_does_not_stand_for_the_first(library, leave):
    for name in ("wave", "nod", "bow"):
        library.annotate(name, prototype=int(library[name].members[0]))  # 1, 2, 3
    library.assign([1], "wave")  # where it is: nothing changes
    assert library["wave"].prototype == 1
    leave(library)
    assert [library[name].prototype for name in ("wave", "bow")] == [None, 3]
    assert library["nod"].prototype == (2 if 2 in library["nod"].members else None)


def test_an_id_given_as_a_label_is_the_symbol_of_that_id(library):
    wave = library["wave"]
    report = library.learn(draw_movements(2, seed=1), labels=[wave.id, "new"])
    assert report.symbols == ("new",)
    assert len(library[wave.id]) == len(library["wave"]) == len(wave) + 1


@pytest.mark.parametrize("place", ["folder", "server"], indirect=True)
@pytest.mark.parametrize(
    "change",
    [
        lambda it, key: it.assign([1], key),
        lambda it, key: it.merge(["bow"], key),
        lambda it, key: it.learn(draw_movements(1, seed=1), labels=[key]),
    ],
)
def test_the_id_of_a_symbol_that_is_no_more_names_no_new_one(place, change):
    with ActionLibrary(place, create=True) as library:
        library.learn(draw_movements(6, labels=["wave", "nod", "bow"] * 2))
        key = library["wave"].id
        library.merge(["wave", "nod"], "both")
        before = contents(library)
        with pytest.raises(
            SpecificationError, match=f"got '{key}', which is the id .*, from which came 'both'; choose"
        ):
            change(library, key)
        assert contents(library) == before


def test_how_a_movement_came_to_its_symbol_is_kept_when_symbols_merge(library):
    library.assign([1], "nod", how="recognized")
    library.merge(["nod"], "bow")
    with library.store.reading() as connection:
        rows = connection.execute("SELECT movement, how FROM member WHERE removed IS NULL").fetchall()
    assert dict(rows) == dict.fromkeys(range(1, N + 1), "label") | {1: "recognized"}


def test_a_deleted_movement_can_be_learned_again_and_the_past_still_shows_it(library):
    before = contents(library)
    version = library.version
    library.delete(library["bow"].members)
    assert len(library) == N - 4
    report = library.learn(draw_movements(N))
    assert report.added == 4
    assert library.unlabeled().tolist() == report.ids[2::3].tolist()
    with library.at(version) as past:
        assert contents(past) == before


def test_history_says_what_was_done(library):
    library.rename("wave", "w")
    library.delete([1, 2])
    (_, renamed, deleted) = library.history()
    assert (renamed.id, renamed.action, renamed.detail) == (2, "rename", {"old": "wave", "new": "w"})
    assert (deleted.action, deleted.detail) == ("delete", {"movements": 2, "first": 1})
    assert renamed.at <= deleted.at


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda it: it["wafe"], r"expected the name or id of a symbol, got 'wafe'; there are 3, such as 'wave'"),
        (lambda it: it["\ud800"], r"expected the name or id of a symbol, got '\\ud800'"),
        (lambda it: it.rename("wave", "nod"), r"expected a name that no symbol has, got 'nod'; merge the two"),
        (lambda it: it.rename("wave", ""), r"expected a name of at least one character that is no blank, got ''"),
        (lambda it: it.rename("wave", "a\0"), r"expected a name without the character U\+0000, got 'a\\x00'"),
        (lambda it: it.rename("wave", 5), r"expected a name of at least one character that is no blank, got 5"),
        (lambda it: it.split("wave", [1, 2], "x"), r"expected movements of 'wave', got 2, which is not one of them"),
        (lambda it: it.split("wave", [1], "nod"), r"expected a name that no symbol has, got 'nod'"),
        (lambda it: it.merge("wave", "x"), r"expected a list of symbols to merge, got 'wave'"),
        (lambda it: it.merge(["wave"], "wave"), r"expected symbols other than 'wave' to merge into it, got \['wave'\]"),
        (lambda it: it.assign([1], "x", how="guess"), r"expected how to be one of \['label', .*\], got 'guess'"),
        (
            lambda it: it.assign([1, 99], "x"),
            r"movements in the library, got 99, which is not there \(1 of 2 are not\)",
        ),
        (lambda it: it.delete([]), r"expected ids of movements, whole numbers, at least one, got \[\]"),
        (lambda it: it.delete([1.5]), r"expected ids of movements, whole numbers, at least one, got \[1.5\]"),
        (lambda it: it.annotate("wave", prototype=99), r"movements in the library, got 99"),
        (lambda it: it.annotate("wave", prototype=2), r"expected a movement of 'wave' as its prototype, got 2, which"),
        (lambda it: it.annotate("wave", threshold=np.nan), r"expected threshold to be a number, got nan"),
        (lambda it: it.annotate("wave", name=""), r"expected what is annotated to be one of .* got 'name'"),
        (lambda it: it.rename("wave", it["nod"].id), r"expected a name, got 'sym-\w+', which is the id of a symbol"),
        (lambda it: it.at("1"), r"expected a version from 0 to 1, got '1'"),
        (lambda it: it.annotate("wave", 5), r"expected a description, got 5"),
        (
            lambda it: it.annotate("wave", "\ud800"),
            r"expected a description in Unicode, got '\\ud800', which",
        ),
        (lambda it: it.rename("wave", "\ud800"), r"expected a name in Unicode, got '\\ud800', which"),
        (lambda it: it.at(2), r"expected a version from 0 to 1, got 2; see history\(\)"),
    ],
)
def test_what_cannot_be_done_is_refused_and_changes_nothing(library, change, message):
    before = contents(library)
    with pytest.raises(SpecificationError, match=message):
        change(library)
    assert contents(library) == before


@pytest.mark.parametrize(
    "change",
    [
        lambda it: it.learn(draw_movements(1, seed=9), ["Unknown"]),
        lambda it: it.rename("wave", "?"),
        lambda it: it.split("wave", [1], "unknown"),
        lambda it: it.assign([1], "-"),
    ],
)
def test_a_symbol_that_is_named_as_annotations_name_none_is_warned_of(library, change):
    with pytest.warns(UserWarning, match=r"a symbol named '(\?|-|[Uu]nknown)' counts as none in annotations"):
        change(library)


def test_the_text_of_a_library_reads_no_members(library, monkeypatch):
    """Those of a million movements took seconds and half a gigabyte."""
    monkeypatch.setattr(symbols, "_with_members", None)
    assert f"{len(library)} movements, 2 dims, 3 symbols, version {library.version}" in repr(library)
