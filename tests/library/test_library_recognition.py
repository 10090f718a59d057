"""What a library answers, small or large: the ordinary answer, whatever became of its caches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from library_samples import draw_movements

from kineme import ActionLibrary, Demonstrations, Recognizer, Trajectory
from kineme.errors import SpecificationError, TrajectoryError
from kineme.library import calibration_cache
from kineme.library import reduced_features_cache as features_cache
from kineme.library.recognize import LibraryRecognizer
from kineme.recognition import two_stage_search as sampled_calibration
from kineme.recognition.answer import known_classes, open_set_labels
from kineme.recognition.classifiers import LogarithmicPool, NearestProfiled
from kineme.recognition.conformal import distances
from kineme.similarity.comparison import StoredReferences


def _kinds(counts, d=2, seed=0, spread=0.05):
    """Copies of random movements, varied by a few smooth waves of their own."""
    kinds, rng = draw_movements(len(counts), d, seed), np.random.default_rng([seed, 1])
    which = np.repeat(np.arange(len(counts)), counts)
    u = np.linspace(0, 1, 40)
    waves = np.sin(np.pi * u[:, None] * np.arange(1, 5)) @ rng.normal(size=(len(which), 4, d))
    paths = kinds.positions.reshape(len(counts), 40, d)[which] + spread * waves
    order = rng.permutation(len(which))
    labels = np.array([f"kind {k:02d}" for k in which])
    return Demonstrations.from_arrays(paths, labels, names=[f"no {i}" for i in range(len(which))])[order]


def _questions(counts, d=2, seed=0):
    return _kinds([1] * len(counts), d, seed, spread=0.15)


def _plain(answers):
    return [(a.label, a.ranked, [n.index for n in a.nearest], a.confidence, dict(a.p_values)) for a in answers]


def _same(ours, theirs):
    for a, b in zip(ours, theirs, strict=True):
        assert a[:3] == b[:3]
        assert a[3] == pytest.approx(b[3], abs=1e-5)
        assert a[4] == pytest.approx(b[4], abs=1e-5)


@pytest.fixture
def make(tmp_path):
    opened = []

    def made(demos=None, name="actions", **options):
        library = ActionLibrary(tmp_path / name, create=not options.get("read_only", False), **options)
        opened.append(library)
        if demos is not None:
            library.learn(demos)
        return library

    yield made
    for library in opened:
        library.close()


@pytest.mark.parametrize(
    ("counts", "d", "spread", "classifier"),
    [(counts, d, 0.05, None) for counts in ([1] * 6, [10] * 4, [1, 2, 5, 9]) for d in (1, 2, 3)]
    + [([1] * 4, 6, 0.05, NearestProfiled), ([2] * 6, 6, 1.0, LogarithmicPool), ([4] * 6, 2, 0.4, LogarithmicPool)],
)
def test_a_small_library_answers_as_the_recognizer_of_its_movements(make, counts, d, spread, classifier):
    demos, questions = _kinds(counts, d, spread=spread), _questions(counts, d)
    library, order = make(), np.argsort(demos.labels, kind="stable")
    people = None if classifier is None else [f"person {i % 2}" for i in range(len(demos))]
    library.learn(demos, groups=people)
    recognizer = Recognizer(representations=library.specification.representations).fit(demos, groups=people)
    if classifier is not None:
        assert {type(recognizer.classifier_), type(LibraryRecognizer(library.store).current().model.classifier)} == {
            classifier
        }
    for ours, theirs in zip(library.recognize(questions), recognizer.recognize(questions), strict=True):
        assert (ours.label, ours.ranked) == (theirs.label, theirs.ranked)
        assert ours.probabilities == pytest.approx(theirs.probabilities, abs=1e-4)
        assert ours.p_values == pytest.approx(theirs.p_values, abs=1e-4)
        assert [neighbor.index - 1 for neighbor in ours.nearest] == [
            order[neighbor.index] for neighbor in theirs.nearest
        ]
        assert [neighbor.name for neighbor in ours.nearest] == [neighbor.name for neighbor in theirs.nearest]
        np.testing.assert_allclose(ours.transform.matrix, theirs.transform.matrix, atol=1e-4)


@pytest.mark.parametrize("d", [1, 2, 6])
def test_movements_join_what_the_recognizer_says_of_those_who_showed_some(make, d):
    demos, unlabeled = _kinds([4] * 6, d, spread=1.3), _kinds([4] * 8, d, spread=1.3)
    library = make()
    library.learn(demos)
    moved = [Trajectory(one.times, one.positions + 1.0) for one in unlabeled]
    library.learn(moved)
    recognizer = Recognizer(representations=library.specification.representations).fit(demos)
    labels = open_set_labels(known_classes(recognizer), recognizer.describe(moved), 0.05)[0]
    names, counts = np.unique([label for label in labels if label is not None], return_counts=True)
    assert isinstance(recognizer.classifier_, LogarithmicPool)
    assert library.join() == dict(zip(names.tolist(), counts.tolist(), strict=True))
    of_kernels = Recognizer(representations=library.specification.representations, classifier="nearest-each").fit(demos)
    by_kernels = open_set_labels(known_classes(of_kernels), of_kernels.describe(moved), 0.05)[0]
    assert by_kernels.tolist() != labels.tolist()


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("count", [1, 2, 4, 12])
def test_a_large_library_answers_as_the_nearest_of_all(make, count, d):
    """Classes of one size calibrate the same, whether sampled or not."""
    demos, questions = _kinds([count] * 6, d, seed=count), _questions([count] * 6, d, seed=count)
    library = make(demos)
    ours = LibraryRecognizer(library.store, exhaustive=0)
    theirs = library.specification.recognizer().set_params(classifier="nearest").fit(demos)
    order = np.argsort(demos.labels, kind="stable")
    for a, b in zip(ours.recognize(questions), theirs.recognize(questions), strict=True):
        assert a.label == b.label
        assert a.ranked == b.ranked
        assert a.p_values == pytest.approx(b.p_values, abs=1e-4)
        assert a.nearest[0].index - 1 == order[b.nearest[0].index]
        assert a.nearest[0].name == b.nearest[0].name
        np.testing.assert_allclose(a.transform.matrix, b.transform.matrix, atol=1e-4)


@pytest.mark.parametrize(
    "weights",
    [(0, 1, 1, 1, 1, 1, 1), (0, 0, 0, 0, 1, 0, 0), (0, 0, 0, 0, 0, 1, 0)],
    ids=["no positions", "point cloud alone", "elastic path in detail alone"],
)
def test_a_large_library_without_weight_on_positions_answers_as_the_nearest_of_all(make, weights):
    demos, questions = _kinds([4] * 6), _questions([4] * 6)
    library = make(demos, recognizer=Recognizer(weights=weights, classifier="nearest"))
    answers = LibraryRecognizer(library.store, exhaustive=0).recognize(questions)
    expected = Recognizer(weights=weights).fit(demos).predict(questions)
    assert [answer.ranked[0] for answer in answers] == expected.tolist()


@pytest.mark.soak
def test_large_classes_keep_the_error_rate(make):
    """New members of classes larger than what is sampled of them are unknown about as often as was asked for."""
    kinds = _kinds([200] * 4, seed=7, spread=0.1)
    rng = np.random.default_rng(0)
    order = rng.permutation(len(kinds))
    library = make()
    library.learn(kinds[order[:640]], groups=range(640))  # each as if by somebody else
    answers = LibraryRecognizer(library.store, exhaustive=0).recognize(kinds[order[640:]], error_rate=0.1)
    labels = kinds.labels[order[640:]]
    assert np.mean([a.label in {None, name} for a, name in zip(answers, labels, strict=True)]) == 1
    assert 0.03 < np.mean([a.label is None for a in answers]) < 0.2


@pytest.mark.parametrize("d", [2, 3])
def test_calibration_finds_the_nearest_of_a_large_class(make, d):
    """Or one hardly farther: bounds leave out what is compared pair by pair, so the few with the best are compared."""
    library = make(_kinds([400, 5], d, seed=7, spread=0.1))
    model = LibraryRecognizer(library.store, exhaustive=0).current().model
    stored, similarity = model.stored, model.comparison.similarity
    members, questions = stored.members, sampled_calibration._positions(stored, 0)[::4]
    alone = np.arange(len(members))
    others = sampled_calibration._proposed(similarity, stored, alone, 0, questions)
    own = stored.described(similarity, members[questions])
    to_own = sampled_calibration._to_own(similarity, own, stored.described(similarity, members[others.ravel()]))
    every = np.setdiff1d(sampled_calibration._positions(stored, 0), questions)
    away = distances(similarity.log_average(own, stored.described(similarity, members[every])))
    to_own, nearest = to_own.min(axis=1), away.min(axis=1)
    assert (to_own >= nearest - 1e-4).all()
    assert to_own.mean() < 1.012 * nearest.mean()
    assert np.mean(to_own < nearest + 1e-4) > 0.85


@pytest.mark.soak
def test_calibration_holds_few_bounds_at_once(make, monkeypatch):
    """Of a million movements, the bounds of a hundred to all were two gigabytes."""
    library, together = make(_kinds([60] * 4)), []
    bounds = StoredReferences.bounds

    def noted(self, similarity, questions):
        together.append(len(questions[0].values))
        return bounds(self, similarity, questions)

    monkeypatch.setattr(StoredReferences, "bounds", noted)
    few = LibraryRecognizer(library.store, exhaustive=0).current().model.calibration
    assert sum(together) == 100
    assert max(together) <= 8
    monkeypatch.setattr(sampled_calibration, "_BOUNDED", 100)
    (library.folder / "calibration.cache").unlink()
    many = LibraryRecognizer(library.store, exhaustive=0).current().model.calibration
    assert together[-1] == 100
    np.testing.assert_allclose(few.scales, many.scales, rtol=1e-6)


def _flip(path, where):
    data = bytearray(path.read_bytes())
    data[int(where * (len(data) - 1))] ^= 0xFF
    path.write_bytes(data)


def _cut(path, where):
    path.write_bytes(path.read_bytes()[: int(where * path.stat().st_size)])


DAMAGES = {"flipped": _flip, "truncated": _cut, "gone": lambda path, where: path.unlink()}


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """A library that has answered, what it was asked, its answers, and the caches that it made for them."""
    questions = _questions([3] * 5)
    with ActionLibrary(tmp_path_factory.mktemp("actions"), create=True) as library:
        library.learn(_kinds([3] * 5))
        before = _plain(LibraryRecognizer(library.store, exhaustive=0).recognize(questions))
        caches = {name: (library.folder / name).read_bytes() for name in (features_cache.FILE, calibration_cache.FILE)}
    return library.folder, questions, before, caches


@pytest.mark.parametrize("name", [features_cache.FILE, calibration_cache.FILE])
@pytest.mark.parametrize("damage", DAMAGES)
@given(where=st.floats(0, 0.999))
def test_a_damaged_cache_is_made_again(served, name, damage, where):
    folder, questions, before, caches = served
    for each, data in caches.items():
        (folder / each).write_bytes(data)
    with ActionLibrary(folder) as library:
        data = caches[name]
        DAMAGES[damage](folder / name, where)
        _same(_plain(LibraryRecognizer(library.store, exhaustive=0).recognize(questions)), before)
        again = (folder / name).read_bytes()
        assert len(again) == len(data)
        assert again == data or name == calibration_cache.FILE  # whose archive holds the time of day
        assert not list(folder.glob(".*cache*"))


def test_the_caches_of_another_library_are_not_believed(make):
    counts = [3] * 5
    library, other = make(_kinds(counts, seed=1), "one"), make(_kinds(counts, seed=2), "other")
    questions = _questions(counts, seed=2)
    before = _plain(LibraryRecognizer(other.store, exhaustive=0).recognize(questions))
    LibraryRecognizer(library.store, exhaustive=0).recognize(questions)
    for name in (features_cache.FILE, calibration_cache.FILE):
        (other.folder / name).write_bytes((library.folder / name).read_bytes())
    _same(_plain(LibraryRecognizer(other.store, exhaustive=0).recognize(questions)), before)


def test_the_codes_of_a_history_that_was_rolled_back_are_not_believed(make, tmp_path):
    """A copy of the database goes on where the original did, with other movements under the same ids."""
    counts = [3] * 5
    library = make(_kinds(counts, seed=1)[:8])
    library.export(tmp_path / "backup")
    library.learn(_kinds(counts, seed=1)[8:])
    questions = _questions(counts, seed=1)
    LibraryRecognizer(library.store, exhaustive=0).recognize(questions)
    again = ActionLibrary.import_(tmp_path / "backup", tmp_path / "again")
    with again:
        again.learn(_kinds(counts, seed=5)[8:])
        before = _plain(LibraryRecognizer(again.store, exhaustive=0).recognize(questions))
        (again.folder / features_cache.FILE).write_bytes((library.folder / features_cache.FILE).read_bytes())
        _same(_plain(LibraryRecognizer(again.store, exhaustive=0).recognize(questions)), before)


def test_answers_follow_every_change(make):
    demos, questions = _kinds([4] * 6), _questions([4] * 6)
    library = make(demos[:8])
    recognizing, fresh = LibraryRecognizer(library.store, exhaustive=0), []
    for change in (
        lambda: library.learn(demos[8:16]),
        lambda: library.learn(demos[16:]),
        lambda: library.learn(_kinds([1], seed=9), labels=[None]),
        lambda: library.rename("kind 01", "wave"),
        lambda: library.merge(["kind 02", "kind 03"], "both"),
        lambda: library.delete(library["wave"].members[:2]),
        lambda: library.delete("kind 04"),
    ):
        recognizing.recognize(questions)
        change()
        fresh = LibraryRecognizer(library.store, exhaustive=0)
        _same(_plain(recognizing.recognize(questions)), _plain(fresh.recognize(questions)))
    names = {name for answer in fresh.recognize(questions) for name in answer.p_values}
    assert names == {"kind 00", "wave", "both", "kind 05"}


def test_an_earlier_version_answers_as_it_did(make):
    demos, questions = _kinds([4] * 6), _questions([4] * 6)
    library = make(demos[:12])
    before, version = _plain(LibraryRecognizer(library.store, exhaustive=0).recognize(questions)), library.version
    library.learn(demos[12:])
    library.rename(demos.labels[0], "wave")
    LibraryRecognizer(library.store, exhaustive=0).recognize(questions)
    with library.at(version) as past:
        _same(_plain(LibraryRecognizer(past.store, exhaustive=0).recognize(questions)), before)
        _same(_plain(past.recognize(questions)), _plain(past.recognize(questions)))


def test_reading_only_leaves_nothing_behind(make):
    library = make(_kinds([4] * 6))
    reader = make(read_only=True)
    before = sorted(path.name for path in library.folder.iterdir())
    assert len(LibraryRecognizer(reader.store, exhaustive=0).recognize(_questions([4] * 6))) == 6
    assert sorted(path.name for path in library.folder.iterdir()) == before


def test_one_movement_gets_one_answer_and_unlabeled_ones_give_none(make):
    demos = _kinds([3] * 4)
    library = make(demos)
    nameless = library.learn(_questions([3] * 4), labels=[None] * 4).ids
    for recognizing in (library, LibraryRecognizer(library.store, exhaustive=0)):
        for question in _questions([3] * 4):
            answer = recognizing.recognize(question)
            assert answer.ranked[0] == question.label
            assert not {near.index for near in answer.nearest} & set(nameless.tolist())


def test_a_library_with_one_symbol_knows_it_from_others(make):
    library = make(_kinds([12]))
    for recognizing in (library, LibraryRecognizer(library.store, exhaustive=0)):
        (answer,) = recognizing.recognize(_questions([12]))
        assert list(answer.p_values) == ["kind 00"]


def test_a_library_of_one_movement_guesses(make):
    library = make(_kinds([1]))
    for recognizing in (library, LibraryRecognizer(library.store, exhaustive=0)):
        (answer,) = recognizing.recognize(_questions([1]))
        assert (answer.label, answer.rule, answer.calibrated) == ("kind 00", "guess", False)


def test_what_cannot_be_answered_says_why(make):
    library = make()
    library.learn(_kinds([2]), labels=[None, None])
    with pytest.raises(SpecificationError, match=r"that show a symbol, got none among its 2; learn some with"):
        library.recognize(_questions([1]))
    for exhaustive in (0, 1000):
        recognizing = LibraryRecognizer(make(_kinds([2, 2]), f"two {exhaustive}").store, exhaustive)
        with pytest.raises(TrajectoryError, match=r"expected movements of 2 dimensions as learned, got 3"):
            recognizing.recognize(_questions([1], d=3))
