"""Random convolutions: features, the classifier on them, and when it joins without being asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from sklearn.linear_model import Ridge, RidgeCV

import kineme
from kineme.errors import SpecificationError
from kineme.recognition.classifiers import VALUED, LogarithmicPool, NearestEach, NearestProfiled, _profiles
from kineme.recognition.conformal import class_probabilities, distances, fit_exponent
from kineme.recognition.convolutions import (
    _ALPHAS,
    Convolutions,
    _weights,
    fit_kernels,
    left_out_values,
    series_of,
    transform,
)
from kineme.similarity.scores import Compared
from kineme.similarity.specification import ROW_REPRESENTATIONS
from kineme.studio.snapshot import snapshot_of_recognizer


def draw_trembles(each, seed, n_classes=3):
    """A path drawn at random each time, with a tremble at a random place whose frequency tells the class."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, 150)
    arrays, labels = [], []
    for label in range(n_classes):
        for _ in range(each):
            waves = rng.normal(size=(3, 2)) / np.arange(1, 4)[:, None]
            path = np.sin(np.pi * np.arange(1, 4) * u[:, None]) @ waves + u[:, None] * rng.normal(size=2)
            place = np.exp(-0.5 * ((u - rng.uniform(0.3, 0.7)) / 0.12) ** 2)
            tremble = 0.2 * place * np.sin(2 * np.pi * (4, 9, 16)[label] * u + rng.uniform(0, 6))
            arrays.append(path + tremble[:, None] * [1.0, -1.0])
            labels.append(str(label))
    return kineme.Demonstrations.from_arrays(arrays, labels)


def test_kernels_do_not_see_a_constant_and_are_all_different():
    weights = _weights()
    assert weights.shape == (84, 9)
    np.testing.assert_array_equal(weights.sum(axis=1), 0)
    assert len({tuple(row) for row in weights.tolist()}) == 84


def test_features_are_shares_and_those_of_each_movement_alone():
    series = np.random.default_rng(0).normal(size=(130, 4, 66)).astype(np.float32)
    kernels = fit_kernels(series)
    features = transform(series, kernels)
    assert features.shape[1] >= 1000
    assert features.min() >= 0
    assert features.max() <= 1
    for i in (0, 63, 64, 129):
        np.testing.assert_allclose(transform(series[i : i + 1], kernels)[0], features[i], atol=1e-6)


def test_dilations_are_those_of_the_paper_most_of_them_narrow():
    series = np.random.default_rng(0).normal(size=(40, 4, 66)).astype(np.float32)
    kernels = fit_kernels(series)
    # floor(2^e), e evenly from 0 to log2 of the largest that fits; signs of a language by others, ten of each, were
    # recognized in 0.974, with as many thresholds for each dilation, and are in 0.986.
    dilations, counts = np.unique(np.floor(2 ** np.linspace(0, np.log2(65 / 8), 23)), return_counts=True)
    assert kernels.dilations == tuple(dilations)
    assert [thresholds.shape for thresholds in kernels.thresholds] == [(84, count) for count in counts]
    assert counts[0] == max(counts) == 8


def test_order_and_names_of_demonstrations_change_nothing():
    shown, fresh = draw_trembles(8, seed=9), draw_trembles(4, seed=10)
    order = np.random.default_rng(0).permutation(len(shown))
    names = {"0": "z", "1": "y", "2": "x"}
    recognizer, other = (kineme.Recognizer(classifier="convolutions") for _ in range(2))
    recognizer.fit(shown)
    other.fit(shown[order], [names[label] for label in shown[order].labels])
    scores, others = recognizer.decision_function(fresh), other.decision_function(fresh)
    np.testing.assert_allclose(others[:, ::-1], scores, atol=1e-6)


def test_values_left_out_are_those_of_a_fit_without_the_row():
    """The errors that are kept have lost their signs: one that overshoots its class must not count against it."""
    rng = np.random.default_rng(0)
    owners = np.repeat(np.arange(3), 8)
    X = np.eye(3)[owners] @ rng.normal(size=(3, 40)) + 0.7 * rng.normal(size=(24, 40))
    targets = np.where(owners[:, None] == np.arange(3), 1.0, -1.0)
    model = RidgeCV(_ALPHAS, store_cv_results=True).fit(X, targets)
    found = left_out_values(model, X, targets)
    assert ((np.abs(found) > 1) & (np.sign(found) == targets)).any()
    for i in range(24):
        others = np.arange(24) != i
        alone = Ridge(model.alpha_).fit(X[others], targets[others]).predict(X[i : i + 1])[0]
        np.testing.assert_allclose(found[i], alone, atol=1e-6)


def test_they_join_where_they_recognize_more_of_what_is_left_out():
    """The place of a tremble says nothing and its frequency all: no path is near another of its class."""
    shown, fresh = draw_trembles(16, seed=1), draw_trembles(20, seed=2)
    recognizer = kineme.Recognizer().fit(shown)
    assert isinstance(recognizer.classifier_, LogarithmicPool)
    assert recognizer.classifier_.share == 0.5  # they recognize clearly more
    labels = np.asarray(fresh.labels)
    kernels = kineme.Recognizer(classifier="nearest-each").fit(shown)
    assert recognizer.score(fresh) >= kernels.score(fresh) + 0.1
    shares = recognizer.predict_proba(fresh)
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    np.testing.assert_array_equal(recognizer.classes_[shares.argmax(axis=1)], recognizer.predict(fresh))
    answers = recognizer.recognize(fresh)
    assert [answer.ranked[0] for answer in answers] == recognizer.predict(fresh).tolist()
    assert answers[0].probabilities[answers[0].ranked[0]] == pytest.approx(shares[0].max())
    assert (recognizer.predict(fresh) == labels).mean() == recognizer.score(fresh)


def test_kernels_tell_what_is_known_and_convolutions_name_it():
    """The best-ranked class is the label, also where the kernels find another one alone possible."""
    shown, fresh = draw_trembles(16, seed=1), draw_trembles(20, seed=2)
    recognizer = kineme.Recognizer().fit(shown)
    answers, predicted = recognizer.recognize(fresh, 0.3), recognizer.predict(fresh)
    labels = [label if answer.p_known > 0.3 else None for label, answer in zip(predicted, answers, strict=True)]
    assert [answer.label for answer in answers] == labels
    assert recognizer.predict_known(fresh, 0.3).tolist() == labels
    named = [answer for answer in answers if answer.label is not None]
    assert any(answer.p_values[answer.label] <= 0.3 < max(answer.p_values.values()) for answer in named)
    assert min(answer.confidence for answer in named) > 1 / 3
    assigned = kineme.anchoring.assign(fresh, recognizer, 0.3).labels
    assert all(label in {None, best} for label, best in zip(assigned, predicted, strict=True))


def test_an_explanation_says_that_the_kernels_chose_its_examples():
    recognizer = kineme.Recognizer().fit(draw_trembles(16, seed=1))
    explained = recognizer.recognize(draw_trembles(3, seed=5))[4].explain()
    assert explained.by_convolutions
    assert "(ranked with random convolutions; example and shares are those of the kernels)" in explained.in_words
    assert "random convolutions" in explained.plot().get_suptitle()
    assert len(repr(explained)) < 300
    assert repr(recognizer.classifier_).startswith(
        "LogarithmicPool(nearest=NearestEach(), convolutions=Convolutions(sharpness="
    )
    assert len(repr(recognizer.classifier_)) < 200


def test_with_one_demonstration_or_where_kernels_suffice_they_do_not():
    assert isinstance(kineme.Recognizer().fit(draw_trembles(1, seed=3)).classifier_, NearestEach)
    assert isinstance(kineme.Recognizer().fit(draw_trembles(2, seed=3)).classifier_, LogarithmicPool)
    assert isinstance(kineme.Recognizer().fit(draw_trembles(2, seed=3)[1:]).classifier_, NearestEach)
    demos = kineme.load_lasa(["CShape", "NShape"])
    twice = kineme.Demonstrations.from_arrays(
        [demo.positions for demo in demos] + [1.1 * demo.positions for demo in demos], [*demos.labels, *demos.labels]
    )
    assert isinstance(kineme.Recognizer().fit(twice).classifier_, NearestEach)


def test_points_that_turn_together_have_them_also_where_kernels_suffice():
    """Two hands: of other people, a pool recognizes more than the kernels, which recognize all that is left out."""
    shown, asked = (draw_paths(each, each, noise=0.05, n_classes=3) for each in (8, 4))
    hands, others = (
        kineme.Demonstrations.from_arrays([np.hstack((one.positions, -one.positions)) for one in demos], demos.labels)
        for demos in (shown, asked)
    )
    assert isinstance(kineme.Recognizer().fit(hands).classifier_, NearestProfiled)
    recognizer = kineme.Recognizer(points=2).fit(hands)
    assert isinstance(recognizer.classifier_, LogarithmicPool)
    assert recognizer.score(others) == 1


@pytest.mark.parametrize("n_dims", [1, 3, 4])
def test_the_number_of_columns_does_not_matter(n_dims):
    """Of one column and of four nothing is rotated anyway; of three columns the details are not."""
    plane = draw_trembles(8, seed=7)
    columns = [[0], [0, 1, 0], [0, 1, 1, 0]][(1, 3, 4).index(n_dims)]
    demos = kineme.Demonstrations.from_arrays([demo.positions[:, columns] for demo in plane], plane.labels)
    assert isinstance(kineme.Recognizer().fit(demos).classifier_, LogarithmicPool)


def draw_paths(each, seed, noise=0.5, n_classes=6):
    """Paths of a class that vary about its own, too much to be always recognized."""
    rng, u = np.random.default_rng(seed), np.linspace(0, 1, 60)[:, None]
    waves = np.sin(np.pi * u * np.arange(1, 5))
    own = np.random.default_rng(2).normal(size=(n_classes, 4, 2))
    arrays = [waves @ (path + noise * rng.normal(size=path.shape)) for path in own for _ in range(each)]
    return kineme.Demonstrations.from_arrays(arrays, [str(k // each) for k in range(len(arrays))])


def test_the_pool_multiplies_powers_of_both_probabilities_where_the_kernels_are_not_sure():
    shown, asked = (draw_paths(each, each) for each in (10, 12))
    recognizer = kineme.Recognizer().fit(shown)
    pool = recognizer.classifier_
    assert pool.share == 0.25
    alone = kineme.Recognizer(classifier="nearest-each").fit(shown)
    p = class_probabilities(alone._scores(asked), pool.exponent)
    q = kineme.Recognizer(classifier="convolutions").fit(shown).predict_proba(asked)
    product = p**0.75 * q**0.25
    expected = np.where(p.max(axis=1, keepdims=True) > 0.99, p, product / product.sum(axis=1, keepdims=True))
    assert 10 < (p.max(axis=1) > 0.99).sum() < 62
    np.testing.assert_allclose(recognizer.predict_proba(asked), expected, atol=1e-6)
    one_by_one = np.concatenate([recognizer.predict_proba(asked[i : i + 1]) for i in range(0, len(asked), 7)])
    np.testing.assert_allclose(one_by_one, expected[::7], atol=1e-6)
    best = p[np.arange(72), np.searchsorted(alone.classes_, alone.predict(asked))]
    np.testing.assert_allclose(best, p.max(axis=1))


def test_the_exponent_of_the_pool_is_that_by_which_demonstrations_left_out_are_most_likely():
    """As `fit_exponent` finds it by fits without each demonstration."""
    shown = draw_paths(8, seed=3, noise=0.7, n_classes=3)
    recognizer = kineme.Recognizer().fit(shown)
    comparison, references = recognizer.comparison_, recognizer.references_
    logs = comparison.similarity.logs(references.described, references.described)
    logs[:, np.arange(24), np.arange(24)] = -np.inf
    nearest = np.stack([logs[:, :, 8 * c : 8 * c + 8].max(axis=2) for c in range(3)], axis=2)
    scores = np.log(np.exp(nearest).mean(axis=0))
    away, owners = distances(scores), np.repeat(np.arange(3), 8)
    away[np.arange(24), owners] *= (7 / 8) ** (1 / 8)
    expected = fit_exponent(away, owners)
    assert recognizer.classifier_.exponent == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("groups", [None, "who"])
def test_the_exponent_of_profiles_is_fitted_to_scores_with_profiles(groups):
    """Each demonstration is left out, or with all of its group."""
    shown = columns_of(draw_trembles(4, seed=3), 4)
    who = np.arange(12) // 2 if groups else None
    recognizer = kineme.Recognizer().fit(shown, groups=who)
    classifier = recognizer.classifier_.nearest
    kernels = kineme.Recognizer(classifier="nearest-each").fit(shown)
    away = np.empty((12, 3))
    for i in range(12):
        hidden = [i] if who is None else np.flatnonzero(who == who[i])
        logs = kernels.comparison_.similarity.logs(kernels.describe(shown[i : i + 1]), kernels.references_.described)
        logs[:, :, hidden] = -np.inf
        by_kernels = np.log(np.exp(logs.reshape(-1, 3, 4).max(axis=2)).mean(axis=0))
        cosines = classifier.profiles @ classifier.profiles[i]
        cosines[hidden] = -np.inf
        by_profiles = (cosines.reshape(3, 4).max(axis=1) - 1) / classifier.width**2
        squares = ((classifier.values.rows - classifier.values.rows[i]) ** 2).sum(axis=1)
        squares[hidden] = np.inf
        by_values = -squares.reshape(3, 4).min(axis=1) / (2 * classifier.values.width**2)
        score = 0.75 * np.exp(by_kernels) + 0.25 * np.exp(by_profiles)
        share = classifier.values.share
        away[i] = distances(np.log((1 - share) * score + share * np.exp(by_values)))
        away[i, i // 4] *= ((4 - len(hidden)) / 4) ** (1 / 8)
    expected = fit_exponent(away, np.repeat(np.arange(3), 4), 8.0)
    assert classifier.exponent == pytest.approx(expected, rel=1e-4)
    assert recognizer.classifier_.exponent == classifier.exponent
    once = kineme.Recognizer().fit(shown[::4])
    assert once.classifier_.exponent == 8.0
    expected = class_probabilities(once._scores(shown), 8.0)
    np.testing.assert_allclose(once.predict_proba(shown), expected)
    given = once.recognize(shown[1])
    np.testing.assert_allclose([given.probabilities[label] for label in once.classes_], expected[1], rtol=1e-5)


@pytest.mark.parametrize("n_dims", [1, 4])
def test_signals_are_known_by_profiles_and_values_too(n_dims):
    """All three kernels of each pair are averaged: of a movement and a demonstration, and of two demonstrations."""
    shown, asked = (columns_of(draw_trembles(4, seed=seed), n_dims) for seed in (3, 4))
    recognizer = kineme.Recognizer().fit(shown)
    classifier = recognizer.classifier_.nearest
    v = classifier.values

    def averaged(demos):
        described = recognizer.describe(demos)
        features = transform(series_of(described), classifier.kernels) - classifier.center
        profiles = features / np.linalg.norm(features, axis=1, keepdims=True)
        rows = (described.values - v.scale.center) / v.scale.spread * np.append(np.full(8, 8**-0.5), 1.0)
        squares = ((rows.reshape(len(demos), 1, -1) - v.rows) ** 2).sum(axis=2)
        shares = 0.75 * np.exp(recognizer.log_similarity(demos))
        shares += 0.25 * np.exp((profiles @ classifier.profiles.T - 1) / classifier.width**2)
        return distances(np.log((1 - v.share) * shares + v.share * np.exp(-0.5 * squares / v.width**2)))

    among = averaged(shown)
    np.fill_diagonal(among, np.inf)
    own = np.stack([among[4 * c : 4 * c + 4, 4 * c : 4 * c + 4].min(axis=1) for c in range(3)])
    scales = (own.sum(axis=1) + 4 * own.mean()) / 8
    calibration = recognizer.calibration()
    np.testing.assert_allclose(calibration.scales, scales, rtol=1e-4)
    novelty = (averaged(asked).reshape(12, 3, 4).min(axis=2) / scales).min(axis=1)
    np.testing.assert_allclose(recognizer.novelty(asked), novelty, rtol=1e-4)
    answers = recognizer.recognize(asked)
    known = calibration.known_p_values(recognizer._scores(asked, recognizer.classifier_.nearest_logs), 0.05)
    np.testing.assert_allclose([answer.p_known for answer in answers], known, atol=1e-6)
    assert (recognizer.predict_known(asked) == [answer.label for answer in answers]).all()
    compared, again = (
        Compared(recognizer.comparison_, recognizer.references_, recognizer.describe(asked)) for _ in range(2)
    )
    without = replace(classifier, values=None)
    assert not np.allclose(classifier.nearest_logs(compared), without.nearest_logs(compared))
    np.testing.assert_array_equal(without.nearest_logs(compared), without.nearest_logs(again))


def test_what_is_spotted_is_known_by_kernels_alone():
    """As of windows there are neither profiles nor values."""
    shown = columns_of(draw_trembles(4, seed=3), 1)
    by_all, by_kernels = (kineme.Recognizer(classifier=name).fit(shown) for name in ("auto", "nearest-each"))
    rest = np.zeros((40, 1))
    recording = np.vstack([part for demo in shown[::3] for part in (rest + demo.positions[0], demo.positions)])
    spotted, expected = by_all.spot(recording), by_kernels.spot(recording)
    assert [one.label for one in spotted] == [one.label for one in expected]
    found, numbers = (
        [(one.start, one.end, one.confidence, one.p_known) for one in some] for some in (spotted, expected)
    )
    np.testing.assert_allclose(found, numbers, rtol=1e-5)
    of_kernels = by_kernels.calibration().scales
    np.testing.assert_allclose(by_all.calibration_of_kernels().scales, of_kernels, rtol=1e-5)
    assert not np.allclose(by_all.calibration().scales, of_kernels, rtol=1e-3)


def columns_of(demos, n_dims):
    """The trembles in so many columns."""
    chosen = np.arange(n_dims) % 2
    return kineme.Demonstrations.from_arrays([demo.positions[:, chosen] for demo in demos], demos.labels)


def draw_orders(each, seed, noise=0.1, n_classes=5):
    """Signals of three strokes of the class's own, in any order."""
    rng, u = np.random.default_rng(seed), np.linspace(0, 1, 50)[:, None]
    strokes = np.random.default_rng(1).normal(size=(n_classes, 3, 4, 1))
    waves, arrays, labels = np.sin(np.pi * u * np.arange(1, 5)), [], []
    for label, own in enumerate(strokes):
        for _ in range(each):
            arrays.append(
                np.vstack([waves @ (part + noise * rng.normal(size=part.shape)) for part in rng.permutation(own)])
            )
            labels.append(str(label))
    return kineme.Demonstrations.from_arrays(arrays, labels)


def test_profiles_recognize_what_is_made_in_another_order():
    shares = []
    for seed in range(6):
        shown, asked = (draw_orders(each, 100 * each + seed) for each in (1, 6))
        profiled, alone = kineme.Recognizer().fit(shown), kineme.Recognizer(classifier="nearest-each").fit(shown)
        shares.append((profiled.score(asked), alone.score(asked)))
    profiled, alone = np.mean(shares, axis=0)
    assert profiled > alone + 0.08


def test_profiles_are_a_quarter_of_the_score():
    shown, asked = (columns_of(draw_trembles(each, seed=each), 4)[cut:] for each, cut in ((3, 2), (4, 0)))
    recognizer = kineme.Recognizer().fit(shown)
    kernels = kineme.Recognizer(classifier="nearest-each").fit(shown).decision_function(asked)
    classifier, labels = recognizer.classifier_, np.asarray(recognizer.demonstrations_.labels)
    profiles = _profiles(transform(series_of(recognizer.describe(asked)), classifier.kernels), classifier.center)
    np.testing.assert_allclose(np.linalg.norm(profiles, axis=1), 1.0)
    squares = ((profiles[:, None] - classifier.profiles) ** 2).sum(axis=2)
    nearest = np.stack([squares[:, labels == label].min(axis=1) for label in recognizer.classes_], axis=1)
    score = 0.75 * np.exp(kernels) + 0.25 * np.exp(-nearest / (2 * classifier.width**2))
    rows, learned = rows_of_values(asked, shown), rows_of_values(shown, shown)
    squares = ((rows[:, None] - learned) ** 2).sum(axis=2)
    nearest = np.stack([squares[:, labels == label].min(axis=1) for label in recognizer.classes_], axis=1)
    between = ((learned[:, None] - learned) ** 2).sum(axis=2)
    between[labels[:, None] == labels] = np.inf
    width = 0.4 * np.median(np.sqrt(between.min(axis=1)))
    expected = np.log(0.85 * score + 0.15 * np.exp(-nearest / (2 * width**2)))
    np.testing.assert_allclose(recognizer.decision_function(asked), expected, rtol=1e-9, atol=1e-9)


def rows_of_values(demos, shown):
    """Means of eighths and standard deviation of 64 even samples, in units of the spread of what was shown."""

    def samples(movements):
        stamps = np.linspace(0, 1, 64)
        each = [
            CubicSpline(
                demo.times / demo.times[-1],
                demo.positions,
            )(stamps)
            for demo in movements
        ]
        return np.array(each)

    known = samples(shown)
    spread = np.sqrt((known.std(axis=1) ** 2).mean(axis=0) + known.mean(axis=1).var(axis=0))
    values = samples(demos) / spread
    means = values.reshape(len(values), 8, 8, -1).mean(axis=2) / np.sqrt(8)
    return np.concatenate((means, values.std(axis=1)[:, None]), axis=1).reshape(len(values), -1)


def draw_levels(each, seed, n_dims=4, apart=0.0):
    """Columns of noise whose classes differ by their level and by nothing else; `apart` by who measured them."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(4 * each, 60, n_dims)).cumsum(axis=1) / 8 + apart * rng.normal(size=(4 * each, 1, n_dims))
    labels = np.repeat(np.arange(4), each)
    return kineme.Demonstrations.from_arrays(list(steps + 3.0 * labels[:, None, None]), labels)


@pytest.mark.parametrize("n_dims", [1, 4])
@pytest.mark.parametrize("each", [1, 3])
def test_signals_and_sensors_are_told_apart_by_the_level_at_which_they_are(each, n_dims):
    shown, asked = draw_levels(each, 1, n_dims), draw_levels(10, 2, n_dims)
    recognizer = kineme.Recognizer().fit(shown)
    assert recognizer.score(asked) > 0.85
    assert kineme.Recognizer(classifier="nearest-each").fit(shown).score(asked) < 0.5
    chosen = np.random.default_rng(3).permutation(40)
    np.testing.assert_array_equal(recognizer.predict(asked[chosen]), recognizer.predict(asked)[chosen])
    described = recognizer.describe(asked)
    np.testing.assert_array_equal(described.take(chosen).values, described.values[chosen])


def test_where_the_level_says_nothing_values_count_little():
    shown = draw_trembles(4, seed=3)
    placed = kineme.Demonstrations.from_arrays(
        [demo.positions[:, :1] + 9 * k**2 % 23 for k, demo in enumerate(shown)], shown.labels
    )
    assert kineme.Recognizer().fit(placed).classifier_.nearest.values.share == min(VALUED)
    levels = draw_levels(4, seed=5)
    assert kineme.Recognizer().fit(levels).classifier_.nearest.values.share == max(VALUED)


def test_what_is_far_from_all_levels_is_recognized_without_them():
    shown, asked = draw_trembles(1, seed=1), draw_trembles(3, seed=2)
    recognizer = kineme.Recognizer().fit(columns_of(shown, 1))
    moved = kineme.Demonstrations.from_arrays([demo.positions + 1e3 for demo in columns_of(asked, 1)], asked.labels)
    scores = replace(recognizer.classifier_, values=None).scores
    expected = recognizer._scores(columns_of(asked, 1), scores) + np.log(0.85)
    np.testing.assert_allclose(recognizer.decision_function(moved), expected, atol=1e-4)


def test_a_column_that_never_changed_tells_nothing():
    """Whatever it is later: a sensor that was replaced."""
    shown, asked = draw_levels(2, seed=1), draw_levels(5, seed=2)

    def beside(demos, constant):
        return kineme.Demonstrations.from_arrays(
            [np.column_stack((demo.positions, np.full(60, constant))) for demo in demos], demos.labels
        )

    recognizer = kineme.Recognizer().fit(beside(shown, 1e6))
    np.testing.assert_allclose(
        recognizer.predict_proba(beside(asked, -3.0)), recognizer.predict_proba(beside(asked, 1e6)), atol=1e-6
    )


def test_a_column_that_is_rounding_tells_nothing():
    """As a part of a rotation that does not happen, however its rounding differs from call to call."""
    shown, asked = draw_levels(3, seed=1), draw_levels(5, seed=2)

    def beside(demos, seed):
        rounding = 1e-16 * np.random.default_rng(seed).normal(size=(len(demos), 60))
        return kineme.Demonstrations.from_arrays(
            [np.column_stack((demo.positions, own)) for demo, own in zip(demos, rounding, strict=True)], demos.labels
        )

    recognizer = kineme.Recognizer().fit(beside(shown, 1))
    assert np.isinf(recognizer.classifier_.nearest.values.scale.spread[-1])
    units = [np.column_stack((demo.positions, demo.positions[:, :2] * [1e2, 1e-9] + [1e5, 0])) for demo in shown]
    assert np.isfinite(kineme.Recognizer().fit(units, shown.labels).classifier_.nearest.values.scale.spread).all()
    one, other = beside(asked, 2), beside(asked, 3)
    np.testing.assert_allclose(recognizer.predict_proba(one), recognizer.predict_proba(other), atol=1e-4)
    np.testing.assert_allclose(recognizer.novelty(one), recognizer.novelty(other), rtol=1e-4)


def test_with_profiles_one_class_is_named_everywhere():
    shown, asked = (columns_of(draw_trembles(each, seed=10 + each), 1) for each in (2, 5))
    recognizer = kineme.Recognizer().fit(shown)
    predicted, probabilities = recognizer.predict(asked), recognizer.predict_proba(asked)
    np.testing.assert_array_equal(recognizer.classes_[probabilities.argmax(axis=1)], predicted)
    for answer, label, row in zip(recognizer.recognize(asked), predicted, probabilities, strict=True):
        assert answer.ranked[0] == label
        assert answer.label in (label, None)
        np.testing.assert_allclose([answer.probabilities[name] for name in recognizer.classes_], row)
    explained = recognizer.recognize(asked[0]).explain()
    assert explained.by_convolutions


@pytest.mark.parametrize(("each", "n_dims"), [(1, 4), (3, 2), (3, 4)])
def test_the_page_answers_by_the_kernels_alone_and_says_so(each, n_dims):
    shown = columns_of(draw_trembles(each, seed=4), n_dims)
    recognizer = kineme.Recognizer().fit(shown)
    assert isinstance(recognizer.classifier_, NearestProfiled | LogarithmicPool)
    with pytest.warns(UserWarning, match="the page answers by the kernels alone.*classifier='nearest-each'"):
        snapshot = snapshot_of_recognizer(recognizer)
    same = snapshot_of_recognizer(kineme.Recognizer(classifier="nearest-each").fit(shown))
    assert snapshot.header == same.header
    for name, array in same.arrays.items():
        np.testing.assert_array_equal(snapshot.arrays[name], array)


@pytest.mark.parametrize(
    ("n_dims", "options"),
    [
        (2, {}),
        (2, {"max_angle": 0.0}),
        (3, {}),
        (4, {"points": 2}),
        (4, {"mean": "geometric"}),
        (4, {"scale": "none"}),
        (1, {"translation": False}),
        (1, {"classifier": "nearest-each"}),
    ],
    ids=str,
)
def test_what_is_rotated_placed_or_not_averaged_has_no_profiles(n_dims, options):
    recognizer = kineme.Recognizer(**options).fit(columns_of(draw_trembles(2, seed=3), n_dims))
    assert not isinstance(recognizer.classifier_, NearestProfiled)


def test_one_class_or_copies_have_no_profiles():
    shown = columns_of(draw_trembles(2, seed=4), 1)
    assert not isinstance(kineme.Recognizer().fit(shown[:2]).classifier_, NearestProfiled)
    copies = [shown[0], shown[0], shown[0], shown[1]]
    assert not isinstance(kineme.Recognizer().fit(copies, list("aabb")).classifier_, NearestProfiled)
    time = np.linspace(0, 1, 80)[:, None]
    twice = [np.sin(6 * time), np.sin(6 * time), np.cos(9 * time)]  # their cosine is 1 but for rounding
    assert not isinstance(kineme.Recognizer().fit(twice, list("abc")).classifier_, NearestProfiled)


@pytest.mark.parametrize("n_dims", [1, 4])
def test_held_values_and_still_columns_have_the_same_profile_at_any_noise_of_a_sensor(n_dims):
    """What they make is equal to thresholds, and rounding would decide whether it is above."""
    rng = np.random.default_rng(0)
    levels = rng.integers(0, 4, size=(8, 6, n_dims)).astype(float)
    levels[:, :, 4:] = 7.3
    held = [np.repeat(own, rng.integers(15, 40, size=6), axis=0) for own in levels]
    recognizer = kineme.Recognizer().fit(held, np.arange(8) // 2)
    classifier = recognizer.classifier_.nearest
    noisy = [movement + 1e-6 * rng.normal(size=movement.shape) for movement in held]
    profiles = _profiles(transform(series_of(recognizer.describe(noisy)), classifier.kernels), classifier.center)
    np.testing.assert_allclose((profiles * classifier.profiles).sum(axis=1), 1.0, atol=0.003)


def test_without_details_there_are_none_that_queries_would_lack():
    shown = draw_trembles(8, seed=8)
    weights = [0.0 if each.detailed else 1.0 for each in kineme.Recognizer().fit(shown).specification.representations]
    assert kineme.Recognizer(weights=weights).fit(shown).references_.described.pairs.details is None
    assert kineme.Recognizer(weights=weights).fit(shown).score(shown) == 1
    with pytest.raises(SpecificationError, match="compared in detail"):
        kineme.Recognizer(classifier="convolutions", weights=weights).fit(shown)


@pytest.mark.parametrize("options", [{"max_angle": 1.0}, {"translation": False}, {"scale": "none"}])
def test_where_rotations_or_places_are_said_they_do_not(options):
    assert isinstance(kineme.Recognizer(**options).fit(draw_trembles(8, seed=4)).classifier_, NearestEach)


def test_they_can_be_asked_for():
    shown = draw_trembles(4, seed=5)
    recognizer = kineme.Recognizer(classifier="convolutions").fit(shown)
    assert isinstance(recognizer.classifier_, Convolutions)
    assert recognizer.score(shown) == 1
    with pytest.raises(SpecificationError, match="got convolutions, which the page does not have"):
        snapshot_of_recognizer(recognizer)
    one_class = shown[:4]
    with pytest.raises(SpecificationError, match="expected movements of two or more classes"):
        kineme.Recognizer(classifier="convolutions").fit(one_class)
    with pytest.raises(SpecificationError, match="compared in detail"):
        kineme.Recognizer(ROW_REPRESENTATIONS, classifier="convolutions").fit(shown)
