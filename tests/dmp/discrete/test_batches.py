"""Primitives as a batch: indexing, labels, names."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP, Trajectory


@pytest.fixture(scope="module")
def learned(make_movement):
    return DMP(n_basis=10).learn(
        [Trajectory(*make_movement(i), label=c, name=f"take {c}") for i, c in enumerate("abcd")]
    )


@pytest.mark.parametrize(
    ("index", "labels"),
    [(1, "b"), (-1, "d"), (slice(1, 3), "bc"), ([2, 0], "ca"), (np.array([True, False, False, True]), "ad")],
)
def test_an_index_chooses_primitives_with_labels_and_names(learned, index, labels):
    chosen = learned[index]
    assert chosen.labels.tolist() == list(labels)
    assert chosen.names == tuple(f"take {c}" for c in labels)
    np.testing.assert_array_equal(chosen.weights, learned.weights[np.atleast_1d(np.arange(4)[index])])


def test_shapes_are_movements_by_samples_by_dimensions(learned):
    assert len(learned) == 4
    assert learned.n_dims == 2
    assert learned.weights.shape == (4, 10, 2)
    assert learned.forcing(30).shape == learned.shape_attractor(30).shape == (4, 30, 2)
    assert learned.rollout(n_samples=40).positions.shape == (4, 40, 2)
