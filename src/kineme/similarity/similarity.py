"""The kernel averaged over representations: the similarity of movements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Procrustes
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.sampling import evenly_spaced
from kineme.similarity.describe import Described, describe, squared_distances
from kineme.similarity.specification import LOG_MEANS, Compares
from kineme.validation import Array

_LEAST_WEIGHT = 0.02  # smaller weights become 0, to save the time of their representation
_OWN = 0.5  # of the fitted weight always belongs to the representations' own weights
_MOST_SWEEPS, _SWEEP_CHANGE = 10_000, 1e-9  # of least squares, and the change of weights, relative, that ends them


def own_weights(similarity: AveragedSimilarity, described: Described, labels: NDArray[Any]) -> Array:
    """Return the weights of the representations themselves, in the arithmetic mean; equal ones in the others."""
    own = np.array(described.own_weights or 0.0)
    if similarity.mean != "arithmetic" or not own.any():
        return equal_weights(similarity, described, labels)
    return own / own.sum()


def auto_weights(similarity: AveragedSimilarity, described: Described, labels: NDArray[Any]) -> Array:
    """Return `fitted_weights` where that can be: two movements of some class, two classes, an arithmetic mean."""
    n_classes = len(np.unique(labels))
    fits = similarity.mean == "arithmetic" and 1 < n_classes < len(labels)
    return (fitted_weights if fits else own_weights)(similarity, described, labels)


def equal_weights(similarity: AveragedSimilarity, described: Described, labels: NDArray[Any]) -> Array:
    """Return the same weight for each."""
    return np.full(described.n_representations, 1.0 / described.n_representations)


def fitted_weights(similarity: AveragedSimilarity, described: Described, labels: NDArray[Any]) -> Array:
    """Return half of the weight as `aligned_weights` fits it, half as the representations' own weights.

    The fitted weights are those of representations that separate the training movements. A representation that does
    not help on them may still be needed for perturbations that they do not contain, so each keeps half of its own.

    Raises `SpecificationError`: another mean than the arithmetic one, which weights are fitted for.
    """
    if similarity.mean != "arithmetic":
        raise SpecificationError(
            f"expected weights='fitted' with mean='arithmetic', got it with mean={similarity.mean!r}"
        )
    own = own_weights(similarity, described, labels)
    return np.asarray((1.0 - _OWN) * aligned_weights(similarity, described, labels) + _OWN * own)


def aligned_weights(similarity: AveragedSimilarity, described: Described, labels: NDArray[Any]) -> Array:
    """Return weights w >= 0 with which the average of the kernels is most like the kernel of the labels.

    Minimizes ``|sum_r w_r K_r - Y|`` over all pairs of different movements, K_r and Y (1 for a pair of one class, else
    0) centered, which up to its length is the w of largest alignment (Cortes, Mohri, Rostamizadeh, "Algorithms for
    learning kernels based on centered alignment", Journal of Machine Learning Research 13, 2012, Proposition 9). The
    diagonal is left out: a movement is like itself in every representation, which distinguishes none.

    - `similarity`: of equal weights.
    - `described`: in R representations.
    - `labels` (n,): in the order of the rows; at most 500 evenly spaced movements are compared.

    Returns (R,): summing to 1; weights below 0.02 are 0.
    """
    chosen = evenly_spaced(len(labels), _ROWS)
    some = described.take(chosen)
    same = (labels[chosen, None] == labels[None, chosen]).astype(float)
    kernels = np.stack([_centered(kernel) for kernel in np.exp(similarity.logs(some, some))])
    weights = _nonnegative_least_squares(kernels @ kernels.T, kernels @ _centered(same))
    weights = np.where(weights >= _LEAST_WEIGHT * weights.sum(), weights, 0.0)
    if not weights.any():  # no kernel is aligned with that of the labels
        return equal_weights(similarity, described, labels)
    return np.asarray(weights / weights.sum())


def _nonnegative_least_squares(gram: Array, target: Array) -> Array:
    """Return w >= 0 that minimizes ``w^T gram w / 2 - target^T w``, one number after the other until none changes.

    `scipy.optimize.nnls` finds the same; its import takes as long as recognizing hundreds of recordings. (V. Franc, V.
    Hlavac, M. Navara, "Sequential coordinate-wise algorithm for the non-negative least squares problem", CAIP 2005.)
    """
    # Python's own numbers: arrays of so few take ten times as long, with the same results to the last bit.
    rows, w, gradient = gram.tolist(), [0.0] * len(target), (-target).tolist()
    used = np.flatnonzero(gram.diagonal() > 0).tolist()
    for sweep in range(_MOST_SWEEPS):
        largest = 0.0
        for r in used:
            changed = max(0.0, w[r] - gradient[r] / rows[r][r])
            step = changed - w[r]
            if step:
                gradient = [slope + step * entry for slope, entry in zip(gradient, rows[r], strict=True)]
            w[r], largest = changed, max(largest, abs(step))
        if largest <= _SWEEP_CHANGE * max(w):
            break
        if sweep % 50 == 49:  # which weights are above 0 seldom changes any more: solve for those at once
            free = np.array(w) > 0
            system = np.where(np.outer(free, free), gram, gram.max() * np.eye(len(w)))
            if np.linalg.cond(system) < 1e12:
                exact = np.linalg.solve(system, np.where(free, target, 0.0))
                if (exact >= 0).all() and (gram @ exact - target >= -_SWEEP_CHANGE * np.abs(target).max()).all():
                    return np.asarray(exact)
    return np.array(w)


def given_weights(weights: ArrayLike, n: int) -> Array:
    """Return a user's weights, scaled to a sum of 1.

    Raises `SpecificationError`: not one finite number from 0 for each of the n representations, or all 0.
    """
    try:
        array = np.asarray(weights, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != (n,) or not np.isfinite(array).all() or (array < 0).any() or not array.any():
        raise SpecificationError(
            f"expected weights to be 'auto', 'own', 'equal', 'fitted' or {n} numbers from 0, not all 0, one for each "
            f"representation, got {weights!r}"
        )
    array = array / array.max()  # so that the sum does not overflow
    return np.asarray(array / array.sum())


#: Name -> what computes the weights (R,), summing to 1.
WEIGHTS: dict[str, Callable[[AveragedSimilarity, Described, NDArray[Any]], Array]] = {
    "auto": auto_weights,
    "own": own_weights,
    "equal": equal_weights,
    "fitted": fitted_weights,
}


def _centered(gram: Array) -> Array:
    """Return the pairs of different movements, after rows and columns are centered."""
    gram, n = gram.copy(), len(gram)
    # So that the diagonal does not change the means.
    np.fill_diagonal(gram, (gram.sum(axis=1) - gram.diagonal()) / (n - 1))
    gram -= gram.mean(axis=0)
    gram -= gram.mean(axis=1, keepdims=True)
    return gram[~np.eye(n, dtype=bool)]


#: Width as a share of the typical distance to the nearest movement of another class, an impostor.
SHARE = 0.4
#: Quantity of a representation -> width as a share of the typical size, where there is one movement alone: about the
#: median over eight sets of handwriting, gestures in space, signs, words and exercises.
ALONE = {"positions": 0.2, "forcing": 0.3, "elastic": 0.16, "turning": 0.045, "cloud": 0.15}
_LEAST = 0.01  # share of the typical size; smallest distance that is used
_SAME = 1e-3  # share of the size; smaller distances are rounding errors of single precision, movements there copies
_ROWS = 500  # movements that widths are estimated from, at most
_BEGUN_MOVEMENTS = 60  # the same, where each has many beginnings
_NO_IMPOSTOR = 0.1  # width where no two beginnings differ

_TILE_PAIRS = 500_000  # at a time: each representation's kernel is held beside the average


@dataclass(frozen=True, eq=False)
class AveragedSimilarity:
    """An A-average of one RBF kernel per representation, each on its own distance, see `squared_distances`.

    ``k_r(a, b) = exp(-d_r(a, b)^2 / (2 sigma_r^2))`` and ``K = mean_r k_r``, or ``sum_r w_r k_r``. Each kernel is
    narrow and bounded: a representation in which two movements are far contributes nothing, while in a sum of distances
    it would dominate the others. Logarithms keep the order of movements that are far in every representation, where
    each k_r underflows.

    The arithmetic mean is positive semi-definite where each k_r is: with ``max_angle = 0`` and representations that are
    compared sample by sample. Procrustes distances and those of pairs are not Euclidean, and no claim is made for them.
    """

    procrustes: Procrustes
    widths: Array  # (R,), the sigma_r
    mean: str = "arithmetic"
    weights: Array | None = None  # (R,) or None, at least 0, summing to 1; equal if None

    def squared_distances(self, A: Described, B: Described) -> Array:
        """Return squared distances in each representation, shape (R, n, m)."""
        return squared_distances(A, B)

    def logs_at(self, squares: Array) -> Array:
        """Return logarithms of each kernel times R times its weight, of squared distances (R, n, m)."""
        logs = np.asarray(squares / (-2.0 * self.widths**2)[:, None, None])
        if self.weights is not None and (self.weights != self.weights[0]).any():
            logs += self.log_weights()[:, None, None]
        return logs

    def logs(self, A: Described, B: Described) -> Array:
        """Return the logarithms of each representation's kernel times R times its weight, shape (R, n, m)."""
        return self.logs_at(self.squared_distances(A, B))

    def log_average(self, A: Described, B: Described) -> Array:
        """Return the logarithms of the averaged kernel, shape (n, m)."""
        return LOG_MEANS[self.mean](self.logs(A, B))

    def by_rows(self, n: int) -> AveragedSimilarity:
        """Return the average over the first n representations alone; of equal weights where theirs are all 0."""
        if n == len(self.widths):
            return self
        weights = None if self.weights is None or not self.weights[:n].any() else self.weights[:n]
        weights = None if weights is None else weights / weights.sum()
        return replace(self, widths=self.widths[:n], weights=weights)

    def log_weights(self) -> Array:
        """Return logarithms of R times the weights, (R,): -inf for positions of weight 0, which give the rotation."""
        if self.weights is None:
            return np.zeros(len(self.widths))
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(len(self.weights) * self.weights))

    def widened(self, factor: float) -> AveragedSimilarity:
        """Return the same average of kernels `factor` times as wide."""
        return replace(self, widths=factor * self.widths)


def similarities(
    movements: Described | MovementsLike, like: Compares | None = None, widths: ArrayLike | None = None
) -> Array:
    """Return the averaged kernel ``K(a, b)`` between all movements, shape (n, n), from 0 to 1 and 1 on the diagonal.

    Parameters
    ----------
    movements : Described, or movements as `Demonstrations.of` accepts them
    like : Recognizer, Comparison or ComparisonSpecification, optional
        Whose representations, invariances and mean to take; it need not be fitted, and its labels are not used.
    widths : array_like of shape (R,), optional
        Of each representation; by default `gap_widths`.
    """
    described = describe(movements, like)
    K = compare(averaged(described, widths), described, described)
    K = 0.5 * (K + K.T)
    np.fill_diagonal(K, 1.0)
    return np.asarray(K)


def averaged(described: Described, widths: ArrayLike | None = None) -> AveragedSimilarity:
    """Return the averaged kernel at the widths given, or at those that the movements suggest, see `gap_widths`.

    Raises
    ------
    SpecificationError
        Not one positive width for each representation.
    """
    sigma = gap_widths(described) if widths is None else np.asarray(widths, dtype=np.float64)
    n = described.n_representations
    if sigma.shape != (n,) or not (sigma > 0).all():
        raise SpecificationError(
            f"expected widths to be {n} numbers above 0, one for each representation, got {widths!r}"
        )
    return AveragedSimilarity(described.procrustes, sigma, described.mean)


def compare(similarity: AveragedSimilarity, A: Described, B: Described) -> Array:
    """Return the averaged kernel between movements, shape (n, m)."""
    K = np.empty((len(A), len(B)))
    step = max(1, _TILE_PAIRS // max(1, len(B)))
    for start in range(0, len(A), step):
        rows = slice(start, start + step)
        K[rows] = np.exp(similarity.log_average(A.take(rows), B))
    return K


def impostor_widths(described: Described, labels: NDArray[np.generic]) -> Array:
    """Estimate the width sigma_r of each representation: a share of the typical distance to the nearest other class.

    At 0.4 of it, a movement at the distance of an impostor has a similarity of exp(-3), under 0.05: movements closer
    than the nearest impostor have nearly all influence. With one class, any other movement is the impostor. If classes
    coincide, as N and Z do under any rotation, the width is a hundredth of the movements' size. Estimated from at most
    500 evenly spaced movements, which bounds the cost.

    Returns (R,). Raises `SpecificationError`: all movements are the same, or there is only one, or those of one label
    are there with another one too.
    """
    chosen = evenly_spaced(len(labels), _ROWS)
    some, owners = described.take(chosen), labels[chosen]
    sizes = some.sizes()
    nearest = zip(_nearest_of_others(some, owners, chosen), sizes, strict=True)
    widths = [_share_of_median(distances, _SAME * size) for distances, size in nearest]
    if None in widths:
        _check_labels(some, owners, [width is None for width in widths])
    if all(width is None for width in widths):
        raise SpecificationError(
            "expected training movements that differ, got one movement or all the same; add demonstrations"
        )
    return np.maximum(_as_wide_as_twins(widths, some), _LEAST * sizes)


def _check_labels(described: Described, owners: NDArray[np.generic], without_width: list[bool]) -> None:
    """Refuse copies with two labels that leave a representation without a width in which movements differ."""
    copies, differ = owners[:, None] != owners, False
    largest = (_SAME * described.sizes()) ** 2
    for squares, same, is_without in zip(squared_distances(described, described), largest, without_width, strict=True):
        copies &= squares <= same
        differ |= is_without and bool((squares > same).any())
    if differ and copies.any():
        first, second = owners[np.argwhere(copies)[0]].tolist()
        raise SpecificationError(
            f"expected labels whose movements differ, got the same ones with {first!r} and {second!r}; merge the labels"
        )


def _as_wide_as_twins(widths: list[float | None], described: Described) -> Array:
    """Return widths (R,), those in detail as of the same quantity that is not, if movements differ in that.

    Without a rotation movements of one class are farther apart, and wider kernels would count where only the rotated
    ones tell. Movements that do not differ in one representation have a similarity of 1 there.
    """
    own = np.array([np.inf if width is None else width for width in widths])
    twins = own[described.coarse()]
    return np.where(np.isfinite(twins), twins, own)


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
        _share_of_median(distances, 0.0) for distances in _nearest_of_others(beginnings.take(rows), owners, movements)
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
        squared_distances(described.take(chosen), described), _SAME * described.sizes(), strict=True
    ):
        squares[np.arange(len(chosen)), chosen] = -1.0  # itself first
        ordered = np.sqrt(np.maximum(np.sort(squares, axis=1)[:, 1:], 0.0))
        widths.append(_share_of_median(_beyond_the_gap(ordered, same), same))
    if all(width is None for width in widths):
        raise SpecificationError("expected movements that differ, got copies of one movement; add other movements")
    return _as_wide_as_twins(widths, described)


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


def _share_of_median(distances: Array, same: float) -> float | None:
    """Return `SHARE` of the median of those distances that are finite and above `same`; None if none is."""
    apart = distances[np.isfinite(distances) & (distances > same)]
    return SHARE * float(np.median(apart)) if len(apart) else None


def _beyond_the_gap(ordered: Array, same: float) -> Array:
    """Return first distance (k,) beyond the largest ratio, of distances (k, n - 1) in rising order."""
    ordered = np.maximum(ordered, same)
    last = max(2, (ordered.shape[1] + 1) // 2)
    logs = np.log(np.maximum(ordered[:, :last], np.finfo(np.float64).tiny))  # all are 0 where nothing moves
    ratios = np.diff(logs, axis=1)
    return np.asarray(np.take_along_axis(ordered, ratios.argmax(axis=1)[:, None] + 1, axis=1)[:, 0])
