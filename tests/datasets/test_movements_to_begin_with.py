"""Movements to begin with: always the same ones, labeled, of one kind of dimensions, and told apart."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.datasets import load_example
from kineme.errors import SpecificationError


@pytest.mark.parametrize(
    ("name", "n_labels", "each", "n_dims"), [("letters", 10, 7, 2), ("gestures", 8, 5, 2), ("arm", 5, 5, 3)]
)
def test_an_example_is_always_the_same_and_has_as_many_of_each_label(name, n_labels, each, n_dims):
    demos, again = load_example(name), load_example(name)
    labels, counts = np.unique(demos.labels, return_counts=True)
    assert (len(labels), set(counts.tolist()), demos.n_dims) == (n_labels, {each}, n_dims)
    np.testing.assert_array_equal(demos.positions, again.positions)
    np.testing.assert_array_equal(demos.durations, again.durations)


def test_movements_by_formulas_vary_as_by_a_hand_and_begin_and_end_at_rest():
    demos = load_example("gestures")
    for first, second in zip(demos[::5], demos[1::5], strict=True):
        size = np.ptp(first.positions, axis=0).max()
        apart = np.abs(first.positions - second.positions).max() / size
        assert 0.005 < apart < 0.5
        steps = np.linalg.norm(np.diff(first.positions, axis=0), axis=1)
        assert max(steps[0], steps[-1]) < 0.01 * steps.max()


def test_another_example_is_refused():
    with pytest.raises(SpecificationError, match="letters"):
        load_example("dances")
