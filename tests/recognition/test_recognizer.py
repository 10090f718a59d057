"""The recognizer: what it is invariant to, what its parameters do, its classifiers, its use in scikit-learn."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC

import kineme
from kineme import ActionLibrary, Demonstrations, Recognizer, Trajectory
from kineme.datasets.lasa import PAPER_LETTERS
from kineme.errors import SpecificationError, TrajectoryError
from kineme.kernels.rotation import RotationPrior
from kineme.movements.preparation.perturbations import Perturbation
from kineme.movements.preparation.resample import arc_length_phase
from kineme.similarity import scores as module
from movement_samples import draw_shapes, turn
from soaking import examples

any_seed = given(seed=st.integers(0, 10**6))
planes = pytest.mark.parametrize("d", [2, 3])


@planes
@any_seed
def test_place_size_direction_and_duration_do_not_matter(d, seed):
    rng = np.random.default_rng(seed)
    demos = draw_shapes([2] * 5, d, seed)
    recognizer = Recognizer().fit(demos)
    R = turn(rng.uniform(-0.7, 0.7), d, seed)
    moved = [
        Trajectory(one.times * rng.uniform(0.1, 9), rng.uniform(0.2, 5) * one.positions @ R.T + rng.normal(size=d))
        for one in demos
    ]
    np.testing.assert_array_equal(recognizer.predict(moved), demos.labels)
    free = Recognizer(max_angle=math.pi).fit(demos)  # where rotations cost nothing
    np.testing.assert_allclose(np.diag(free.log_similarity(moved)), 0, atol=2e-3)
    np.testing.assert_allclose(free.log_similarity(moved), free.log_similarity(demos), rtol=1e-3, atol=2e-3)


@planes
@any_seed
def test_uneven_timing_does_not_matter(d, seed):
    demos = draw_shapes([1] * 6, d, seed)
    late = Perturbation(warp=0.4).apply(demos, seed)
    assert Recognizer().fit(demos).score(late, demos.labels) == 1


def _relative(x, other, **parameters):
    """Log similarity of another movement to x, beside an unrelated third."""
    third = draw_shapes([1], seed=9)[0].positions
    return Recognizer(cutoff=None, **parameters).fit([x, third], ["a", "third"]).log_similarity([other])[0, 0]


def test_each_parameter_takes_out_what_it_says():
    x = draw_shapes([1], seed=1)[0].positions
    small, away, turned, wide = 0.4 * x, x + 3.0, x @ turn(2.5, 2).T, x * [2.0, 1.0]
    assert _relative(x, small) > -0.01 > _relative(x, small, scale="none")
    assert _relative(x, away) > -0.01
    assert _relative(x, away, translation=False) < -1
    assert _relative(x, turned, max_angle=math.pi) > -0.01
    assert _relative(x, turned) < -0.1  # a preference
    assert _relative(x, turned, max_angle=math.pi / 3) < -1
    assert _relative(x, turned, rotation_prior=None) == _relative(x, turned, max_angle=math.pi / 3)
    assert _relative(x, wide) < _relative(x, wide, scale="per-dimension")


def test_a_mirror_image_is_not_the_movement():
    x = draw_shapes([1], seed=1)[0].positions
    assert _relative(x, x * [-1.0, 1.0], max_angle=math.pi) < -1


def test_what_the_invariances_merge():
    """A dot and a circle but for their size; N and Z, a right angle apart, but for the angle allowed."""
    u = np.linspace(0, 2 * math.pi, 80)
    circle = np.column_stack((np.cos(u), np.sin(u)))
    assert _relative(circle, 0.01 * circle) > -0.01 > _relative(circle, 0.01 * circle, scale="none")
    corners = np.array([[0, 0], [0, 1], [1, 0], [1, 1.0]])
    N = np.column_stack([np.interp(np.linspace(0, 3, 100), range(4), corners[:, k]) for k in (0, 1)])
    Z = N @ turn(-math.pi / 2, 2).T
    assert _relative(N, Z, max_angle=math.pi) > -0.01
    assert _relative(N, Z, max_angle=math.pi / 4) < -0.8
    assert _relative(N, Z) < -0.03  # a rotation by a right angle costs a little
    assert _relative(N, Z, rotation_prior=RotationPrior(0.3)) < -0.2


def test_nearest_is_one_nearest_neighbor_on_the_similarity():
    demos, fresh = draw_shapes([3] * 6, seed=2, spread=0.6), draw_shapes([9] * 6, seed=2, spread=0.9)
    recognizer = Recognizer(classifier="nearest").fit(demos)
    neighbor = KNeighborsClassifier(1, metric="precomputed")
    neighbor.fit(np.maximum(-recognizer.log_similarity(demos), 0), demos.labels)
    np.testing.assert_array_equal(recognizer.predict(fresh), neighbor.predict(-recognizer.log_similarity(fresh)))


@pytest.mark.parametrize("mean", ["arithmetic", "geometric"])
def test_nearest_of_each_representation_may_be_another_demonstration(mean):
    demos, fresh = draw_shapes([3] * 6, seed=2, spread=0.6), draw_shapes([9] * 6, seed=2, spread=0.9)
    recognizer = Recognizer(classifier="nearest-each", mean=mean).fit(demos)
    logs = recognizer.comparison_.similarity.logs(recognizer.describe(fresh), recognizer.references_.described)
    nearest = logs.reshape(7, -1, 6, 3).max(axis=3)
    expected = np.log(np.exp(nearest).mean(axis=0)) if mean == "arithmetic" else nearest.mean(axis=0)
    np.testing.assert_allclose(recognizer.decision_function(fresh), expected, rtol=1e-6)
    alone = Recognizer(classifier="nearest", mean=mean).fit(demos).decision_function(fresh)
    assert (expected >= alone - 1e-5).all()
    assert (expected > alone + 1e-3).any()


def test_nearest_of_each_representation_is_the_nearest_of_one_demonstration():
    demos, fresh = draw_shapes([1] * 6, seed=2, spread=0.6), draw_shapes([9] * 6, seed=2, spread=0.9)
    each, one = (Recognizer(classifier=name).fit(demos) for name in ("nearest-each", "nearest"))
    np.testing.assert_allclose(each.decision_function(fresh), one.decision_function(fresh), rtol=1e-12)


def test_svm_is_scikit_learns_on_the_precomputed_similarity():
    demos, fresh = draw_shapes([8] * 4, seed=2, spread=0.6), draw_shapes([9] * 4, seed=2, spread=0.9)
    recognizer = Recognizer(classifier="svm").fit(demos)
    wider = recognizer.comparison_.similarity.widened(2.0)
    own, gram = (
        np.exp(wider.log_average(recognizer.describe(one), recognizer.references_.described)) for one in (demos, fresh)
    )
    expected = SVC(kernel="precomputed", C=1000.0).fit(own, demos.labels).decision_function(gram)
    np.testing.assert_allclose(recognizer.decision_function(fresh), expected, atol=1e-5)


def test_prototype_is_the_demonstration_most_like_its_class():
    demos = draw_shapes([5, 3, 4], spread=0.5)
    recognizer = Recognizer(classifier="prototype").fit(demos)
    logs = recognizer.log_similarity(demos)
    for rows, medoid in zip((range(5), range(5, 8), range(8, 12)), recognizer.classifier_.medoids, strict=True):
        assert medoid == max(rows, key=lambda i, rows=rows: logs[i, list(rows)].mean())
    np.testing.assert_allclose(recognizer.decision_function(demos), logs[:, recognizer.classifier_.medoids], atol=1e-4)


@any_seed
@settings(max_examples=examples(8, 20))
def test_prototypes_are_the_same_compiled_and_plain_and_of_equal_ones_the_first(seed):
    counts = [2, 2, 3, 2, 4]
    demos = draw_shapes(counts, seed=seed, spread=0.5)
    medoids = {}
    for choice in ("always", "never"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("KINEME_COMPILED", choice)
            medoids[choice] = Recognizer(classifier="prototype").fit(demos).classifier_.medoids
    np.testing.assert_array_equal(medoids["always"], medoids["never"])
    np.testing.assert_array_equal(medoids["never"].take([0, 1, 3]), np.cumsum([0, *counts])[[0, 1, 3]])


@pytest.mark.parametrize("counts", [[1, 1], [8, 9], [30, 30]])
def test_auto_takes_the_nearest_of_each_representation(counts):
    assert type(Recognizer().fit(draw_shapes(counts)).classifier_).__name__ == "NearestEach"


@pytest.mark.parametrize("classifier", ["nearest", "nearest-each", "prototype", "svm"])
def test_tiles_give_what_one_block_gives(classifier, monkeypatch):
    demos = draw_shapes([3] * 3)
    recognizer = Recognizer(classifier=classifier).fit(demos)
    whole, p = recognizer.decision_function(demos), recognizer.p_values(demos)
    labels = [one.label for one in recognizer.recognize(demos)]
    monkeypatch.setattr(module, "_TILE_PAIRS", 20)
    np.testing.assert_allclose(recognizer.decision_function(demos), whole, atol=1e-3)
    np.testing.assert_allclose(recognizer.p_values(demos), p, atol=1e-3)
    assert [one.label for one in recognizer.recognize(demos)] == labels


@pytest.mark.parametrize("classifier", ["nearest", "nearest-each", "prototype", "svm"])
@pytest.mark.parametrize("n_classes", [2, 4])
def test_probabilities_sum_to_one_and_agree_with_the_label(classifier, n_classes):
    demos = draw_shapes([3] * n_classes)
    recognizer = Recognizer(classifier=classifier).fit(demos)
    shares = recognizer.predict_proba(demos)
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    np.testing.assert_array_equal(recognizer.classes_[shares.argmax(axis=1)], recognizer.predict(demos))


@pytest.mark.parametrize("classifier", ["nearest", "nearest-each"])
def test_probabilities_are_those_of_the_answers(classifier):
    demos, fresh = draw_shapes([3] * 4), draw_shapes([5] * 4, seed=1, spread=0.8)
    recognizer = Recognizer(classifier=classifier).fit(demos)
    answers = [list(one.probabilities.values()) for one in recognizer.recognize(fresh)]
    np.testing.assert_allclose(recognizer.predict_proba(fresh), answers, rtol=1e-9)


@pytest.mark.parametrize("pair", [(0.5, 1.5), (10**30, 1), (b"a", b"b"), (False, True), ("a", "b")])
def test_labels_of_any_kind_are_scored(pair):
    demos = draw_shapes([2, 2])
    labels = [pair[0]] * 2 + [pair[1]] * 2
    wrong = [pair[0]] * len(demos)
    recognizer = Recognizer(classifier="nearest").fit(demos, labels)
    assert (recognizer.score(demos, labels), recognizer.score(demos, wrong)) == (1.0, 0.5)
    assert recognizer.score(demos, wrong, sample_weight=[label == pair[0] for label in labels]) == 1.0
    with pytest.raises(TrajectoryError, match="expected labels as those of fit"):
        recognizer.score(demos, [1 if isinstance(pair[0], str) else "a"] * len(demos))


def test_it_is_a_scikit_learn_classifier():
    demos = draw_shapes([4] * 3)
    arrays = np.array([one.positions for one in demos])
    recognizer = Recognizer(mean="geometric", max_angle=0.2)
    assert clone(recognizer).get_params() == recognizer.get_params()
    assert cross_val_score(recognizer, arrays, demos.labels, cv=2).mean() == 1
    search = GridSearchCV(Recognizer(), {"mean": ["arithmetic", "min"], "scale": ["path", "none"]}, cv=2)
    assert search.fit(arrays, demos.labels).best_score_ == 1


@pytest.mark.parametrize("shapes", [PAPER_LETTERS, None], ids=["nine letters", "LASA-26"])
def test_one_shot_with_everything_perturbed(shapes):
    demos = kineme.load_lasa(shapes)
    everything = Perturbation(shift=1, scale=1, rotation=np.deg2rad(20), warp=0.35, noise=0.01)
    for draw in range(2):
        moved = everything.apply(demos, draw)
        train = np.arange(len(demos)) % 7 == draw
        assert Recognizer().fit(moved[train]).score(moved[~train], demos.labels[~train]) >= 0.99


def test_one_class_only_says_members_from_strangers():
    demos = draw_shapes([6])
    recognizer = Recognizer().fit(demos)
    assert recognizer.recognize(demos[2]).label == "kind 00"
    assert set(recognizer.predict(draw_shapes([1, 1], seed=5))) == {"kind 00"}


@pytest.mark.parametrize("classifier", ["auto", "nearest", "prototype"])
def test_one_movement_alone_gives_answers_that_are_marked_as_a_guess(classifier):
    demos = kineme.load_lasa(["CShape", "Sine", "WShape"])
    recognizer = Recognizer(classifier=classifier, weights="fitted").fit(demos[:1])
    answers = recognizer.recognize(demos[1:])
    labels = [one.label for one in answers]
    assert labels == ["CShape"] * 6 + [None] * 14
    assert all(one.rule == "guess" and not one.calibrated for one in answers)
    state = recognizer.stream().update(demos[1].times, demos[1].positions)
    assert state.ranked[0].label == "CShape"


def test_one_shape_alone_is_known_and_most_others_are_not():
    """Of LASA's 26 shapes a Z is among those that are taken for a C."""
    demos = kineme.load_lasa()
    known = np.array([Recognizer().fit(demos[7 * c : 7 * c + 1]).p_values(demos)[:, 0] > 0.05 for c in range(26)])
    own = np.asarray(demos.labels)[::7, None] == np.asarray(demos.labels)
    assert known[own].all()
    assert known[~own].mean() <= 0.2


@pytest.mark.parametrize("n_moving", [0, 1, 3])
def test_a_movement_at_rest_is_refused_as_by_a_library(n_moving, tmp_path):
    arrays = [demo.positions for demo in draw_shapes([1] * n_moving)] if n_moving else []
    arrays, labels = [*arrays, np.ones((20, 2))], [*"abc"[:n_moving], "z"]
    words = rf"trajectory {n_moving}: expected a movement, got 20 samples at the same place \(1 of {n_moving + 1} "
    with pytest.raises(TrajectoryError, match=words):
        Recognizer().fit(arrays, labels)
    with ActionLibrary(tmp_path / "actions", create=True) as library, pytest.raises(TrajectoryError, match=words):
        library.learn(arrays, labels)


def test_demonstrations_have_the_labels_that_they_were_fitted_with():
    demos = draw_shapes([1, 1, 1])
    recognizer = Recognizer().fit(demos, ["c", "a", "b"])
    assert list(recognizer.demonstrations_.labels) == ["a", "b", "c"]
    np.testing.assert_array_equal(recognizer.demonstrations_[0].positions, demos[1].positions)


def test_classes_of_unequal_size():
    demos = draw_shapes([1, 12, 3])
    assert Recognizer().fit(demos).score(demos, demos.labels) == 1


@pytest.mark.parametrize("ask", ["predict", "recognize", "p_values", "log_similarity"])
def test_movements_of_another_dimension(ask):
    with pytest.raises(TrajectoryError, match="movements of 2 dimensions as learned, got 3"):
        getattr(Recognizer().fit(draw_shapes([1, 1])), ask)(draw_shapes([1, 1], 3))


@pytest.mark.parametrize("ask", ["predict", "recognize"])
def test_a_query_of_three_samples(ask):
    with pytest.raises(TrajectoryError, match="at least 4 samples, got 3"):
        getattr(Recognizer().fit(draw_shapes([1, 1])), ask)([np.ones((3, 2))])


@pytest.mark.parametrize("counts", [[1, 1, 1], [4] * 6])
def test_a_still_query_has_an_answer_without_infinities(counts):
    answer = Recognizer().fit(draw_shapes(counts)).recognize(np.ones((50, 2)))
    assert answer.label is None
    assert np.isfinite(answer.transform.matrix).all()
    assert np.isfinite(list(answer.p_values.values())).all()


@pytest.mark.parametrize("label", ["", "  ", None])
def test_a_label_that_says_nothing(label):
    demos = draw_shapes([1, 1, 1])
    with pytest.raises(TrajectoryError, match=rf"trajectory 1 \('no 1'\).*text or a number, got {label!r}"):
        Recognizer().fit(demos, np.array(["a", label, "c"], dtype=object))


def test_labels_that_are_missing_or_too_few():
    demos = draw_shapes([1, 1, 1])
    with pytest.raises(TrajectoryError, match=r"one label for each of the 3 movements, got labels of shape \(2,\)"):
        Recognizer().fit(demos, ["a", "b"])
    with pytest.raises(TrajectoryError, match="expected labeled demonstrations, got none"):
        Recognizer().fit(Demonstrations.from_arrays([one.positions for one in demos]))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"mean": "median"}, "mean to be one of .*'arithmetic'.*got 'median'"),
        ({"max_angle": 0.5, "rotation_prior": RotationPrior(vertical=(0, 0, 1))}, "max_angle or rotation_prior, got"),
        ({"max_angle": 0.0, "rotation_prior": RotationPrior(0.3)}, "max_angle=0.0 and RotationPrior.*leave one out"),
        ({"classifier": "forest"}, "classifier to be one of .*'auto'.*got 'forest'"),
        ({"scale": "area"}, "scale to be one of .*'path'.*got 'area'"),
        ({"cutoff": 0.0}, "cutoff to be a number above 0, got 0.0"),
        ({"max_angle": 4.0}, "max_angle of at most pi, got 4.0"),
    ],
)
def test_parameters_out_of_range(wrong, words):
    with pytest.raises(SpecificationError, match=words):
        Recognizer(**wrong).fit(draw_shapes([1, 1]))


@planes
@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@any_seed
def test_the_phase_increases_through_pauses_whatever_the_direction(d, share, seed):
    x = draw_shapes([1], d, seed)[0].positions
    paused = np.concatenate((x[:30], np.repeat(x[30:31], 40, axis=0), x[30:])).T[None]
    phase = arc_length_phase(paused, share)
    assert (np.diff(phase) > 0).all()
    np.testing.assert_allclose(phase[:, [0, -1]], [[0, 1]], atol=1e-12)
    np.testing.assert_allclose(arc_length_phase(turn(0.7, d, seed) @ paused, share), phase, atol=1e-12)
    ends = [arc_length_phase(paused, one) for one in (0.0, 1.0)]
    np.testing.assert_allclose(phase, (1 - share) * ends[0] + share * ends[1], atol=1e-12)
    assert phase[0, 69] - phase[0, 30] == pytest.approx((1 - 0.999 * share) * 39 / 119, abs=1e-9)
