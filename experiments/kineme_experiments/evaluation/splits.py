"""Training and test movements, chosen by labels and seed alone, so the same for all methods."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.intp]


class Split(NamedTuple):
    """Indices of training and test movements; `known` marks the test movements of trained classes."""

    train: Indices
    test: Indices
    known: NDArray[np.bool_]


def few_shot(labels: NDArray[Any], shots: int, seed: int, index: int) -> Split:
    """`shots` random movements of every class train, all others test; split `index` of the sequence `seed`.

    The movements of a class are shuffled once per split: more shots add movements to those of fewer shots.
    """
    train = np.sort(np.concatenate([own[:shots] for own in _shuffled(labels, seed, index)]))
    test = np.setdiff1d(np.arange(len(labels)), train)
    return Split(train, test, np.ones(len(test), bool))


def one_left_out(labels: NDArray[Any], index: int) -> Split:
    """Movement `index` tests, all others train."""
    return Split(np.delete(np.arange(len(labels)), index), np.array([index]), np.ones(1, bool))


def folds(labels: NDArray[Any], n_folds: int, seed: int, index: int) -> list[Split]:
    """Each class spread evenly over `n_folds` parts, each of which tests once."""
    fold = np.empty(len(labels), dtype=np.intp)
    position = 0
    for own in _shuffled(labels, seed, index):
        fold[own] = (position + np.arange(len(own))) % n_folds  # continue after the last class: folds of equal size
        position += len(own)
    parts = [np.flatnonzero(fold == k) for k in range(n_folds)]
    return [Split(np.flatnonzero(fold != k), part, np.ones(len(part), bool)) for k, part in enumerate(parts)]


def half_unknown(labels: NDArray[Any], shots: int, seed: int, index: int) -> Split:
    """A random half of the classes is known, `shots` movements of each train, and everything else tests."""
    by_class = _shuffled(labels, seed, index)
    order = np.random.default_rng([1, seed, index]).permutation(len(by_class))
    known = [by_class[k] for k in order[: (len(by_class) + 1) // 2]]
    train = np.sort(np.concatenate([own[:shots] for own in known]))
    test = np.setdiff1d(np.arange(len(labels)), train)
    return Split(train, test, np.isin(test, np.concatenate(known)))


def _shuffled(labels: NDArray[Any], seed: int, index: int) -> list[Indices]:
    """Shuffled indices of each class, classes sorted."""
    random = np.random.default_rng([0, seed, index])
    return [random.permutation(np.flatnonzero(labels == label)) for label in np.unique(labels)]


def within_person(labels: NDArray[Any], tested: NDArray[np.bool_], shots: int, seed: int, draw: int) -> Split:
    """`shots` random movements of every class by the tested person train, all others by this person test.

    Classes of which the person made no more than `shots` movements are left out. More shots add movements to those of
    fewer.
    """
    own = np.flatnonzero(tested)
    by_class = [own[one] for one in _shuffled(labels[own], seed, draw) if len(one) > shots]
    train = _sorted([one[:shots] for one in by_class])
    test = _sorted([one[shots:] for one in by_class])
    return Split(train, test, np.ones(len(test), bool))


def one_person_out(
    labels: NDArray[Any], tested: NDArray[np.bool_], shots: int, seed: int, draw: int, unknown: bool = False
) -> Split:
    """`shots` random movements of every class by all other people train; those of the tested person test.

    Classes of which the others made fewer than `shots` movements are left out. With `unknown`, a random half of the
    classes trains, and the movements of the others are unknown. More shots add movements to those of fewer.
    """
    others = np.flatnonzero(~tested)
    by_class = [others[one] for one in _shuffled(labels[others], seed, draw) if len(one) >= shots]
    classes = [labels[one[0]] for one in by_class]
    known = by_class
    if unknown:
        order = np.random.default_rng([1, seed, draw]).permutation(len(by_class))
        known = [by_class[k] for k in order[: (len(by_class) + 1) // 2]]
    test = np.flatnonzero(tested & np.isin(labels, classes))
    train = _sorted([one[:shots] for one in known])
    return Split(train, test, np.isin(labels[test], labels[train]))


def _sorted(parts: list[Indices]) -> Indices:
    return np.sort(np.concatenate([np.empty(0, dtype=np.intp), *parts]))
