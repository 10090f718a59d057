"""Close rows far from the center of all: their distance must not drown in their norms."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.kernels import RBF


@pytest.mark.parametrize("far", [16.0, 128.0, 1024.0])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_quarter_of_the_digits_of_the_exponent_is_lost_at_most(far, dtype):
    """The truth is that of the rows as they are stored, in double precision, where no norm is subtracted."""
    random = np.random.default_rng(0)
    rows = np.concatenate([sign * far + random.normal(size=(20, 3)) for sign in (-1.0, 1.0)]).astype(dtype)
    exact = rows.astype(np.longdouble)
    truth = np.exp(-0.5 * ((exact[:, None] - exact) ** 2).sum(axis=2)).astype(np.float64)
    near = truth > 0.01
    lost = np.abs(RBF(sigma=1.0)(rows)[near] / truth[near] - 1.0).max()
    assert lost < 3.0 * np.finfo(dtype).eps ** 0.75
