"""Numbers that the library rests on: each falls here if it is changed."""

from __future__ import annotations

import numpy as np
import pytest
from library_samples import draw_movements
from sklearn.utils import Bunch

from kineme import ActionLibrary, Demonstrations


def copies(n):
    """Two movements, n copies of each that differ a little."""
    rng = np.random.default_rng(4)
    bases = [movement.positions for movement in draw_movements(2, seed=3)]
    return [base + 0.01 * np.ptp(base) * rng.normal(size=(1, 2)) * np.linspace(0, 1, 40)[:, None] ** k
            for base in bases for k in range(1, n + 1)]  # fmt: skip


@pytest.mark.parametrize(("n_rejected", "again"), [(7, True), (8, False), (10, False)])
def test_a_proposal_is_one_that_was_rejected_if_four_fifths_of_its_movements_were(tmp_path, n_rejected, again):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        ids = library.learn(copies(10)).ids
        assert sorted(map(len, library.propose())) == [10, 10]
        library.reject(Bunch(members=ids[:n_rejected]))
        left = library.propose()
        assert sorted(map(len, left)) == ([10, 10] if again else [10])
        assert np.isin(ids[10:], np.concatenate([symbol.members for symbol in left])).all()


def test_two_rejections_are_not_taken_together(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        ids = library.learn(copies(10)).ids
        library.reject(Bunch(members=ids[:5]))
        library.reject(Bunch(members=ids[5:10]))
        assert sorted(map(len, library.propose())) == [10, 10]


@pytest.mark.parametrize("jitter", [1e-4, 1e-2])
def test_stamps_that_are_a_little_uneven_are_kept(tmp_path, jitter):
    even = np.linspace(0.0, 1.0, 101)
    uneven = even + jitter * 0.01 * np.random.default_rng(0).uniform(-1, 1, 101)
    uneven[[0, -1]] = 0.0, 1.0
    path = np.column_stack((np.sin(even), np.cos(3 * even)))
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(Demonstrations.from_arrays([path], times=[uneven]))
        stored = library.movements().times
    np.testing.assert_allclose(stored, uneven, atol=1e-7)
    assert np.abs(stored - even).max() > 0.5 * jitter * 0.01
