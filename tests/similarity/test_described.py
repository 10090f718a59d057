"""Described movements: some of them, and room for more."""

import numpy as np
import pytest

import kineme
from kineme.anchoring.proposals import by_shape
from kineme.kernels.procrustes import Procrustes
from kineme.similarity.describe import describe, squared_distances


@pytest.fixture(scope="module")
def described():
    return describe(kineme.load_lasa()[::9])


@pytest.mark.parametrize("change", [lambda one: one.take(slice(1, 4)), lambda one: one.empty(3)], ids=["take", "empty"])
def test_positions_that_give_the_rotation_are_held_once(described, change):
    some = change(described)
    assert len(some) == 3
    assert some.pairs.positions is some.blocks[0]
    assert by_shape(some).n_representations == described.n_representations - 1  # without the forcing term


def test_positions_that_give_the_rotation_are_compared_once(described, monkeypatch):
    some, rows, whole = described.take(slice(0, 5)), [], Procrustes.squared_distances

    def counted(self, A, B):
        rows.append(A.rows.shape)
        return whole(self, A, B)

    monkeypatch.setattr(Procrustes, "squared_distances", counted)
    squared_distances(some, described)
    assert len(rows) == 1  # of the forcing term


def test_what_is_put_into_room_is_what_was_there(described):
    room = described.empty(len(described))
    room.put(0, described.take(slice(0, 4)))
    room.put(4, described.take(slice(4, None)))
    np.testing.assert_array_equal(squared_distances(room, room), squared_distances(described, described))
    for chosen in ([2, 4], [3, 6]):  # the rotation is still that of the positions
        alone = described.select(chosen)
        there = alone.empty(len(alone))
        there.put(0, alone)
        np.testing.assert_array_equal(squared_distances(there, there), squared_distances(described, described)[chosen])
