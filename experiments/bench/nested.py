"""Nested validation across data sets: a few defaults are chosen on all sets but one, and reported on that one.

Everything is split by person where people are known. Where the set left out and another share people, a value that is
reported on one person was chosen without that person's movements. The sets are those of `bench.nested_sets`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.by_person import FOLDER
from bench.nested_sets import Movements, movement_sets
from bench.rows import Row
from kineme.kernels.pair_distances import ElasticSpec
from kineme.kernels.rotation import CONCENTRATION, RotationPrior
from kineme.similarity.describe import Described, describe, squared_distances
from kineme.similarity.similarity import SHARE
from kineme.similarity.specification import DEFAULT_REPRESENTATIONS, ComparisonSpecification

OWN = tuple(one.weight for one in DEFAULT_REPRESENTATIONS)
WEIGHTS = (OWN, (1.0,) * 7, (*OWN[:5], 2.0, 2.0), (*OWN[:5], 0.0, 0.0))
#: Number of the same quantity that is not in detail, for each representation; it gives the width.
_NUMBERS = {one.quantity: r for r, one in enumerate(DEFAULT_REPRESENTATIONS) if not one.detailed}
TWINS = [_NUMBERS[one.quantity] for one in DEFAULT_REPRESENTATIONS]
SHARES = (0.3, SHARE, 0.5)
CONCENTRATIONS = ((0.03, 0.03), (CONCENTRATION[2], CONCENTRATION[3]), (0.1, 0.1))
BANDS = (3, ElasticSpec().band, 12)


class Values(NamedTuple):
    """One point of the grid."""

    weights: tuple[float, ...]
    share: float
    concentrations: tuple[float, float]
    band: int


GRID = tuple(Values(w, s, k, b) for k, b, s, w in product(CONCENTRATIONS, BANDS, SHARES, WEIGHTS))
SHIPPED = GRID.index(Values(OWN, SHARE, (CONCENTRATION[2], CONCENTRATION[3]), ElasticSpec().band))


def measure(quick: bool) -> list[Row]:
    sets = movement_sets(quick)
    if sum(one.paths for one in sets) < 2:  # values are chosen on the others
        print(f"nested: no recordings beside LASA in {FOLDER}; name their folder in KINEME_RECORDINGS")
        return []
    by_set = {one.name: accuracies(one, GRID) for one in sets}
    rows = []
    for left in sets:
        chosen, found = [], []
        for person, own in by_set[left.name].items():
            best = _best([_without(one, person, by_set) for one in sets if one.paths and one is not left])
            chosen.append(best)
            found.append(own[best])
        every = np.mean(list(by_set[left.name].values()), axis=0)
        details = {
            "chosen": [[GRID[best]._asdict(), count] for best, count in Counter(chosen).most_common()],
            "best in hindsight": GRID[int(every.argmax())]._asdict() | {"accuracy": float(every.max())},
        }
        shipped = float(every[SHIPPED])
        rows.append(Row(left.name, "accuracy", float(np.mean(found)), shipped, "shipped defaults", details=details))
    return rows


def _without(one: Movements, person: Any, by_set: dict[str, Any]) -> NDArray[np.floating]:
    """Accuracy of a set at each point of the grid, without the movements of a person who is among its people."""
    shared = one.people is not None and person is not None and bool((one.people == person).any())
    return np.mean(list((accuracies(one, GRID, person) if shared else by_set[one.name]).values()), axis=0)


def _best(scores: list[NDArray[np.floating]]) -> int:
    """Point of the grid with the largest mean accuracy over sets; of equally good ones, the first."""
    mean = np.mean(scores, axis=0)
    return int(np.flatnonzero(mean >= mean.max() - 1e-9)[0])


def accuracies(one: Movements, grid: tuple[Values, ...], without: Any = None) -> dict[Any, NDArray[np.floating]]:
    """Person tested, or None -> accuracy at each point of the grid, the mean over copies, shots and draws."""
    found: dict[Any, list[NDArray[np.floating]]] = {}
    squares: dict[Any, NDArray[np.floating]] = {}
    for copy, person, train, test in one.splits(without):
        if (copy, 0) not in squares:
            squares = {(copy, k): each for k, each in enumerate(_squares(one, copy, grid))}
        right = _right(squares, copy, one.labels, train, test, grid)
        found.setdefault(person, []).append(right)
    return {person: np.mean(each, axis=0) for person, each in found.items()}


def _distances(grid: tuple[Values, ...]) -> list[tuple[tuple[float, float], int]]:
    """What of the grid changes distances, each once."""
    return list(dict.fromkeys((values.concentrations, values.band) for values in grid))


def _squares(one: Movements, copy: int, grid: tuple[Values, ...]) -> Iterator[NDArray[np.floating]]:
    """Squared distances (R, n, n) for each of `_distances`; other concentrations than the default rotate details."""
    demos = one.copies[copy]
    for (plane, space), band in _distances(grid):
        shipped = (plane, space) == (CONCENTRATION[2], CONCENTRATION[3])
        prior = RotationPrior() if shipped else RotationPrior(plane if demos.n_dims == 2 else space)
        described = with_band(describe(demos, ComparisonSpecification(prior=prior)), band)
        yield squared_distances(described, described).astype(np.float32)


def with_band(described: Described, band: int) -> Described:
    """The same movements, whose elastic paths are compared within another band."""
    assert described.pairs is not None
    assert described.pairs.details is not None
    shapes, details = (
        replace(one, elastic=replace(one.elastic, band=band))
        for one in (described.pairs.shapes, described.pairs.details)
    )
    return replace(described, pairs=replace(described.pairs, shapes=shapes, details=details))


def _right(
    squares: dict[Any, NDArray[np.floating]],
    copy: int,
    labels: NDArray[Any],
    train: NDArray[np.intp],
    test: NDArray[np.intp],
    grid: tuple[Values, ...],
) -> NDArray[np.floating]:
    """Share of the tested movements that are recognized, at each point of the grid: what `Recognizer` answers."""
    train = train[np.argsort(labels[train], kind="stable")]
    classes, first, owners = np.unique(labels[train], return_index=True, return_inverse=True)
    numbers = {key: k for k, key in enumerate(_distances(grid))}
    kernels: dict[Any, NDArray[np.floating]] = {}
    found = np.empty(len(grid))
    for at, values in enumerate(grid):
        key = numbers[values.concentrations, values.band], values.share
        if key not in kernels:
            every = squares[copy, key[0]][:, :, train]
            sigma = values.share * _to_impostors(every[:, train], owners)[TWINS]
            logs = every[:, test] / (-2.0 * sigma**2)[:, None, None]
            kernels[key] = np.exp(np.maximum.reduceat(logs, first, axis=2))
        averaged = np.tensordot(values.weights, kernels[key], axes=1)
        found[at] = (classes[averaged.argmax(axis=1)] == labels[test]).mean()
    return found


def _to_impostors(squares: NDArray[np.floating], owners: NDArray[np.intp]) -> NDArray[np.floating]:
    """Median distance (R,) to the nearest movement of another class that differs, of squared distances (R, m, m)."""
    others = np.sqrt(np.where(owners[:, None] == owners, np.inf, squares).min(axis=2))
    return np.nanmedian(np.where(others > 1e-3, others, np.nan), axis=1).astype(float)
