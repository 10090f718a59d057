"""Proposals find the kinds again, whatever the order, place, size and direction of the movements."""

from __future__ import annotations

import pytest
from unlabeled_samples import ALL_TOGETHER, recovered

import kineme
from kineme.anchoring.propose import propose

METHODS = ("agglomerative", "hdbscan")


@pytest.mark.parametrize("method", METHODS)
def test_handwriting_without_labels(method):
    demos = kineme.load_lasa()
    assert recovered(demos.labels, propose(demos, method)) >= 0.95


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(2))
def test_handwriting_with_everything_perturbed(method, seed):
    demos = ALL_TOGETHER.apply(kineme.load_lasa(), seed)
    assert recovered(demos.labels, propose(demos, method)) >= 0.9
