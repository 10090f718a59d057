"""Numbers that clustering and the review of symbols rest on, at points on a line: each falls here if it is changed."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.utils import Bunch

from kineme.anchoring.assignment import agreement, suggest_merges
from kineme.kernels.procrustes import Procrustes
from kineme.similarity.comparison import References
from kineme.similarity.describe import Described
from kineme.similarity.similarity import SHARE, AveragedSimilarity, gap_widths


def on_a_line(points):
    """Movements with one representation of one number, so that distances are differences."""
    procrustes = Procrustes(n_dims=1, max_angle=0.0)
    return Described((procrustes.prepare(np.array(points, dtype=float)[:, None]),), procrustes)


def kernel(difference):
    return np.exp(-0.5 * np.square(difference))


def test_a_width_comes_from_the_next_class_and_not_from_one_far_away():
    """The gap is looked for among the nearer half of the movements."""
    near, far = [0.0, 0.1, 0.2, 3.0, 3.1, 3.2], [100.0]
    assert gap_widths(on_a_line(near + far))[0] == pytest.approx(SHARE * 2.8, rel=0.05)


@pytest.mark.parametrize("apart", [1.5, 2.0, 20.0])
def test_movements_agree_from_half_way_between_their_own_symbol_and_the_next(apart):
    described = on_a_line([0.0, 1.0, apart, 1.0 + apart])
    similarity = AveragedSimilarity(described.procrustes, np.ones(1))
    references = References.of(None, described, np.array(["a", "a", "b", "b"]))
    within, between = kernel(1.0), kernel([apart, apart, apart + 1.0, apart - 1.0]).mean()
    found = agreement(Bunch(similarity=similarity), references)
    assert found == pytest.approx(0.5 * (within + between), rel=1e-6)


@pytest.mark.parametrize(("apart", "named"), [(1.7, 1), (1.8, 0)])
def test_symbols_are_merged_from_an_overlap_of_one_half(apart, named):
    described, labels = on_a_line([0.0, 1.0, apart, 1.0 + apart]), ["a", "a", "b", "b"]
    overlap = kernel([apart, apart, apart + 1.0, apart - 1.0]).mean() / kernel(1.0)
    assert (overlap >= 0.5) == bool(named)
    assert abs(overlap - 0.5) < 0.05
    assert len(suggest_merges(described, labels, widths=[1.0])) == named
    (merge,) = suggest_merges(described, labels, widths=[1.0], least=0.4)
    assert merge.overlap == pytest.approx(overlap, rel=1e-6)
