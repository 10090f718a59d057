"""The full answer: label, p-values, neighbors, the transform and the share of each representation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import Demonstrations, Recognizer, Trajectory
from kineme.recognition import Representation
from kineme.recognition.conformal import RULES
from kineme.similarity.specification import LOG_MEANS
from movement_samples import draw_shapes, turn

any_seed = given(seed=st.integers(0, 10**6))


@pytest.mark.parametrize("d", [2, 3])
@any_seed
def test_the_transform_is_found_again(d, seed):
    rng = np.random.default_rng(seed)
    demos = draw_shapes([2] * 5, d, seed)
    R, scale, shift = turn(rng.uniform(-0.6, 0.6), d, seed), rng.uniform(0.3, 3), rng.normal(size=d) * 5
    i = int(rng.integers(10))
    moved = Trajectory(3.0 * demos[i].times + 7, scale * demos[i].positions @ R.T + shift)
    recognizer = Recognizer().fit(demos)
    answer = recognizer.recognize(moved)
    assert answer.nearest[0].index == i
    assert answer.nearest[0].name == f"no {i}"
    assert 0.4 < answer.nearest[0].similarity <= 1  # a rotation costs, above all what is compared in detail
    unturned = recognizer.recognize(scale * demos[i].positions + shift)
    assert unturned.nearest[0].similarity == pytest.approx(1, abs=1e-3)
    free = Recognizer(max_angle=np.pi).fit(demos).recognize(moved)
    assert (free.nearest[0].index, free.nearest[0].similarity) == (i, pytest.approx(1, abs=2e-3))
    np.testing.assert_allclose(answer.transform.rotation, R, atol=1e-6)
    np.testing.assert_allclose(answer.transform.scale, scale, rtol=1e-6)
    np.testing.assert_allclose(answer.transform.shift, shift, atol=1e-5)
    np.testing.assert_allclose(answer.transform.apply(demos[i].positions), moved.positions, atol=1e-5)
    assert answer.transform.duration_ratio == pytest.approx(3)


def test_the_angle_has_a_sign_in_the_plane_and_none_in_space():
    for d, angle, expected in [(2, 0.4, 0.4), (2, -0.4, -0.4), (3, -0.4, 0.4)]:
        demos = draw_shapes([1] * 4, d)
        moved = demos[2].positions @ turn(angle, d).T
        assert Recognizer().fit(demos).recognize(moved).transform.angle == pytest.approx(expected, abs=1e-6)


def test_sizes_per_dimension():
    demos = draw_shapes([1] * 4)
    recognizer = Recognizer(scale="per-dimension", max_angle=0).fit(demos)
    transform = recognizer.recognize(demos[1].positions * [2.0, 0.5] + [1.0, 3.0]).transform
    np.testing.assert_allclose(transform.scale, [2.0, 0.5], rtol=0.05)
    assert transform.angle == 0


def test_what_is_not_taken_out_is_not_in_the_transform():
    demos = draw_shapes([1] * 4)
    transform = Recognizer(scale="none", translation=False, max_angle=0).fit(demos).recognize(demos[1]).transform
    np.testing.assert_array_equal(transform.matrix, np.eye(2))
    np.testing.assert_array_equal(transform.shift, 0)


@pytest.mark.parametrize("classifier", ["nearest", "nearest-each", "prototype", "svm"])
def test_many_at_once_are_each_alone(classifier):
    shapes = draw_shapes([4] * 5, seed=4)
    lasting = [np.linspace(0.0, 1.0 + 0.1 * i, len(one)) for i, one in enumerate(shapes)]
    demos = Demonstrations.from_arrays([one.positions for one in shapes], shapes.labels, lasting)
    recognizer = Recognizer(classifier=classifier).fit(demos)
    fresh = draw_shapes([2] * 5, seed=4, spread=0.2)
    answers = recognizer.recognize(fresh)
    assert [one.label for one in answers] == recognizer.predict_known(fresh).tolist()
    for movement, answer in zip(fresh, answers, strict=True):
        alone = recognizer.recognize(movement)
        assert (alone.label, alone.ranked) == (answer.label, answer.ranked)
        np.testing.assert_allclose(list(alone.p_values.values()), list(answer.p_values.values()))
        np.testing.assert_allclose(alone.transform.matrix, answer.transform.matrix, atol=1e-5)
        assert alone.confidence == pytest.approx(answer.confidence)
        example = recognizer.demonstrations_[answer.nearest[0].index]
        assert answer.transform.duration_ratio == pytest.approx(movement.duration / example.duration)


def test_one_movement_in_a_list_is_a_list():
    demos = draw_shapes([2, 2])
    recognizer = Recognizer().fit(demos)
    assert len(recognizer.recognize([demos[0]])) == 1
    assert recognizer.recognize(demos[0].positions).label == "kind 00"


def test_a_stranger_is_unknown_and_the_answer_says_what_it_is_most_like():
    demos = draw_shapes([4] * 6)
    u = np.linspace(0, 1, 90)
    answer = Recognizer().fit(demos).recognize(np.column_stack((np.sin(40 * u), np.cos(31 * u))))
    assert answer.label is None
    assert answer.confidence == pytest.approx(1 - answer.p_known, abs=1e-4)
    assert answer.p_known <= 0.05
    assert {demos.labels[near.index] for near in answer.nearest} == {answer.ranked[0]}
    assert "label=None" in repr(answer)


@pytest.mark.parametrize("classifier", ["nearest", "auto"])
@any_seed
def test_confidence_is_the_share_of_the_class_by_distances_to_the_power_fitted(seed, classifier):
    demos, asked = draw_shapes([4] * 6, seed=seed), draw_shapes([1] * 6, seed=seed, spread=0.4)[2]
    recognizer = Recognizer(classifier=classifier).fit(demos)
    answer = recognizer.recognize(asked, error_rate=0.04)
    shares = np.sqrt(-2 * recognizer.decision_function([asked])[0]) ** -recognizer.calibration().exponent
    if answer.label is not None:
        expected = shares[list(answer.p_values).index(answer.label)] / shares.sum()
        assert answer.confidence == pytest.approx(expected, abs=1.1e-4)
    own = recognizer.recognize(demos[9])
    assert (own.label, own.confidence) == ("kind 02", 1.0)
    assert [demos.labels[near.index] for near in own.nearest] == ["kind 02"] * 3
    assert np.all(np.diff([near.similarity for near in own.nearest]) <= 0)
    assert set(own.ranked) == set(own.p_values) == set(np.unique(demos.labels))


def test_an_answer_says_its_rule_and_what_it_promises():
    demos = draw_shapes([25, 25, 4])
    recognizer = Recognizer().fit(demos)
    answers = recognizer.recognize([demos[0], demos[30], demos[51]])
    assert [one.rule for one in answers] == ["class", "class", "pooled"]
    once = Recognizer().fit(draw_shapes([1] * 25)).recognize(demos[0])
    assert once.rule == "guess"
    strange = recognizer.recognize(draw_shapes([25, 25, 4], spread=0.4)[28])  # near one class, novel to all
    assert (strange.rule, strange.certainty) == ("strangers", "looks like")
    assert {RULES[one.rule] for one in [*answers, once, strange]} == set(RULES.values())
    of_one = Recognizer().fit(draw_shapes([25, 25, 1])).recognize(draw_shapes([25, 25, 2])[50])
    assert (of_one.rule, of_one.calibrated) == ("pooled", True)  # by the others: its class has no scores
    assert "classes with two or more demonstrations together" in of_one.promise
    for one in [*answers, once, strange]:
        assert one.promise == RULES[one.rule]
        assert f"rule={one.rule!r}" in repr(one)
        assert one.promise.count(".") == 1  # one sentence


@pytest.mark.parametrize("mean", LOG_MEANS)
def test_shares_of_the_representations_sum_to_one(mean):
    demos = draw_shapes([2] * 4)
    answer = Recognizer(mean=mean).fit(demos).recognize(draw_shapes([1] * 4, spread=0.3)[1])
    assert sum(answer.responsibilities.values()) == pytest.approx(1)
    assert len(answer.responsibilities) == 7


def test_with_uneven_timing_arc_length_speaks():
    demos = draw_shapes([1] * 6)
    late = np.linspace(0, 1, 80) ** 2.2
    spoke = Recognizer().fit(demos).recognize(Trajectory(late, demos[3].positions)).responsibilities
    assert spoke["forcing over time"] < 0.01


def test_labels_that_are_numbers_stay_numbers():
    demos = draw_shapes([2, 2, 2])
    answer = Recognizer().fit(demos, np.repeat([3, 5, 8], 2)).recognize(Demonstrations.of(demos[2:3]))[0]
    assert answer.label == 5
    assert isinstance(answer.label, int)


def test_representations_of_one_name_share_their_responsibility():
    one = (Representation("positions", n_points=50), Representation("positions", weight=2.0))
    demos = draw_shapes([2] * 4)
    recognizer = Recognizer(one).fit(demos)
    answer = recognizer.recognize(demos)[0]
    assert answer.responsibilities == pytest.approx({"positions over arc length": 1.0})
    assert answer.transform.scale == pytest.approx(1.0)
