"""Nested validation in docs/guide/recognition-defaults.md: accuracies of kernels of `Recognizer`; people stay apart."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from kineme import Recognizer
from kineme.recognition import RotationPrior
from kineme.similarity import similarity as widths
from movement_samples import draw_shapes

ROOT = str(Path(__file__).parents[2])


@pytest.fixture(scope="module")
def nested():
    from bench import nested

    return nested


@pytest.fixture(scope="module")
def of_people(nested):
    demos = draw_shapes([12] * 5, 3, seed=3, spread=1.2)
    people = np.tile(["a", "b", "c"], 20)
    return nested.Movements("shapes", (demos,), np.asarray(demos.labels).astype(str), people)


def test_accuracies_are_those_of_the_recognizer(nested, of_people):
    far = nested.Values((1.0,) * 7, 0.3, (0.03, 0.3), 6)
    found = nested.accuracies(of_people, (nested.GRID[nested.SHIPPED], far))
    expected = {person: [[], []] for person in found}
    demos, labels = of_people.copies[0], of_people.labels
    for _, person, train, test in of_people.splits():
        kernels = Recognizer(weights="own", classifier="nearest-each").fit(demos[train])
        expected[person][0].append(kernels.score(demos[test], labels[test]))
        with patch.object(widths, "SHARE", 0.3):
            prior = RotationPrior(0.3)
            other = Recognizer(weights="equal", rotation_prior=prior, classifier="nearest-each").fit(demos[train])
        expected[person][1].append(other.score(demos[test], labels[test]))
    for person, both in expected.items():
        np.testing.assert_allclose(found[person], np.mean(both, axis=1), atol=1e-9)
    assert min(np.min(both) for both in found.values()) < 0.95  # there is something to get wrong


def test_the_shipped_defaults_are_a_point_of_the_grid_and_bands_differ(nested, of_people):
    shipped = nested.GRID[nested.SHIPPED]
    assert (shipped.weights, shipped.share, shipped.concentrations, shipped.band) == (
        (2.0, 1.0, 2.0, 1.0, 2.0, 6.0, 6.0), widths.SHARE, (0.03, 0.1), 6,
    )  # fmt: skip
    described = Recognizer().fit(of_people.copies[0]).references_.described
    first, second = (nested.squared_distances(one, one) for one in (described, nested.with_band(described, 3)))
    np.testing.assert_array_equal(first[[0, 1, 4, 6]], second[[0, 1, 4, 6]])
    for r in (2, 5):
        assert (second[r] >= first[r] - 1e-6).all()
        assert (second[r] > first[r] + 1e-3).any()


def test_nobody_is_a_template_for_himself_and_nothing_of_the_excluded_is_used(of_people):
    for without in (None, "b"):
        tested = set()
        for _, person, train, test in of_people.splits(without):
            assert set(of_people.people[test]) == {person}
            assert person not in of_people.people[train]
            assert without not in of_people.people[np.concatenate((train, test))]
            tested.add(str(person))
        assert tested == {"a", "b", "c"} - {without}


def test_the_best_is_chosen_on_the_other_sets_and_without_the_person(nested, of_people):
    other = nested.Movements("others", of_people.copies, of_people.labels, of_people.people)
    by_set = {"others": {"a": np.array([0.0, 1.0])}}
    with patch.object(nested, "accuracies", return_value={"b": np.array([1.0, 0.0]), "c": np.array([0.5, 0.0])}) as how:
        np.testing.assert_array_equal(nested._without(other, "a", by_set), [0.75, 0.0])
    assert how.call_args.args[2] == "a"
    np.testing.assert_array_equal(nested._without(other, "stranger", by_set), [0.0, 1.0])
    assert nested._best([np.array([0.2, 0.6, 0.6]), np.array([0.6, 0.4, 0.4])]) == 1
