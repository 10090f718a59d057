"""What is learned comes back as it was, once."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from library_samples import draw_movements

import kineme
from kineme import ActionLibrary, Demonstrations, Trajectory
from kineme.errors import SpecificationError, TrajectoryError
from kineme.library import learn as learning
from kineme.library.storage.source import Source
from kineme.similarity.describe import feature_rows

SINGLE = 2.0**-24  # relative error of a rounding to single precision


@pytest.fixture
def library(place):
    with ActionLibrary(place, create=True) as actions:
        yield actions


@given(seed=st.integers(0, 10**6), d=st.integers(1, 6), ragged=st.booleans())
def test_recordings_come_back_in_single_precision_from_their_start(tmp_path_factory, seed, d, ragged):
    demos = draw_movements(7, d, seed, ragged)
    with ActionLibrary(tmp_path_factory.mktemp("actions"), create=True) as library:
        ids = library.learn(demos).ids[[3, 1, 1, 6]]
        back = library.movements(ids=ids)
    for shown, movement in zip(back, [demos[i] for i in (3, 1, 1, 6)], strict=True):
        np.testing.assert_array_equal(shown.positions[0], movement.positions[0])
        from_start = movement.positions - movement.positions[0]
        error = shown.positions - movement.positions
        assert (np.abs(error) <= SINGLE * np.abs(from_start) + 2 * np.spacing(np.abs(movement.positions))).all()
        assert shown.times[0] == movement.times[0]
        slack = SINGLE * movement.duration + 2 * np.spacing(np.abs(movement.times[-1]))
        np.testing.assert_allclose(shown.times, movement.times, rtol=0, atol=slack)
        assert shown.name == movement.name


def test_even_times_are_computed_from_the_duration(library):
    x = draw_movements(3).positions.reshape(3, -1, 2)
    library.learn(Demonstrations.from_arrays(x, times=0.3 + np.linspace(0, 2.5, x.shape[1])))
    np.testing.assert_allclose(library.movements()[1].times, 0.3 + np.linspace(0, 2.5, x.shape[1]), rtol=1e-14)


def test_stamps_finer_than_single_precision_stay_apart(library):
    """A day long, with two samples a tenth of a millisecond apart near its end."""
    times = np.append(np.linspace(0, 86400.0, 50), 86400.0001)
    library.learn([Trajectory(times, np.random.default_rng(0).normal(size=(51, 2)))])
    np.testing.assert_array_equal(library.movements()[0].times, times)


@pytest.mark.parametrize("ragged", [False, True])
def test_features_are_what_a_recognizer_sees(library, ragged):
    demos = draw_movements(20, ragged=ragged)
    library.learn(demos)
    how = library.specification
    expected = np.concatenate(feature_rows(demos, how.comparison), axis=1)
    assert library.features().dtype == np.float32
    np.testing.assert_allclose(library.features(), expected, rtol=1e-6, atol=1e-6)
    np.testing.assert_array_equal(library.features([4, 2]), library.features()[[3, 1]])


def test_primitives_are_what_the_dmp_learns_and_replay_the_movement(library):
    demos = draw_movements(12, labels=["a", "b"] * 6)
    library.learn(demos)
    expected = library.specification.dmp.learn(demos)
    back = library.primitives()
    np.testing.assert_allclose(back.scaled_weights, expected.scaled_weights, rtol=2 * SINGLE)
    for name in ("starts", "goals", "velocities", "durations", "extents"):
        np.testing.assert_array_equal(getattr(back, name), getattr(expected, name))
    assert back.labels.tolist() == demos.labels.tolist()
    assert library.primitives("b").names == demos.names[1::2]
    paths = back.rollout(n_samples=40).positions
    np.testing.assert_allclose(paths, demos.positions.reshape(12, 40, 2), atol=0.02 * np.ptp(demos.positions))


def test_a_short_movement_does_not_change_how_others_are_seen(library):
    """Four samples cannot be smoothed; the rest of the batch still is."""
    noisy = [movement.positions + np.random.default_rng(0).normal(0, 0.05, (40, 2)) for movement in draw_movements(3)]
    short = np.array([[0.0, 0], [1, 0], [1, 1], [0, 2]])
    library.learn([*noisy, short])
    how = library.specification
    expected = np.concatenate(feature_rows(noisy, how.comparison), axis=1)
    np.testing.assert_allclose(library.features()[:3], expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("ragged", [False, True])
def test_learning_again_does_not_duplicate(library, ragged):
    demos = draw_movements(9, ragged=ragged)
    first = library.learn(demos)
    again = library.learn(demos[::-1])
    assert (again.added, again.duplicates, len(library)) == (0, 9, 9)
    assert again.ids.tolist() == first.ids[::-1].tolist()
    assert library.version == first.version == again.version  # nothing happened


def test_the_same_movement_twice_in_one_call_is_one_movement(library):
    demos = draw_movements(3)
    report = library.learn([demos[0], demos[1], demos[0]])
    assert (report.added, report.duplicates, report.ids.tolist()) == (2, 1, [1, 2, 1])


@pytest.mark.parametrize("n_calls", [1, 2, 4])
def test_the_first_label_and_the_first_person_count_in_one_call_as_in_several(library, n_calls):
    """A copy of a movement adds what was not said of it, and changes nothing that was."""
    demos = draw_movements(2)
    copies, labels = [0, 0, 1, 0], [None, "pear", "fig", "apple"]
    people, symbols = ["ann", "bob", None, "bob"], []
    for some in np.split(np.arange(4), n_calls):
        several = [demos[copies[i]] for i in some]
        symbols += library.learn(several, [labels[i] for i in some], groups=[people[i] for i in some]).symbols
    assert symbols == ["pear", "fig"]
    assert {symbol.name: symbol.members.tolist() for symbol in library.symbols()} == {"pear": [1], "fig": [2]}
    assert library.groups().tolist() == ["ann", None]


def test_place_and_time_tell_movements_apart_but_not_their_origin_in_time(library):
    movement = draw_movements(1, ragged=True)[0]
    shifted = Trajectory(movement.times, movement.positions + 1.0)
    slower = Trajectory(2 * movement.times, movement.positions)
    report = library.learn([movement, shifted, slower])
    assert report.added == 3
    x = draw_movements(1)[0].positions
    early, late = (Demonstrations.from_arrays([x], times=[t0 + np.arange(40) / 32]) for t0 in (0.0, 64.0))
    assert library.learn(early).added == 1
    assert library.learn(late).duplicates == 1


def test_a_movement_is_known_by_its_place_in_a_file_read_in_the_same_way(library):
    source = Source("wave.csv", "1" * 64, 4, options={"unit": "m"})
    demos = draw_movements(4)
    places = ["0", "1", "2", "3"]
    library.learn(demos, source=source, places=places)
    moved = replace(source, path="other.csv")
    rounded = [movement.positions.astype(np.float32) for movement in demos]
    assert library.learn(rounded, source=moved, places=places).duplicates == 4
    other = replace(moved, options={"unit": "mm"})
    assert library.learn(rounded, source=other, places=places).added == 4
    again = library.learn([demos[1].positions.astype(np.float16)], source=[moved], places=["1"])
    assert again.ids.tolist() == [2]


def test_a_file_that_comes_in_two_calls_without_places_is_learned_whole(library):
    source, demos = Source("wave.csv", "0" * 64, 1), draw_movements(4)
    assert library.learn(demos[:2], source=source).added == 2
    assert library.learn(demos[2:], source=source).added == 2
    assert library.learn(demos, source=source).duplicates == 4


def test_a_library_keeps_the_specification_that_it_was_made_with(library, tmp_path):
    folder = library.folder
    for same in ({}, {"recognizer": kineme.Recognizer()}, {"dmp": library.specification.dmp}):
        kineme.ActionLibrary(folder, create=True, **same).close()
    for other in ({"recognizer": kineme.Recognizer(max_angle=0.1)}, {"dmp": kineme.DMP(n_basis=20)}):
        with pytest.raises(SpecificationError, match=r"that the library in .* was made with, got others"):
            kineme.ActionLibrary(folder, **other)


def test_a_label_makes_a_symbol_or_joins_it_and_a_person_may_rename_it(library):
    demos = draw_movements(6, labels=["wave", "wave", "nod", "nod", "wave", "nod"])
    assert library.learn(demos[:4]).symbols == ("wave", "nod")
    assert library.learn(demos[4:]).symbols == ()
    assert library["wave"].members.tolist() == [1, 2, 5]
    library.rename("wave", "greeting")
    assert library.learn(demos).symbols == ()  # they show a symbol already
    assert library["greeting"].members.tolist() == [1, 2, 5]


def test_movements_without_a_label_wait_for_one(library):
    demos = draw_movements(5)
    library.learn(demos, labels=["a", None, None, 7, None])
    assert library.unlabeled().tolist() == [2, 3, 5]
    assert library.movements().labels is None
    assert library["7"].members.tolist() == [4]
    library.learn(demos, labels=["b"] * 5)
    assert library["b"].members.tolist() == [2, 3, 5]
    assert not len(library.unlabeled())


def test_batches_make_no_difference(tmp_path, monkeypatch):
    demos = draw_movements(30, ragged=True, labels=["a", "b", "c"] * 10)
    with ActionLibrary(tmp_path / "one", create=True) as small, ActionLibrary(tmp_path / "many", create=True) as many:
        small.learn(demos)
        monkeypatch.setattr(learning, "_BATCH_MOVEMENTS", 7)
        seen = []
        report = many.learn(demos, progress=lambda done, total: seen.append((done, total)))
        assert seen == [(7, 30), (14, 30), (21, 30), (28, 30), (30, 30)]
        assert (report.version, many.version, small.version) == (5, 5, 1)
        np.testing.assert_array_equal(many.movements().positions, small.movements().positions)
        np.testing.assert_allclose(many.features(), small.features(), atol=1e-6)
        assert [s.members.tolist() for s in many.symbols()] == [s.members.tolist() for s in small.symbols()]


def test_learning_that_was_interrupted_goes_on_where_it_ended(library, monkeypatch):
    demos = draw_movements(30)
    monkeypatch.setattr(learning, "_BATCH_MOVEMENTS", 10)

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        library.learn(demos, progress=stop)
    there = len(library)
    assert there in (10, 20)
    report = library.learn(demos)
    assert (report.added, report.duplicates, len(library)) == (30 - there, there, 30)


def test_disk_is_little_more_than_the_arrays_in_single_precision(tmp_path):
    demos = draw_movements(3000, n_samples=200)
    with ActionLibrary(tmp_path, create=True) as library:
        library.learn(demos)
    arrays = 4 * len(demos) * (200 * 2 + 600)
    assert (tmp_path / "library.sqlite").stat().st_size < 1.25 * arrays
    assert [path.name for path in tmp_path.iterdir()] == ["library.sqlite"]


@pytest.mark.parametrize(
    ("movements", "options", "message"),
    [
        ([np.ones((9, 2))], {}, r"trajectory 0: expected a movement, got 9 samples at the same place"),
        (
            [np.arange(20.0).reshape(10, 2), 1e-32 * np.arange(20.0).reshape(10, 2)],
            {},
            r"trajectory 1: expected an extent from 1e-30 to 1e\+30, got 1.8e-31; choose a unit",
        ),
        (np.random.default_rng(0).normal(size=(2, 9, 3)), {}, r"expected movements of 2 dimensions .* got 3; choose"),
        (np.random.default_rng(0).normal(size=(2, 9, 2)), {"labels": ["a"]}, r"one label for each of the 2 .* got 1"),
        (np.random.default_rng(0).normal(size=(2, 9, 2)), {"places": ["a"]}, r"one place for each of the 2 .* got 1"),
        (
            np.random.default_rng(0).normal(size=(2, 9, 2)),
            {"source": Source("a.csv", "0" * 64, 1), "places": ["1", "1"]},
            "a place of its own in 'a.csv' .* got '1' for movements 0 and 1; name them apart",
        ),
        (np.random.default_rng(0).normal(size=(2, 9, 2)), {"source": []}, r"one for each of the 2 movements, got 0"),
    ],
)  # fmt: skip
def test_what_cannot_be_stored_is_refused_before_anything_is(library, movements, options, message):
    library.learn(draw_movements(2))
    before = library.version
    with pytest.raises(TrajectoryError, match=message):
        library.learn(movements, **options)
    assert library.version == before


@pytest.mark.parametrize(("label", "shown"), [("", "''"), ("a\ud800", r"'a\ud800'")])
def test_a_label_is_text(library, label, shown):
    with pytest.raises(
        kineme.errors.SpecificationError, match=rf"^trajectory 1.*expected a name .* got {re.escape(shown)}"
    ):
        library.learn(draw_movements(2), labels=["fine", label])
    assert len(library) == 0


def test_a_number_is_the_same_label_with_and_without_a_fraction_of_zero(library):
    library.learn(draw_movements(5), labels=[1, 1.0, np.float32(1.0), "1", 1.5])
    assert {symbol.name for symbol in library.symbols()} == {"1", "1.5"}


def test_nothing_of_the_caller_is_changed(library):
    x = draw_movements(3).positions.reshape(3, -1, 2).copy()
    x.setflags(write=False)
    before = x.copy()
    library.learn(x)
    np.testing.assert_array_equal(x, before)


@pytest.mark.parametrize("weights", ["equal", [0.5, 0.25, 0.25]])
def test_the_specification_is_kept_with_the_library(tmp_path, weights):
    chosen = weights if isinstance(weights, str) else tuple(weights)
    recognizer = kineme.Recognizer(scale="none", translation=False, cutoff=None, max_angle=0.3, weights=weights)
    dmp = kineme.DMP("bio-inspired", n_basis=15, fit="trajectory", preprocessing=(kineme.Smooth(12.0),))
    with ActionLibrary(tmp_path, create=True, recognizer=recognizer, dmp=dmp) as library:
        library.learn(draw_movements(4))
    with ActionLibrary(tmp_path) as library:
        assert library.specification.dmp == dmp
        assert library.specification.recognizer().get_params() == {
            **recognizer.get_params(),
            "representations": library.specification.representations,
            "weights": chosen,
        }
        assert library.primitives().dmp == dmp
        np.testing.assert_allclose(library.features()[:, 0], draw_movements(4).positions[::40, 0], rtol=1e-6)


def test_an_empty_library_says_so(library):
    assert len(library) == len(library.unlabeled()) == library.version == 0
    assert library.n_dims is None
    assert library.symbols() == library.history() == ()
    assert library.verify() == []
    for read in (library.movements, library.features, library.primitives):
        with pytest.raises(
            kineme.errors.SpecificationError, match=r"expected at least one movement, got none: the library"
        ):
            read()


@pytest.mark.parametrize("duration", [1e-45, 1e-41, 1e-35, 1e35, 3.5e38, 1e45])
def test_durations_beyond_single_precision_come_back(tmp_path, duration):
    times = duration * np.array([0.0, 0.2, 0.3, 0.5, 0.9, 1.0])
    positions = np.random.default_rng(0).normal(size=(6, 2))
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(Demonstrations.from_arrays([positions], times=[times]))
        assert library.verify() == []
        np.testing.assert_allclose(library.movements().times, times, rtol=1e-12)


def test_weights_beyond_single_precision_are_refused(tmp_path):
    """After a fast beginning nobody knows how the path goes on until its last sample."""
    times = np.append(1e-9 * np.arange(6.0), 1.0)
    positions = 1e29 * np.array([0.0, 1.0, -1.0, 1.0, -1.0, 1.0, 0.0])[:, None]
    with (
        ActionLibrary(tmp_path / "actions", create=True) as library,
        pytest.raises(TrajectoryError, match=r"trajectory 0: expected weights up to 3e\+38, got larger ones; smooth"),
    ):
        library.learn(Demonstrations.from_arrays([positions], times=[times]))


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        ({"labels": "ab"}, r"one label for each of the 2 movements, got 'ab'"),
        ({"labels": 5}, r"one label for each of the 2 movements, got 5"),
        ({"labels": np.array("a")}, r"one label for each of the 2 movements, got array"),
        ({"labels": ["a"]}, r"one label for each of the 2 movements, got 1"),
        (
            {"labels": ["a", float("nan")]},
            r"trajectory 1 .* a label that is text or a number, got nan",
        ),
        ({"labels": [["a"], "b"]}, r"trajectory 0 \('no 0'\): expected a label that is text or a number, got \['a'\]"),
        ({"source": 5}, r"one source, or one for each of the 2 movements, got 5"),
        ({"source": ["a.csv", None]}, r"sources to be kineme.library.storage.source.Source or None, got 'a.csv'"),
        ({"places": 5}, r"one place for each of the 2 movements, got 5"),
        ({"places": ["1"]}, r"one place for each of the 2 movements, got 1"),
    ],
)
def test_labels_sources_and_places_that_cannot_be_are_refused(tmp_path, wish, message):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        with pytest.raises(TrajectoryError, match=message):
            library.learn(draw_movements(2), **wish)
        assert len(library) == 0


@pytest.mark.parametrize("who", [object(), 10**400, [], {}, 1j, None, b"a"])
def test_what_is_no_text_names_no_symbol(tmp_path, who):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(draw_movements(2), ["a", "b"])
        for ask in (library.__getitem__, library.nearest):
            with pytest.raises(SpecificationError, match="expected"):
                ask(who)


def test_a_library_is_not_iterated_over(library):
    library.learn(draw_movements(3, 2, 0, False), labels=["a", "b", "b"])
    with pytest.raises(TypeError, match="not iterable"):
        list(library)
    assert "a" in library
    assert [symbol.name for symbol in library.symbols()] == ["a", "b"]
