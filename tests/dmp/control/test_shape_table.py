"""The table of the compiled twin against what it tabulates."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP
from kineme.dmp.control import _compiled
from kineme.dmp.control.stepping import shape_table


def look_up(table, u):
    shape = np.empty(table.coefficients.shape[2])
    _compiled._look_up(tuple(table), u, shape)
    return shape


def assert_tabulated(primitive):
    plan = primitive.controller(dt=0.01)._plan
    table = shape_table(plan)
    u = np.concatenate((np.random.default_rng(0).uniform(0, 1.5, 300), [0.0, 1.0, 3.0, 10.0, 1e3, 1e9]))
    expected = plan.shape(u)
    actual = np.array([look_up(table, one) for one in u])
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-300)
    np.testing.assert_allclose(actual / scale, expected / scale, rtol=0, atol=1e-12)
    return table


def test_the_table_is_the_shape(primitive):
    assert_tabulated(primitive)


@pytest.mark.parametrize("overlap", [0.01, 0.9])
@pytest.mark.parametrize("phase_end", [0.9, 1e-8])
@pytest.mark.parametrize("n_basis", [3, 40])
def test_the_table_is_the_shape_for_any_basis(overlap, phase_end, n_basis):
    dmp = DMP(n_basis=n_basis, overlap=overlap, phase_end=phase_end, n_points=80)
    u = np.linspace(0, 1, 80)
    assert_tabulated(dmp.learn([np.column_stack((np.sin(3 * u), u**2))])[0])


def test_beyond_the_table_all_is_zero(bio):
    table = assert_tabulated(bio)
    assert not look_up(table, table.breaks[-1]).any()
    assert not look_up(table, 1e300).any()
