"""The closed form of the spring-damper against SciPy's matrix exponential."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from kineme.dmp.control import _compiled
from kineme.dmp.spring_damper import transition, transitions
from soaking import combined


def many_at_once(stiffness, damping, h):
    return transitions(stiffness, damping, np.array([1.0, h]))[1]


@pytest.mark.soak("combinations")
@pytest.mark.parametrize(
    "function", [transition, _compiled._transition, many_at_once], ids=["plain", "compiled", "many"]
)
@pytest.mark.parametrize(
    ("stiffness", "damping", "h"),
    combined([1e-2, 100.0, 1e4], [1e-3, 0.5, 1 - 1e-12, 1.0, 1 + 1e-12, 1 + 1e-6, 3.0, 50.0], [0.0, 1e-6, 0.01, 1.0]),
)
def test_transition_is_the_matrix_exponential(function, stiffness, damping, h):
    D = 2 * np.sqrt(stiffness) * damping
    expected = expm(np.array([[0.0, 1.0], [-stiffness, -D]]) * h)
    actual = np.reshape(function(stiffness, D, h), (2, 2))
    scale = np.array([[1, 1 / np.sqrt(stiffness)], [np.sqrt(stiffness), 1]])
    np.testing.assert_allclose(actual / scale, expected / scale, rtol=0, atol=1e-11)


def test_a_strongly_overdamped_spring_neither_overflows_nor_stops():
    c00, _, _, _ = transition(1.0, 1e5, 1e5)  # a time constant of D / K = 1e5
    assert c00 == pytest.approx(np.exp(-1.0), rel=1e-9)
