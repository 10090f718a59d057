"""Decisions that the documentation of anchoring states: each falls here if it is changed."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.utils import Bunch

from kineme.anchoring.space import ConceptualSpace
from kineme.anchoring.spread import radii


def _space(ab, ac, cb):
    return ConceptualSpace(("a", "b", "c"), np.array([[0.0, ab, ac], [ab, 0.0, cb], [ac, cb, 0.0]]))


@pytest.mark.parametrize(
    ("ac", "cb", "found"),
    [
        (0.6, 0.6, True),
        (0.62, 0.62, True),  # a detour of 0.24
        (0.63, 0.63, False),  # of 0.26
        (1.05, 0.1, False),  # a small detour, but beyond b
        (0.1, 1.05, False),
        (0.99, 0.2, True),
    ],
)
def test_between_is_a_small_detour_and_nearer_to_each_than_they_are(ac, cb, found):
    assert [one.symbol for one in _space(1.0, ac, cb).between("a", "b")] == ["c"] * found


def test_however_large_a_detour_may_be_what_is_farther_is_not_between():
    assert _space(1.0, 1.2, 0.5).between("a", "b", eps=1.0) == ()
    assert len(_space(1.0, 0.9, 0.9).between("a", "b", eps=1.0)) == 1


def test_a_kind_reaches_as_far_as_its_members_and_at_least_as_far_as_most_members_of_all():
    """Of a tight and a loose kind, the tight one takes in what the loose one shows to be usual."""
    n = 20
    clusters = np.repeat([0, 1], n)
    K = np.zeros((2 * n, 2 * n))
    K[:n, :n] = 0.9  # 0.1 to the nearest mate
    K[n:, n:] = 0.7
    K[-1, n:] = K[n:, -1] = 0.4  # one at the rim
    kinds = [Bunch(members=np.flatnonzero(clusters == k)) for k in (0, 1)]
    tight, loose = radii(K, Bunch(clusters=clusters, proposals=kinds))
    assert loose == pytest.approx(0.6)
    assert tight == pytest.approx(0.3)  # the 95 % of all members
