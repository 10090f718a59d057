"""Reduced features: bounds that hold, whatever the movements, the average and the rotation."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from kineme.kernels.procrustes import Procrustes
from kineme.kernels.rotation import RotationPrior
from kineme.similarity.bounds import fit_bases, log_bounds, reduce_features
from kineme.similarity.describe import feature_rows, prepare
from kineme.similarity.similarity import AveragedSimilarity
from kineme.similarity.specification import LOG_MEANS, ROW_REPRESENTATIONS, ComparisonSpecification
from movement_samples import draw_shapes
from soaking import combined

#: Limits of the angle, or priors.
ANGLES = {
    1: (0.0,),
    2: (0.0, 0.4, np.pi / 3, 2.0, np.pi, RotationPrior(), RotationPrior(0.3)),
    3: (0.0, 0.4, np.pi / 3, np.pi, RotationPrior(), RotationPrior(0.1, (0, 1, 2))),
    4: (0.0,),
}


def _procrustes(d, angle):
    return Procrustes(d, np.pi, angle) if isinstance(angle, RotationPrior) else Procrustes(d, angle)


HOW = ComparisonSpecification(ROW_REPRESENTATIONS)


def _rows(demos):
    rows = feature_rows(demos, HOW)
    return tuple(block.astype(np.float32) for block in rows)


def _exact(similarity, A, B):
    return similarity.log_average(*(prepare(rows, HOW, similarity.procrustes) for rows in (A, B)))


@cache
def _asked_and_stored(d):
    return _rows(draw_shapes([2] * 6, d, seed=1)), _rows(draw_shapes([3] * 20, d, seed=2))


@cache
def _reduced(d, n_reduced):
    asked, stored = _asked_and_stored(d)
    bases = fit_bases(stored, d, n_reduced)
    return reduce_features(bases, asked, d), reduce_features(bases, stored, d)


@pytest.mark.parametrize(
    ("turned", "mean", "n_reduced"),
    combined([(d, angle) for d, angles in ANGLES.items() for angle in angles], LOG_MEANS, [1, 3, 12, 100]),
)
def test_no_movement_is_more_alike_than_its_reduced_features_allow(turned, mean, n_reduced):
    d, angle = turned
    similarity = AveragedSimilarity(_procrustes(d, angle), np.array([0.5, 2.0, 2.2]), mean)
    bounds = log_bounds(similarity, *_reduced(d, n_reduced))
    exact = _exact(similarity, *_asked_and_stored(d))
    assert bounds.shape == exact.shape
    assert (bounds >= exact - 1e-6).all()


@pytest.mark.parametrize(
    ("d", "angle"),
    [(1, 0.0), (2, 0.4), (2, np.pi / 3), (2, np.pi), (2, RotationPrior()), (3, np.pi), (3, RotationPrior()), (4, 0.0)],
)
def test_reduced_features_that_leave_nothing_out_give_the_similarity_itself(d, angle):
    asked, stored = _rows(draw_shapes([2] * 6, d, seed=1)), _rows(draw_shapes([3] * 20, d, seed=1, spread=0.2))
    similarity = AveragedSimilarity(_procrustes(d, angle), np.array([5.0, 20.0, 22.0]))
    bases = fit_bases(stored, d, 100)
    bounds = log_bounds(similarity, reduce_features(bases, asked, d), reduce_features(bases, stored, d))
    np.testing.assert_allclose(bounds, _exact(similarity, asked, stored), atol=2e-3)
