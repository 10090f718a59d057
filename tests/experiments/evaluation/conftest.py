"""Small data: classes that differ, demonstrations that differ a little."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme_experiments.evaluation.data import DataSet


@pytest.fixture(scope="session")
def make_small(make_movement):
    def make(n_classes=4, n_each=4, n_dims=2):
        rng = np.random.default_rng(5)
        arrays, labels = [], []
        for k in range(n_classes):
            _, x = make_movement([11, k], n_dims, n_samples=60)
            bend = np.sin(np.pi * np.linspace(0, 1, 60))[:, None]
            arrays += [x + 0.03 * bend * rng.normal(size=n_dims) for _ in range(n_each)]
            labels += [f"class {k}"] * n_each
        return kineme.Demonstrations.from_arrays(arrays, labels)

    return make


@pytest.fixture(scope="session")
def small(make_small):
    return make_small()


@pytest.fixture(scope="session")
def of_people(make_small):
    """Four classes by three people, four movements each; every person makes them a little differently."""
    parts = [make_small(n_each=4) for _ in range(3)]
    bends = [1.0, 1.1, 0.9]
    arrays = [b * x.positions for part, b in zip(parts, bends, strict=True) for x in part]
    demos = kineme.Demonstrations.from_arrays(arrays, np.concatenate([part.labels for part in parts]))
    return DataSet("people", demos, {}, np.repeat(["ann", "bob", "cy"], len(parts[0])).astype(object))
