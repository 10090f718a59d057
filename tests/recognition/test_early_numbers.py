"""Numbers of early recognition that its documentation states: each falls here if it is changed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sklearn.utils import Bunch

import kineme
from kineme.recognition.early import evidence
from kineme.recognition.early.evidence import cut, partial_shares
from kineme.recognition.early.hypotheses import Early, Ending, Hypotheses, hypotheses, smooth_paths
from kineme.similarity.similarity import SHARE
from kineme_experiments.evaluation.splits import one_person_out


def log_classes(*movements):
    """Evidence for one class of movements, each with its evidence at 40 values of progress, and for the unknown."""
    evidence = np.log(np.maximum(np.concatenate(movements), 1e-300))[None]
    one_class = Bunch(progress=np.arange(1, 41) / 40, first=np.array([0]), durations=np.ones(len(movements)))
    return Hypotheses.log_classes(one_class, evidence)[0]


def explains(n_progress):
    return np.where(np.arange(40) < n_progress, 1.0, 0.0)


def test_a_movement_explains_perfectly_at_one_of_twenty_values_of_progress():
    assert log_classes(explains(2))[0] == pytest.approx(0.0)
    assert log_classes(explains(4))[0] == pytest.approx(math.log(2))


def test_the_evidence_for_a_class_is_the_mean_over_its_movements():
    assert log_classes(explains(2), explains(0), explains(0))[0] == pytest.approx(-math.log(3))
    assert log_classes(explains(2), explains(2), explains(2))[0] == pytest.approx(0.0)


def test_the_unknown_is_half_as_far_again_as_an_impostor_and_a_little_less_likely():
    assert log_classes(explains(2))[1] == pytest.approx(-0.5 * (1.5 / SHARE) ** 2 - 1.5)


def test_shares_are_those_of_the_evidence_to_the_power_of_four_fifths():
    evidence = np.log(np.concatenate([np.maximum(explains(2), 1e-300), np.maximum(0.1 * explains(2), 1e-300)]))[None]
    classes = Bunch(progress=np.arange(1, 41) / 40, first=np.arange(2), durations=np.ones(2))
    classes.log_classes = lambda rows: Hypotheses.log_classes(classes, rows)
    first, second, unknown = Hypotheses.shares(classes, evidence)[0]
    assert first + second + unknown == pytest.approx(1.0)
    assert first / second == pytest.approx(10**0.8)
    assert math.log(unknown / first) == pytest.approx(0.8 * (-0.5 * (1.5 / SHARE) ** 2 - 1.5))


def test_most_labels_are_decided_before_the_end_and_are_right():
    """At 0.7 of the path of LASA's first 13 shapes, 3 demonstrations of each: half of them with an unknown that is as
    far as an impostor.
    """
    demos = kineme.load_lasa()[: 13 * 7]
    own = np.arange(len(demos)) % 7
    recognizer = kineme.Recognizer().fit(demos[own < 3])
    stored = hypotheses(recognizer.comparison_, recognizer.references_, Early())
    test = demos[own >= 5]
    shares = partial_shares(recognizer.comparison_, stored, cut(test, 0.7))[:, :-1]
    decided = shares.max(axis=1) >= 0.9
    assert decided.mean() > 0.7
    np.testing.assert_array_equal(recognizer.classes_[shares.argmax(axis=1)][decided], test.labels[decided])


def test_before_its_speed_is_known_a_movement_is_over_at_odds_of_one_to_twenty():
    assert Ending((0.0, 1.0), (0.0, 1.0)).log_odds(np.zeros(1)) == pytest.approx(-3.0)
    assert math.exp(-3.0) == pytest.approx(1 / 20, abs=0.001)


def test_speed_at_the_end_and_progress_count_among_the_other_densities(monkeypatch):
    demos = kineme.load_lasa(["CShape", "NShape"])
    recognizer = kineme.Recognizer().fit(demos[::7])
    stored = hypotheses(recognizer.comparison_, recognizer.references_, Early())
    paths = smooth_paths(demos[1:2], recognizer.comparison_.cutoff)
    begun = evidence.describe_begun(stored, paths, demos[1].positions[:1], demos[1:2].durations, (paths, paths))

    def priors(speed):
        return evidence._log_priors(stored, begun._replace(prefixes=begun.prefixes._replace(end_speeds=speed)))[0]

    own = stored.prefixes.end_speeds[5]
    same, faster = priors(np.array([own])), priors(np.array([own + 0.5]))
    assert same[5] - faster[5] == pytest.approx(math.log(1.5))
    monkeypatch.setattr(evidence, "PROGRESS", 0.0)
    counted = same - priors(np.array([own]))
    np.testing.assert_allclose(counted, np.tile(0.25 * np.log(stored.progress), 2))


def test_a_class_of_what_is_over_counts_by_its_most_similar_movement_whatever_its_number():
    demos = kineme.load_lasa(["CShape", "NShape"])
    recognizer = kineme.Recognizer().fit(demos[[0, 1, 2, 7]])
    stored = hypotheses(recognizer.comparison_, recognizer.references_, Early())
    found = np.full(4 * len(stored.progress), -np.inf)
    how = recognizer.comparison_.specification
    whole = smooth_paths(demos[3:4], how.cutoff), smooth_paths(demos[3:4], how.detailed_cutoff)
    evidence._add_over(stored, whole, found, np.zeros(len(found)))
    first, second, _ = stored.log_classes(found[None])[0]
    similar = recognizer.log_similarity(demos[3:4])[0]
    assert first - second == pytest.approx(3.0 * (similar[:3].max() - similar[3]), rel=1e-3)


def test_the_similarity_of_whole_movements_counts_to_the_power_of_three():
    assert evidence.POWER == 3.0


@pytest.mark.soak
def test_pauses_of_beginnings_count_longer_than_those_of_whole_movements():
    """Of 208 beginnings of LASA 181 are recognized after 30 % of their path; 174 with pauses cut as in whole ones."""
    demos = kineme.load_lasa()
    own, right = np.arange(len(demos)) % 7, 0
    for first in (1, 6):
        shown = np.isin(own, np.arange(first, first + 3) % 7)
        test = demos[~shown]
        right += np.sum(kineme.Recognizer().fit(demos[shown]).predict_partial(cut(test, 0.3)) == test.labels)
    assert right >= 178


@pytest.mark.soak
def test_digits_of_other_people_are_known_at_the_end_as_whole_movements_are(digits):
    demos, people = digits
    labels = np.asarray(demos.labels)
    found = []
    for person in np.unique(people):
        split = one_person_out(labels, people == person, 3, 0, 0)
        recognizer = kineme.Recognizer().fit(demos[split.train])
        test = demos[split.test[::2]]
        parts = [cut(test, fraction) for fraction in (0.5, 0.9, 1.0)]
        answers = [*map(recognizer.predict_partial, parts), recognizer.predict(test)]
        found.append([np.mean(answer == np.asarray(test.labels)) for answer in answers])
    half, most, end, whole = np.mean(found, axis=0)
    assert half >= 0.66
    assert most >= 0.88
    assert end >= whole - 0.015
