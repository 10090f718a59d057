"""Evenly spaced indices, and runs."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kineme.sampling import evenly_spaced, runs


@given(n=st.integers(1, 5000), most=st.integers(1, 6000))
def test_indices_are_evenly_spaced_and_no_more_than_asked(n, most):
    some = evenly_spaced(n, most)
    assert len(some) == min(n, most)
    assert some[0] == 0
    assert some[-1] == (n - 1 if most > 1 else 0)
    steps = np.diff(some)
    assert (steps > 0).all()
    assert np.ptp(steps, axis=0) <= 1 if len(steps) else True


def test_runs_are_half_open():
    assert runs(np.array([True, True, False, True])).tolist() == [[0, 2], [3, 4]]
    assert runs(np.zeros(0, dtype=bool)).tolist() == []
