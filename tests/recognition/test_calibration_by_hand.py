"""The numbers of the calibration, written a second time from what its pages say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi

import kineme
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.recognition.conformal import (
    GUESSES,
    RULES,
    Calibration,
    ClassDistances,
    between_classes,
    broad_law,
    calibrate,
    class_probabilities,
    comparable_groups,
    distances,
    fit_exponent,
    law,
    least_scale,
    reaching,
    score_classes,
    typical_distance,
    typical_scale,
)
from kineme.similarity.comparison import References
from kineme.similarity.describe import Described
from kineme.similarity.similarity import AveragedSimilarity
from movement_samples import draw_shapes

NONE = np.inf


def test_odds_are_ratios_of_distances_to_the_power_of_the_exponent_down_to_the_least():
    away = np.array([[0.01, 0.011], [1.0, 1.2], [0.001, 0.004]])
    odds = class_probabilities(-0.5 * away**2, 7.0)
    np.testing.assert_allclose(odds[:2, 0] / odds[:2, 1], [1.1**7, 1.2**7])
    np.testing.assert_allclose(odds[2], 0.5)


def test_distances_are_those_of_gaussians_and_copies_have_none():
    np.testing.assert_allclose(distances(np.array([-2.0, -1e-4, -5e-6, 0.0])), [2.0, np.sqrt(2e-4), 0.0, 0.0])


def test_the_laws_are_those_of_normal_vectors():
    scores = np.linspace(0, 3, 13)
    np.testing.assert_allclose(law(scores), chi(8).sf(scores * chi(8).mean()), atol=1e-12)
    np.testing.assert_allclose(broad_law(scores), chi(2).sf(scores * chi(2).mean()), atol=1e-12)
    assert broad_law(np.array(3.0 / reaching(3.0))) == pytest.approx(0.05)


def test_classes_shown_once_reach_three_quarters_of_the_way_to_the_next_and_those_of_several_people_all_of_it():
    impostors = np.array([2.0, 4.0, 9.0, NONE])
    assert typical_distance(impostors) == 4.0
    assert broad_law(np.array(3.0 / typical_scale(impostors))) == pytest.approx(0.05)
    assert broad_law(np.array(4.0 / typical_scale(impostors, np.arange(4)))) == pytest.approx(0.05)
    assert typical_distance(np.array([NONE])) == 3.5
    assert least_scale(np.array([2.0, 4.0, 30.0, NONE])) == pytest.approx(0.4)
    assert least_scale(np.array([NONE])) == 0.0


def test_scales_and_scores_are_left_out_means_shrunk_towards_that_of_all():
    away = np.array([[NONE, 1.0, 2.0], [1.0, NONE, 4.0], [2.0, 4.0, NONE]])
    single = ClassDistances(np.array([[NONE]]), np.array([0]))
    scored = score_classes([ClassDistances(away, np.arange(3)), single], 2, 9.0)
    nearest = np.array([1.0, 1.0, 2.0])
    common = nearest.mean()
    without = [4.0 + 4.0, 2.0 + 2.0, 1.0 + 1.0]  # of the two others, as if the first, the second, the third were not
    np.testing.assert_allclose(scored.scales, [(nearest.sum() + 4 * common) / 7, common])
    np.testing.assert_allclose(scored.scores[0], nearest / [(total + 4 * common) / 6 for total in without])
    assert np.isinf(scored.scores[1]).all()
    np.testing.assert_allclose(scored.shares[0], 1.0)
    np.testing.assert_allclose(scored.shares[1], 0.5 ** (1 / 8))
    np.testing.assert_allclose(score_classes([single, single], 1, 9.0).scales, 9.0)


def test_a_demonstration_counts_as_near_as_it_would_be_with_as_many_others_as_there_are():
    points = np.random.default_rng(0).normal(size=(8, 2)) + np.repeat([[0.0, 0.0], [3.0, 0.0]], 4, axis=0)
    labels, same = np.repeat([0, 1], 4), Procrustes(1, 0.0)
    described = Described((Prepared(points, (points**2).sum(axis=1)),), same)
    references = References.of(draw_shapes([1]), described, labels)
    found = calibrate(AveragedSimilarity(same, np.ones(1)), references)
    away = np.linalg.norm(points[:, None] - points, axis=2)
    np.fill_diagonal(away, NONE)
    blocks = [ClassDistances(away[rows, rows], np.arange(4)) for rows in (slice(0, 4), slice(4, 8))]
    nearer = (3 / 4) ** (1 / 8)
    scores = np.concatenate(score_classes(blocks, 4, 1.0).scores)
    to_own, to_others = (np.where((labels[:, None] == labels) == own, away, NONE).min(axis=1) for own in (True, False))
    novelties = np.minimum(nearer * scores, to_others / found.scales[1 - labels])
    np.testing.assert_allclose(np.sort(found.pooled_novelties[0]), np.sort(novelties), rtol=1e-5)
    both = np.where(labels[:, None] == [0, 1], nearer * to_own[:, None], to_others[:, None])
    assert found.exponent == pytest.approx(fit_exponent(both, labels), rel=1e-3)
    assert found.between == pytest.approx(np.median(to_others), rel=1e-5)


def test_a_demonstration_is_left_out_with_all_of_its_group():
    away = np.array([[NONE, NONE, 1.0, 3.0], [NONE, NONE, 2.0, 4.0], [1.0, 2.0, NONE, 5.0], [3.0, 4.0, 5.0, NONE]])
    groups = np.array([0, 0, 1, 2])
    expected = np.array([[np.nan, np.nan, 5.0, 5.0]] * 2 + [[3.0, 4.0, np.nan, 3.0], [1.0, 2.0, 1.0, np.nan]])
    np.testing.assert_array_equal(ClassDistances(away, np.arange(4), groups).left_out(4), expected)
    assert comparable_groups(np.array([3, 3])) is None
    assert comparable_groups(groups) is groups


def test_movements_by_strangers_are_known_up_to_two_thirds_of_the_way_to_the_next_class():
    few = (np.array([0.1]),) * 2
    calibration = Calibration(np.full(2, 0.1), few, few, few, few, between=2.0)
    away = np.array([[1.0, 9.0], [1.8, 9.0], [1.0, 1.5], [1.5, 1.2]])
    reach = np.array([1.8, 1.8, 1.0, 1.0])
    p = calibration.known_p_values(-0.5 * away**2, 0.05)
    np.testing.assert_allclose(p, 0.05 ** ((away.min(axis=1) / reach) ** 2), rtol=1e-9)
    assert p[1:3] == pytest.approx(0.05)
    assert (calibration.of_those_shown().known_p_values(-0.5 * away**2, 0.05) < 1e-9).all()
    shown = [ClassDistances(np.array([[NONE, 1.0], [1.0, NONE]]), np.arange(2))]
    single = [ClassDistances(np.array([[NONE]]), np.arange(1))]
    impostors = np.array([1.0, 2.0, 6.0])
    assert between_classes(impostors, shown, None) == 2.0
    assert between_classes(impostors, shown, np.array([0, 1])) == between_classes(impostors, single, None) == 0.0


def test_scores_count_where_they_suffice_and_each_is_one_of_them():
    own, pooled = np.arange(1.0, 20.0), np.arange(1.0, 40.0)
    calibration = Calibration(np.ones(2), (own, own[:18]), (pooled,) * 2, (own, own[:18]), (pooled,) * 2)
    p = calibration.p_values(-0.5 * np.array([[19.0, 19.0], [19.5, 39.0], [0.5, 0.5]]) ** 2, 0.05)
    np.testing.assert_allclose(p, [[2 / 20, 22 / 40], [1 / 20, 2 / 40], [1.0, 1.0]])
    assert calibration.calibrated(0.05).all()
    assert not calibration.calibrated(0.02).any()


def test_answers_that_promise_nothing_say_so():
    assert {rule for rule, promise in RULES.items() if "a guess" in promise or "any share" in promise} == {*GUESSES}


def test_a_p_value_of_the_error_rate_itself_is_unknown_in_every_answer_and_odds_are_of_the_fitted_power():
    demos = draw_shapes([19, 19], seed=3)
    recognizer = kineme.Recognizer().fit(demos)
    far = draw_shapes([1] * 9, seed=40)[8:]
    (answer,) = recognizer.recognize(far)
    assert (answer.p_known, answer.label, recognizer.predict_known(far)[0]) == (0.05, None, None)
    odds = []
    for exponent in (3.0, 30.0):
        recognizer._calibration = replace(recognizer.calibration(), exponent=exponent)
        (answer,) = recognizer.recognize(far)
        first, second = answer.probabilities.values()
        odds.append(np.log(first / second))
        np.testing.assert_allclose(recognizer.predict_proba(far)[0], [first, second])
    assert odds[1] == pytest.approx(10 * odds[0])
    assert odds[0] != 0.0


def test_a_raised_scale_makes_novelties_ordinary():
    few = np.array([0.5, 3.0])
    raised = Calibration(np.array([1.0, 2.0]), (few,) * 2, (few,) * 2, (few,) * 2, (few,) * 2).with_least_scales(
        np.array([1.5, 1.5])
    )
    np.testing.assert_array_equal(raised.scales, [1.5, 2.0])
    np.testing.assert_array_equal(raised.own_novelties, [[1.0, 3.0], [0.5, 3.0]])
    np.testing.assert_array_equal(raised.own, [few, few])


@pytest.mark.parametrize("n", [1, 5, 60])
def test_the_exponent_is_the_most_likely_one_by_its_prior(n):
    rng = np.random.default_rng(n)
    away, classes = rng.uniform(1.0, 1.4, (n, 3)), rng.integers(3, size=n)

    def loss(exponent):
        shares = class_probabilities(-0.5 * away**2, exponent)[np.arange(n), classes]
        return (np.log(exponent / 15.0) / 0.35) ** 2 / 2 - np.log(shares).sum()

    exponents = np.exp(np.linspace(np.log(2.0), np.log(60.0), 1000))
    assert fit_exponent(away, classes) == pytest.approx(exponents[np.argmin([loss(m) for m in exponents])], rel=5e-3)


def test_the_exponent_stays_within_bounds():
    sure = np.full((1000, 2), [1.0, 1.03])
    assert fit_exponent(sure, np.arange(1000) % 100 // 99) == pytest.approx(60.0, rel=1e-2)  # 155 were most likely
    assert fit_exponent(sure**20, np.arange(1000) % 2) == pytest.approx(2.0, rel=1e-2)  # 0 were
