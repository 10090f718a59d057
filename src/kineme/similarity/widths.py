"""Kernel widths, estimated from the typical distances of movements, with labels and without."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.sampling import evenly_spaced
from kineme.similarity.described import Described, squared_distances
from kineme.validation import Array

#: Width as a share of the typical distance to the nearest movement of another class, an impostor.
SHARE = 0.4
#: Quantity of a representation -> width as a share of the typical size, where there is one movement alone: about the
#: median over eight sets of handwriting, gestures in space, signs, words and exercises.
ALONE = {"positions": 0.2, "forcing": 0.3, "elastic": 0.16, "turning": 0.045, "cloud": 0.15}
_LEAST = 0.01  # share of the typical size; smallest distance that is used
_SAME = 1e-3  # share of the size; smaller distances are rounding errors of single precision
_COPIES = 1e-4  # share of the size; unlabeled movements at smaller distances are copies
_ROWS = 500  # movements that widths are estimated from, at most
_BEGUN_MOVEMENTS = 60  # the same, where each has many beginnings
_NO_IMPOSTOR = 0.1  # width where no two beginnings differ


def impostor_widths(described: Described, labels: NDArray[np.generic]) -> Array:
    """Estimate the width sigma_r of each representation: a share of the typical distance to the nearest other class.

    At 0.4 of it, a movement at the distance of an impostor has a similarity of exp(-3), under 0.05: movements closer
    than the nearest impostor have nearly all influence. With one class, any other movement is the impostor. If classes
    coincide, as N and Z do under any rotation, the width is a hundredth of the movements' size. Estimated from at most
    500 evenly spaced movements, which bounds the cost.

    Returns (R,). Raises `SpecificationError`: all movements are the same, or there is only one.
    """
    chosen = evenly_spaced(len(labels), _ROWS)
    some, owners = described.take(chosen), labels[chosen]
    sizes = some.sizes()
    nearest = zip(_nearest_of_others(some, owners, chosen), sizes, strict=True)
    widths = [_share_of_median(distances, _SAME * size, SHARE) for distances, size in nearest]
    if all(width is None for width in widths):
        raise SpecificationError(
            "expected training movements that differ, got one movement or all the same; add demonstrations"
        )
    # Movements that do not differ in one representation have a similarity of 1 there.
    return np.maximum([np.inf if width is None else width for width in widths], _LEAST * sizes)


def lone_widths(described: Described, quantities: Sequence[str]) -> Array:
    """Return the width sigma_r of each representation, (R,), of one movement alone: a share of its size, see `ALONE`.

    Raises `SpecificationError`: the movement does not move.
    """
    sizes = described.sizes()
    if not sizes[: len(described.blocks)].all():
        raise SpecificationError("expected a training movement that moves, got one at rest; add demonstrations")
    return np.array([ALONE[quantity] for quantity in quantities]) * sizes


def beginning_widths(beginnings: Described, labels: NDArray[np.generic]) -> Array:
    """Return widths (R,) for m movements with G beginnings each, which follow each other: rows (m * G).

    The same share of the typical distance from a beginning to the nearest one of another class, at any progress. 0.1
    where no two beginnings differ.
    """
    n_progress = len(beginnings) // len(labels)
    chosen = evenly_spaced(len(labels), _BEGUN_MOVEMENTS)
    rows = (chosen[:, None] * n_progress + np.arange(n_progress)).ravel()
    owners, movements = np.repeat(labels[chosen], n_progress), np.repeat(chosen, n_progress)
    widths = [
        _share_of_median(distances, 0.0, SHARE)
        for distances in _nearest_of_others(beginnings.take(rows), owners, movements)
    ]
    return np.array([_NO_IMPOSTOR if width is None else width for width in widths])


def gap_widths(described: Described) -> Array:
    """Return the width sigma_r of each representation: 0.4 of the typical distance to the first movement beyond a gap.

    `impostor_widths` takes that share of the distance to the nearest movement of another class. Without labels the
    class is told by its edge: sorted by distance, ``d_1 <= d_2 <= ...``, the neighbors of a movement are first those of
    its own class, then the others, and where classes are apart the largest ratio ``d_{k+1} / d_k`` lies between them.
    ``d_{k+1}`` replaces the distance to the nearest impostor; the median over movements is robust to some whose largest
    ratio is elsewhere. k runs from 1 to n / 2, so neither the number of classes nor their sizes are assumed. A fixed k
    would be within the class for some sizes and beyond it for others.

    This is the gap by which agglomerative clusterings are cut (the largest step of merge heights), looked for around
    each movement by itself, where the scale is local.

    Returns (R,). Raises `SpecificationError`: fewer than three movements, or all the same.
    """
    n = len(described)
    if n < 3:
        raise SpecificationError(
            f"expected at least 3 movements to tell classes apart without labels, got {n}; add some"
        )
    chosen = evenly_spaced(n, _ROWS)
    widths = []
    for squares, same in zip(
        squared_distances(described.take(chosen), described), _COPIES * described.sizes(), strict=True
    ):
        squares[np.arange(len(chosen)), chosen] = -1.0  # itself first
        ordered = np.sqrt(np.maximum(np.sort(squares, axis=1)[:, 1:], 0.0))
        widths.append(_share_of_median(_beyond_the_gap(ordered, same), same, SHARE))
    if all(width is None for width in widths):
        raise SpecificationError("expected movements that differ, got copies of one movement; add other movements")
    return np.array([np.inf if width is None else width for width in widths])


def median_distances(described: Described) -> Array:
    """Return the median distance of two different movements in each representation, (R,); NaN for one movement."""
    pairs = ~np.eye(len(described), dtype=bool)
    if not pairs.any():
        return np.full(described.n_representations, np.nan)
    return np.array([np.sqrt(np.median(squares[pairs])) for squares in squared_distances(described, described)])


def _nearest_of_others(described: Described, owners: NDArray[np.generic], each: NDArray[np.generic]) -> list[Array]:
    """Per representation, distances (n,) to the nearest row of another owner; of another `each` if all have one."""
    own = owners[:, None] == owners
    if own.all():
        own = each[:, None] == each
    nearest = []
    for squares in squared_distances(described, described):
        squares[own] = np.inf
        nearest.append(np.sqrt(squares.min(axis=1, initial=np.inf)))
    return nearest


def _share_of_median(distances: Array, same: float, share: float) -> float | None:
    """Return the `share` of the median of those distances that are finite and above `same`; None if none is."""
    apart = distances[np.isfinite(distances) & (distances > same)]
    return share * float(np.median(apart)) if len(apart) else None


def _beyond_the_gap(ordered: Array, same: float) -> Array:
    """Return first distance (k,) beyond the largest ratio, of distances (k, n - 1) in rising order."""
    ordered = np.maximum(ordered, same)
    last = max(2, (ordered.shape[1] + 1) // 2)
    logs = np.log(np.maximum(ordered[:, :last], np.finfo(np.float64).tiny))  # all are 0 where nothing moves
    ratios = np.diff(logs, axis=1)
    return np.asarray(np.take_along_axis(ordered, ratios.argmax(axis=1)[:, None] + 1, axis=1)[:, 0])
