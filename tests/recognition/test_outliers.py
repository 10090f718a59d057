"""Movements unlike the others of their label: how many planted ones are found, and how many others."""

import numpy as np
import pytest

import kineme
from kineme.recognition.outliers import (
    find_outliers,
    listed,
    outliers_as_data,
    outliers_as_words,
    scaled,
    tail_p_values,
)
from soaking import SOAK, slow


def wrongly_labeled(labels, share, rng):
    """The labels with some of them replaced by others; which."""
    given = np.asarray(labels, dtype=str)
    wrong = rng.choice(len(given), round(share * len(given)), replace=False)
    changed = given.copy()
    for i in wrong:
        changed[i] = rng.choice(np.unique(given[given != given[i]]))
    return changed.tolist(), wrong


def counts(demos, labels, planted):
    """Planted outliers that are found, and how many others are."""
    indices = {outlier.index for outlier in find_outliers(demos, labels).outliers}
    return len(indices & set(planted.tolist())), len(indices - set(planted.tolist()))


@pytest.mark.parametrize(("share", "least"), [slow(0.02, 0.85), (0.1, 0.75)])
def test_wrong_labels_of_digits_are_found_and_few_others(digits, share, least):
    """The rates that docs/guide/outliers.md tells of: without the contrast, or with one neighbor, fewer are found."""
    demos, _ = digits
    rng = np.random.default_rng(4)
    runs = [
        (*counts(demos, *wrongly_labeled(demos.labels, share, rng)), round(share * len(demos)))
        for _ in range(4 if SOAK else 2)
    ]
    n_detected, n_others, n_planted = np.sum(runs, axis=0)
    assert n_detected >= least * n_planted
    assert n_others <= 0.05 * (n_detected + n_others)


@pytest.mark.soak
def test_real_recordings_as_they_are_have_almost_none(gestures, digits):
    for demos, _ in (gestures, digits):
        assert len(find_outliers(demos).outliers) <= 0.005 * len(demos)


@pytest.mark.soak
def test_movements_of_an_action_that_has_no_label_are_found(gestures):
    demos, _ = gestures
    labels = np.asarray(demos.labels, dtype=str)
    foreign = labels == "3"
    chosen = np.concatenate((np.flatnonzero(~foreign), np.flatnonzero(foreign)[:20]))
    given = labels[chosen].copy()
    given[-20:] = np.unique(given[:-20])[np.arange(20) % 10]
    n_detected, n_others = counts(demos[chosen], given.tolist(), np.arange(len(chosen) - 20, len(chosen)))
    assert n_detected >= 15
    assert n_others <= 3


def test_what_is_said_of_an_outlier():
    demos = kineme.load_lasa(["CShape", "Snake", "Sine"])
    labels = demos.labels.tolist()
    labels[2] = "Snake"
    result = find_outliers(demos, labels)
    assert result.checked == 21
    (outlier,) = result.outliers
    assert (outlier.index, outlier.label, outlier.label_of_most_like) == (2, "Snake", "CShape")
    assert outlier.ratio > 2
    assert outlier.p_value < 0.05 / 21
    assert labels[outlier.most_like] == "CShape"
    names = [f"m{i}" for i in range(21)]
    words = outliers_as_words(result, names)
    assert "outliers: 1 of 21 movements unlike the others of their label (about 5 % of those" in words
    assert f"m{outlier.most_like} (CShape)" in words
    data = outliers_as_data(result, names)
    assert (data["outliers"][0]["movement"], data["checked"], data["error_rate"]) == ("m2", 21, 0.05)
    labels[2] = "CShape"
    assert outliers_as_words(find_outliers(demos, labels), names) == (
        "no outliers: none of 21 movements is unlike the others of its label"
    )


def test_few_movements_and_those_without_a_label_are_not_checked():
    demos = kineme.load_lasa(["CShape", "Snake", "Sine"])
    labels = [*demos.labels.tolist()[:19], None, None]
    assert find_outliers(demos, labels) == kineme.recognition.Outliers((), 0, 0.05)
    few = [*demos.labels.tolist()[:18], "a", "a", "a"]
    assert find_outliers(demos, few).checked == 0
    assert outliers_as_words(find_outliers(demos, few), []) == ""


def test_the_answer_depends_on_no_order():
    demos = kineme.load_lasa(["CShape", "Snake", "Sine"])
    labels = demos.labels.tolist()
    labels[2] = "Snake"
    order = np.random.default_rng(0).permutation(21)
    outliers = find_outliers(demos[order], [labels[i] for i in order]).outliers
    assert [order[outlier.index] for outlier in outliers] == [2]


def test_p_values_are_those_of_an_exponential_law():
    scores = np.random.default_rng(0).exponential(size=20_000) + 3
    p = tail_p_values(scores)
    for level in (0.01, 0.05, 0.2):
        assert (p <= level).mean() == pytest.approx(level, rel=0.15)


def test_p_values_are_those_of_the_formula():
    scores = np.append(np.linspace(0.5, 1.5, 21), 4.0)
    middle, upper = np.quantile(scores, [0.5, 0.8])
    t = (1.0 + 1.0 / np.sqrt(22)) * (upper - middle) / np.log(5 / 2)
    np.testing.assert_allclose(tail_p_values(scores), np.minimum(1.0, np.exp(-(scores - middle) / t) / 2))


def test_what_is_typical_of_a_label_is_shrunk_as_if_by_four_movements_of_all():
    scores = scaled([np.full(6, 2.0), np.ones(14)])
    np.testing.assert_allclose(scores, np.repeat([2.0 / ((6 * 2.0 + 4 * 1.0) / 10), 1.0], [6, 14]))


def test_the_procedure_lists_as_many_as_it_may():
    assert listed(np.array([0.03, 0.001, 0.9, 0.02]), 0.05).tolist() == [1, 3, 0]
    assert listed(np.array([0.06, 0.5]), 0.05).tolist() == []
    wrong = np.random.default_rng(0).uniform(size=(400, 50))
    assert np.mean([len(listed(one, 0.1)) > 0 for one in wrong]) == pytest.approx(0.1, abs=0.04)


def test_progress_is_told():
    told = []
    find_outliers(kineme.load_lasa(["CShape", "Snake", "Sine"]), progress=told.append)
    assert told == [7, 14, 21]


def test_copies_alone_are_refused_in_words():
    one = kineme.load_lasa(["CShape"])[0]
    with pytest.raises(kineme.errors.SpecificationError, match="expected training movements that differ"):
        find_outliers([one] * 24, ["a"] * 12 + ["b"] * 12)
    with pytest.raises(kineme.errors.TrajectoryError, match="expected movements with labels"):
        find_outliers([one.positions] * 24)
    with pytest.raises(kineme.errors.TrajectoryError, match="expected one label or None for each of 24"):
        find_outliers([one] * 24, ["a"])
    with pytest.raises(kineme.errors.SpecificationError, match="error_rate"):
        find_outliers([one] * 24, ["a"] * 24, error_rate=0.0)


def test_many_copies_hide_no_outlier_and_make_none():
    demos = kineme.load_lasa(["CShape", "Snake"])
    movements = [*([demos[0]] * 20), demos[1], demos[2], demos[8]]
    outliers = find_outliers(movements, ["a"] * 23).outliers
    assert outliers[0].index == 22
