"""Who showed the movements of a library, and what follows for what is unknown."""

from __future__ import annotations

import sqlite3
from contextlib import closing

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from library_samples import draw_movements

import kineme
from kineme import ActionLibrary, Recognizer
from kineme.anchoring.proposals import propose as propose_clusters
from kineme.errors import TrajectoryError
from kineme.io.reading.merge_files import each_person
from kineme.library import proposals
from kineme.library.proposals import known_symbols
from kineme.library.recognize import LibraryRecognizer
from kineme.library.storage.connection import FILE
from soaking import slow

PEOPLE = ["anna", "ben", "cleo"]


def _shown(n_kinds=4, people=PEOPLE, copies=2, seed=0, d=2):
    """Every person shows every kind in a way of their own, `copies` times nearly alike; then what each is asked."""
    kinds = draw_movements(n_kinds, d, seed)
    rng = np.random.default_rng([seed, 1])
    u = np.linspace(0, 1, 40)
    waves = np.sin(np.pi * u[:, None] * np.arange(1, 5))
    paths, labels, groups = [], [], []
    for k in range(n_kinds):
        for person in people:
            own = kinds[k].positions + 0.25 * waves @ rng.normal(size=(4, d))
            for _ in range(copies):
                paths.append(own + 0.02 * waves @ rng.normal(size=(4, d)))
                labels.append(f"kind {k}")
                groups.append(person)
    return np.array(paths), np.array(labels), np.array(groups)


def _library(folder, *learned, **options):
    library = ActionLibrary(folder, create=True, **options)
    library.learn(*learned[:2], groups=learned[2])
    return library


@settings(deadline=None, max_examples=8)
@given(seed=st.integers(0, 99), d=st.sampled_from([2, 3]), copies=st.integers(1, 3), nameless=st.booleans())
def test_a_library_is_the_recognizer_fitted_with_the_same_groups(tmp_path_factory, seed, d, copies, nameless):
    """Those of whom it is not known who they are count as of one more person."""
    paths, labels, groups = _shown(copies=copies, seed=seed, d=d)
    order = np.random.default_rng(seed).permutation(len(paths))
    paths, labels, groups = paths[order], labels[order], groups[order]
    people = [None if nameless and person == "ben" else person for person in groups]
    questions = _shown(people=["dora"], seed=seed, d=d)[0]
    with _library(tmp_path_factory.mktemp("people"), paths, labels, people) as library:
        ours = library.recognize(list(questions), error_rate=0.1)
    theirs = Recognizer().fit(paths, labels, groups=groups).recognize(list(questions), error_rate=0.1)
    for a, b in zip(ours, theirs, strict=True):
        assert (a.label, a.rule) == (b.label, b.rule)
        assert a.p_known == pytest.approx(b.p_known, abs=1e-3)
        assert a.p_values == pytest.approx(b.p_values, abs=1e-3)


@pytest.mark.parametrize("copies", [1, 2, 6])
def test_a_large_library_calibrates_people_as_the_recognizer_does(tmp_path, copies):
    """Of classes of one size; of other classes it knows nothing, so the novelties are the scores of members."""
    paths, labels, groups = _shown(people=[*PEOPLE, "dora"][: 2 if copies == 6 else 4], copies=copies)
    with _library(tmp_path / "actions", paths, labels, groups) as library:
        ours = LibraryRecognizer(library.store, exhaustive=0).current().model.calibration
        plain = _library(tmp_path / "plain", paths, labels, None)
        other = LibraryRecognizer(plain.store, exhaustive=0).current().model.calibration
        plain.close()
    theirs = Recognizer().fit(paths, labels, groups=groups).calibration()
    np.testing.assert_allclose(ours.scales, theirs.scales, rtol=1e-3)
    for mine, its in zip(ours.own + ours.pooled, theirs.own + theirs.pooled, strict=True):
        np.testing.assert_allclose(np.sort(mine), np.sort(its), rtol=1e-3)
    if copies > 1:
        assert (other.scales < 0.7 * ours.scales).all()


@pytest.mark.soak
@pytest.mark.parametrize("alike", [slow(True), False], ids=["equally many", "nearly all by one"])
def test_large_classes_compare_no_one_with_oneself(tmp_path, alike):
    """Also where only some of a class calibrate it, and the others are compared by their bounds."""
    paths, labels, groups = _shown(n_kinds=2, people=[f"p{k}" for k in range(12 if alike else 2)], copies=18 * 12)
    many = np.arange(len(paths)) % (18 * 12)
    stays = many < 18 if alike else (groups == "p0") | (many < 3)
    paths, labels, groups = paths[stays], labels[stays], groups[stays]
    with _library(tmp_path / "actions", paths, labels, groups) as library:
        ours = LibraryRecognizer(library.store, exhaustive=0).current().model.calibration
    theirs = Recognizer().fit(paths, labels, groups=groups).calibration()
    np.testing.assert_allclose(ours.scales, theirs.scales, rtol=0.1)
    np.testing.assert_allclose(*(np.quantile(calibration.own[0], 0.5) for calibration in (ours, theirs)), rtol=0.1)


def test_classes_of_one_person_each_are_told_apart_by_how_far_they_are(tmp_path):
    paths, labels, _ = _shown(people=["anna"])
    groups = labels  # each kind by a person of its own: no two movements of a kind may be compared
    with _library(tmp_path / "actions", paths, labels, groups) as library:
        ours = LibraryRecognizer(library.store, exhaustive=0).current().model.calibration
    theirs = Recognizer().fit(paths, labels, groups=groups).calibration()
    np.testing.assert_allclose(ours.scales, theirs.scales, rtol=1e-3)


def test_a_calibration_of_other_people_is_not_taken_from_the_cache(tmp_path):
    paths, labels, groups = _shown(copies=3)
    with _library(tmp_path / "actions", paths, labels, None) as library:
        before = LibraryRecognizer(library.store, exhaustive=0).current().model.calibration
        report = library.learn(paths, groups=groups)  # said later: nothing is added but who showed what
        assert (report.added, report.duplicates) == (0, len(paths))
        after = LibraryRecognizer(library.store, exhaustive=0).current().model.calibration
        again = LibraryRecognizer(library.store, exhaustive=0).current().model.calibration
    assert (after.scales > 1.4 * before.scales).all()
    np.testing.assert_array_equal(after.scales, again.scales)


def test_who_showed_what_is_kept_with_versions_and_in_exports(tmp_path):
    demos = draw_movements(6)
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        ids = library.learn(demos, groups=["anna", "anna", None, 7, "o'ben; --", None]).ids
        assert library.groups(ids).tolist() == ["anna", "anna", None, "7", "o'ben; --", None]
        assert library.history()[-1].detail["people"] == ["7", "anna", "o'ben; --"]
        version = library.version
        library.learn(demos, groups=["cleo"] * 6)  # who is known stays
        assert library.groups(ids[::-1]).tolist() == ["cleo", "o'ben; --", "7", "cleo", "anna", "anna"]
        assert library.at(version).groups(ids).tolist()[2] is None
        assert library.learn(demos, groups=["dora"] * 6).version == library.version == version + 1  # nothing new
        assert library.verify() == []
        library.export(tmp_path / "export")
        expected = library.groups().tolist()
    with ActionLibrary.import_(tmp_path / "export", tmp_path / "copy") as copy:
        assert copy.groups().tolist() == expected
        assert copy.verify() == []


@pytest.mark.parametrize(
    ("groups", "message"),
    [
        (["anna"], r"expected one group for each of the 3 movements, got 1"),
        ("anna", r"expected one group for each of the 3 movements, got 'anna'"),
        (["anna", float("nan"), "ben"], r"expected a group that is text or a number, got nan; name who showed it"),
    ],
)
def test_groups_are_one_for_each_movement(tmp_path, groups, message):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        with pytest.raises(TrajectoryError, match=message):
            library.learn(draw_movements(3), groups=groups)
        assert len(library) == 0


def test_a_damaged_person_is_found(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(3), groups=["anna", "ben", "cleo"])
    with closing(sqlite3.connect(tmp_path / "actions" / FILE)) as connection, connection:
        connection.execute("UPDATE shown_by SET person = 'dora' WHERE movement = 2")
    with ActionLibrary(tmp_path / "actions", read_only=True) as library:
        assert [str(problem) for problem in library.verify()] == ["row 2 of table shown_by: damaged bytes"]


def test_fewer_movements_of_new_people_are_unknown_where_people_are_told_apart(tmp_path, development_data):
    """Digits in space, shown eight times by four people, asked of a fifth: the page's advice."""
    path = development_data / "gestures3d.npz"
    read = kineme.read_recordings(path)
    labels, people = read.labels.astype(str), np.array(each_person(path, read.sources))
    digits = np.flatnonzero(np.char.isdigit(labels))
    unknown = {True: [], False: []}
    for k, person in enumerate(np.unique(people)):
        rng = np.random.default_rng(k)
        questions = digits[people[digits] == person]
        pool = rng.permutation(digits[people[digits] != person])
        shown = np.concatenate([pool[labels[pool] == label][:8] for label in np.unique(labels[digits])])
        for says_who in (True, False):
            groups = people[shown] if says_who else None
            demos = read.demonstrations
            with _library(tmp_path / f"{person} {says_who}", demos[shown], labels[shown], groups) as library:
                answers = library.recognize(demos[questions])
            unknown[says_who].append(np.mean([answer.label is None for answer in answers]))
    assert np.mean(unknown[True]) < 0.08
    assert np.mean(unknown[False]) > np.mean(unknown[True]) + 0.015
    assert all(told <= untold for told, untold in zip(unknown[True], unknown[False], strict=True))


def test_what_symbols_are_proposed_by_knows_the_people_too(tmp_path):
    paths, labels, groups = _shown()
    with _library(tmp_path, paths, labels, groups) as library:
        symbols = known_symbols(library.store)
    recognizer = Recognizer().fit(paths, labels, groups=groups)
    logs = np.log(np.linspace(0.01, 0.99, 40).reshape(10, 4))
    expected = recognizer.calibration().known_p_values(logs, 0.05)
    np.testing.assert_allclose(symbols.calibration.known_p_values(logs, 0.05), expected, rtol=1e-3)
    plain = Recognizer().fit(paths, labels).calibration().known_p_values(logs, 0.05)
    assert np.abs(plain - expected).max() > 0.1


def test_proposals_are_clustered_with_the_people_who_were_named(tmp_path, monkeypatch):
    paths, _, groups = _shown()
    calls = []

    def propose(*given, groups=None, **options):
        calls.append(groups)
        return propose_clusters(*given, groups=groups, **options)

    monkeypatch.setattr(proposals, "propose_clusters", propose)
    with _library(tmp_path, paths, None, groups) as library:
        library.propose()
    np.testing.assert_array_equal(calls, [np.unique(groups, return_inverse=True)[1]])
