"""The paper's claims, and ours, on real handwriting."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP, DMPFeatures, load_lasa
from kineme.datasets import PAPER_LETTERS
from kineme.dmp.discrete.specification import FORMULATIONS


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_each_letter_is_nearest_to_one_of_its_own(formulation):
    demos = load_lasa(PAPER_LETTERS)
    rows = DMPFeatures("shape-attractor", DMP(formulation)).fit_transform(demos)
    distances = np.linalg.norm(rows[:, None] - rows, axis=2)
    np.fill_diagonal(distances, np.inf)
    assert (demos.labels[distances.argmin(axis=1)] == demos.labels).all()


@pytest.mark.parametrize(
    ("dmp", "median", "worst"),
    [
        (DMP(fit="forcing", n_basis=80), 0.003, 0.006),
        (DMP("original", fit="forcing", n_basis=80), 0.003, 0.006),
        (DMP(fit="forcing", n_basis=80, regression="ridge"), 0.0006, 0.003),
        (DMP(), 0.0006, 0.0015),
    ],
    ids=["local", "original", "ridge", "default"],
)
def test_lasa_is_reconstructed_within_the_stated_share_of_its_extent(dmp, median, worst):
    demos = load_lasa()
    path = dmp.learn(demos).rollout(n_samples=1000).positions
    recorded = demos.positions.reshape(path.shape)
    rms = np.sqrt(((path - recorded) ** 2).sum(axis=2).mean(axis=1))
    errors = rms / np.ptp(recorded, axis=1).max(axis=1)
    assert np.median(errors) < median
    assert errors.max() < worst
