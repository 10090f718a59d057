"""Which representations speak, and how loudly: chosen on the training movements where they suffice."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.comparison.representation import DEFAULT_REPRESENTATIONS, Representation
from kineme.comparison.sampling import evenly_spaced
from kineme.comparison.similarity import AveragedSimilarity
from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Prepared
from kineme.validation import Array

ENOUGH = 8  # demonstrations of every class, from which on they choose
_ROWS = 500  # movements that the choice is made on, at most
_LEAST = 0.02  # a representation with a smaller share costs more than it says

#: What is chosen from where nothing is prescribed: both quantities over time, arc length, and between.
CANDIDATES = (
    *DEFAULT_REPRESENTATIONS,
    Representation("positions", arc_share=0.0),
    Representation("positions", arc_share=0.5),
    Representation("forcing", arc_share=0.5),
)


def suffices(per_class: NDArray[Any]) -> bool:
    """Whether there are demonstrations enough to choose representations on."""
    return len(per_class) > 1 and int(per_class.min()) >= ENOUGH


def chosen_weights(
    similarity: AveragedSimilarity, views: tuple[Prepared, ...], labels: NDArray[Any], n_usual: int
) -> Array:
    """Half of them chosen by `aligned_weights`, half equal on the first `n_usual` representations, (R,).

    The training movements know which representation is right among them. The other half is for what they have not
    shown: what the usual representations see is never unheard.
    """
    usual = np.arange(len(views)) < n_usual
    return np.asarray(0.5 * aligned_weights(similarity, views, labels) + 0.5 * usual / n_usual)


def aligned_weights(similarity: AveragedSimilarity, views: tuple[Prepared, ...], labels: NDArray[Any]) -> Array:
    """Weights w >= 0 with which the average of the kernels is most like the kernel of the labels.

    Minimizes ``|sum_r w_r K_r - Y|`` over all pairs of different movements, K_r and Y (1 for a pair of one class, else
    0) centered, which up to its length is the w of largest alignment (Cortes, Mohri, Rostamizadeh, "Algorithms for
    learning kernels based on centered alignment", Journal of Machine Learning Research 13, 2012, Proposition 9). We
    leave the diagonal out: a movement is like itself in every representation, which says nothing.

    Parameters
    ----------
    similarity : AveragedSimilarity
        Of equal weights.
    views : tuple of R Prepared
    labels : ndarray of shape (n,)
        In the order of the rows; at most 500 evenly spaced movements are compared.

    Returns
    -------
    ndarray of shape (R,)
        Summing to 1; shares below 0.02 are 0.
    """
    from scipy.optimize import nnls

    chosen = evenly_spaced(len(labels), _ROWS)
    some = tuple(one.take(chosen) for one in views)
    same = (labels[chosen, None] == labels[None, chosen]).astype(float)
    kernels = np.stack([_centered(one) for one in np.exp(similarity.logs(some, some))], axis=1)
    weights, _ = nnls(kernels, _centered(same))
    weights = np.where(weights >= _LEAST * weights.sum(), weights, 0.0)
    if not weights.any():  # no kernel knows the classes
        return np.full(len(views), 1.0 / len(views))
    return np.asarray(weights / weights.sum())


def given_weights(weights: ArrayLike, n: int) -> Array:
    """Weights as a user gave them, summing to 1.

    Raises
    ------
    SpecificationError
        Not one finite number from 0 for each of the n representations, or all 0.
    """
    try:
        array = np.asarray(weights, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.empty(0)
    if array.shape != (n,) or not np.isfinite(array).all() or (array < 0).any() or not array.any():
        raise SpecificationError(
            f"expected weights to be 'auto', 'equal' or {n} numbers from 0, not all 0, one for each representation, "
            f"got {weights!r}"
        )
    array = array / array.max()  # the sum of what is left is a number, however large the weights are
    return np.asarray(array / array.sum())


def _centered(gram: Array) -> Array:
    """The pairs of different movements, after rows and columns are centered."""
    gram, n = gram.copy(), len(gram)
    np.fill_diagonal(gram, (gram.sum(axis=1) - gram.diagonal()) / (n - 1))  # no say of its own
    gram -= gram.mean(axis=0)
    gram -= gram.mean(axis=1, keepdims=True)
    return gram[~np.eye(n, dtype=bool)]
