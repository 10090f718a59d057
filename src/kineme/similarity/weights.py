"""Weights of the representations: their own, equal, fitted to the training movements, or given."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError
from kineme.sampling import evenly_spaced
from kineme.similarity.described import Described
from kineme.similarity.representation import Representation
from kineme.similarity.similarity import AveragedSimilarity
from kineme.validation import Array

_ROWS = 500  # movements that they are fitted to, at most
_LEAST = 0.02  # smaller weights become 0, to save the time of their representation
_OWN = 0.5  # of the fitted weight always belongs to the representations' own weights

Representations = tuple[Representation, ...]


def own_weights(
    similarity: AveragedSimilarity, described: Described, labels: NDArray[Any], representations: Representations
) -> Array:
    """Return the weights of the representations themselves, in the arithmetic mean; equal ones in the others."""
    own = (
        np.array([representation.weight for representation in representations])
        if similarity.mean == "arithmetic"
        else None
    )
    return equal_weights(similarity, described, labels, representations) if own is None else own / own.sum()


def equal_weights(
    similarity: AveragedSimilarity, described: Described, labels: NDArray[Any], representations: Representations
) -> Array:
    """Return the same weight for each."""
    return np.full(len(representations), 1.0 / len(representations))


def fitted_weights(
    similarity: AveragedSimilarity, described: Described, labels: NDArray[Any], representations: Representations
) -> Array:
    """Return half of the weight as `aligned_weights` fits it, half as the representations' own weights.

    The fitted weights are those of representations that separate the training movements. A representation that does
    not help on them may still be needed for perturbations that they do not contain, so each keeps half of its own.

    Raises `SpecificationError`: another mean than the arithmetic one, which weights are fitted for.
    """
    if similarity.mean != "arithmetic":
        raise SpecificationError(
            f"expected weights='fitted' with mean='arithmetic', got it with mean={similarity.mean!r}"
        )
    own = own_weights(similarity, described, labels, representations)
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
    from scipy.optimize import nnls

    chosen = evenly_spaced(len(labels), _ROWS)
    some = described.take(chosen)
    same = (labels[chosen, None] == labels[None, chosen]).astype(float)
    kernels = np.stack([_centered(kernel) for kernel in np.exp(similarity.logs(some, some))], axis=1)
    weights, _ = nnls(kernels, _centered(same))
    weights = np.where(weights >= _LEAST * weights.sum(), weights, 0.0)
    if not weights.any():  # no kernel is aligned with that of the labels
        return np.full(described.n_representations, 1.0 / described.n_representations)
    return np.asarray(weights / weights.sum())


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
            f"expected weights to be 'auto', 'equal', 'fitted' or {n} numbers from 0, not all 0, one for each "
            f"representation, got {weights!r}"
        )
    array = array / array.max()  # so that the sum does not overflow
    return np.asarray(array / array.sum())


#: Name -> what computes the weights (R,), summing to 1.
WEIGHTS: dict[str, Callable[[AveragedSimilarity, Described, NDArray[Any], Representations], Array]] = {
    "auto": own_weights,
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
