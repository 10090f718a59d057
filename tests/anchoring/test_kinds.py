"""Kinds of pieces without labels: how many, and what a kind keeps."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.anchoring.clustering import adjusted_rand
from kineme.anchoring.grammar import most_probable
from kineme.anchoring.kinds import describe_pieces, excursions, learn_kinds, log_densities


def _paths(rng, begin, way, n, spread=0.05):
    """Begin, middle and end of n straight pieces; `begin` is a place, or None for any."""
    begins = rng.normal(size=(n, 3)) if begin is None else np.array(begin) + spread * rng.normal(size=(n, 3))
    ways = np.array(way) + spread * rng.normal(size=(n, 3))
    return np.stack((begins, begins + 0.5 * ways, begins + ways), axis=1)


def _labels(kinds, features, lengths):
    densities, ends = log_densities(kinds.means, kinds.roots, features), np.cumsum(lengths)
    parts = [most_probable(kinds.grammar, densities[a:b]) for a, b in zip(ends - lengths, ends, strict=True)]
    return np.concatenate(parts)


def _sets(rng, *several):
    features = describe_pieces(np.concatenate(several))
    return features, np.repeat(np.arange(len(several)), [len(paths) for paths in several])


def test_a_way_there_and_the_way_back_are_two_kinds():
    rng = np.random.default_rng(0)
    there, back = _paths(rng, (0, 0, 0), (2, 1, 0), 30), _paths(rng, (2, 1, 0), (-2, -1, 0), 30)
    features, truth = _sets(rng, there, back)
    order = np.argsort(np.tile(np.arange(30), 2), kind="stable")
    kinds = learn_kinds(features[order], [2] * 30, 9)
    assert len(kinds) == 2
    assert adjusted_rand(truth[order], _labels(kinds, features[order], [2] * 30)) == 1.0


def test_the_same_way_at_two_places_is_two_kinds_and_at_any_place_is_one():
    rng = np.random.default_rng(1)
    here, elsewhere = _paths(rng, (0, 0, 0), (0, 0, 1), 40), _paths(rng, (3, 0, 0), (0, 0, 1), 40)
    features, truth = _sets(rng, here, elsewhere)
    kinds = learn_kinds(features, [1] * 80, 9)
    assert len(kinds) == 2
    assert adjusted_rand(truth, _labels(kinds, features, [1] * 80)) == 1.0

    up, aside = _paths(rng, None, (0, 0, 1), 60), _paths(rng, None, (1, -1, 0), 60)
    features, truth = _sets(rng, up, aside)
    kinds = learn_kinds(features, [1] * 120, 9)
    assert len(kinds) == 2
    assert adjusted_rand(truth, _labels(kinds, features, [1] * 120)) == 1.0


def test_what_does_not_differ_is_one_kind():
    rng = np.random.default_rng(2)
    features, _ = _sets(rng, _paths(rng, (0, 0, 0), (1, 0, 0), 50))
    assert len(learn_kinds(features, [5] * 10, 9)) == 1


def test_a_press_down_and_up_is_an_excursion_but_a_way_there_and_back_is_none():
    rng = np.random.default_rng(3)
    n = 40
    reach, down = _paths(rng, (0, 0, 1), (2, 0, 0), n), _paths(rng, (2, 0, 1), (0, 0, -1), n)
    up, home = _paths(rng, (2, 0, 0), (0, 0, 1), n), _paths(rng, (2, 0, 1), (0, 2, 0), n)
    pieces = np.stack((reach, down, up, home), axis=1).reshape(-1, 3, 3)
    kinds = learn_kinds(describe_pieces(pieces), [4] * n, 9)
    assert len(kinds) == 4
    labels = _labels(kinds, describe_pieces(pieces), [4] * n)
    assert excursions(kinds, 3) == [(labels[1], labels[2])]

    there_and_back = np.stack((reach, reach[:, ::-1]), axis=1).reshape(-1, 3, 3)
    kinds = learn_kinds(describe_pieces(there_and_back), [2] * n, 9)
    assert len(kinds) == 2
    assert excursions(kinds, 3) == []


@pytest.mark.parametrize("n", [1, 3, 7])
def test_few_pieces_are_one_kind(n):
    features = describe_pieces(np.random.default_rng(4).normal(size=(n, 3, 2)))
    kinds = learn_kinds(features, [n], 6)
    assert len(kinds) == 1
    assert kinds.grammar.counts.sum() == pytest.approx(n + 1)
