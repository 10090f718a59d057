"""Which movements count as the same one."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import Demonstrations
from kineme.io.inspection.inspect import duplicates_among
from kineme.io.reading.recordings import read_recordings


@pytest.mark.parametrize(("difference", "groups"), [(0.0, [[0, 1]]), (5e-7, [[0, 1]]), (2e-6, []), (1e-2, [])])
def test_stamps_of_equal_movements_agree_to_a_millionth_of_the_duration(difference, groups):
    x = np.random.default_rng(0).normal(size=(50, 2))
    t = np.linspace(0.0, 3.0, 50)
    other = t + 100.0  # wherever it starts
    other[20] += 3.0 * difference
    demos = Demonstrations.from_arrays([x, x, x[::-1]], times=[t, other, t])
    assert duplicates_among(demos) == groups


def test_movements_that_differ_in_a_gripper_are_no_duplicates(tmp_path):
    t = np.linspace(0.0, 1.0, 30)
    for name, step in (("a", 0.5), ("b", 0.2), ("c", 0.5)):
        table = np.column_stack((t, np.sin(t), t**2, t > step))
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header="t,x,y,gripper", comments="")
    demos = read_recordings(tmp_path).demonstrations
    assert demos.n_dims == 2
    assert duplicates_among(demos) == [[0, 2]]
