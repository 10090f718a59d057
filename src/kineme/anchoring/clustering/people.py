"""Links between the movements of people who are known: each is the other's nearest.

Source: L. Haghverdi et al., "Batch effects in single-cell RNA-sequencing data are corrected by matching mutual nearest
neighbors", Nature Biotechnology 36, 2018. A person's repetitions are each other's nearest neighbors; among the nearest
of all movements there may be none by another person, so neighbors are taken from each person in turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kineme.validation import Array

_SHARE = 0.5  # sum of all links by that of the similarities; with 1, classes that few people made are merged
_NEAREST = 5  # movements of a person, of which each counts less than the one before it


def link_people(similar: Array, near: Array, people: NDArray[np.intp]) -> Array:
    """Similarities W (n, n) with links added between people, half as strong in total.

    Among the movements of j's person, j is the p-th nearest to i, and among those of i's person i the q-th nearest to
    j. If both are among the five nearest and the people differ, the link of i and j is ``1 / (p q)``, up to a factor:
    one link suffices where each class was made once, and several connect repetitions. If one of the two people never
    made the class of i, its nearest movement by that person is, as a rule, nearer to others, and there is no link.

    Parameters
    ----------
    similar : ndarray of shape (n, n)
        W, as `kineme.anchoring.clustering.fusion.fuse` gives it.
    near : ndarray of shape (n, n)
        By which the nearest are found; greater is nearer.
    people : ndarray of shape (n,)
        Who made each movement, as numbers.
    """
    n = len(similar)
    share = np.zeros((n, n))  # 1 / p
    for one in np.unique(people):
        own = np.flatnonzero(people == one)
        nearest = own[np.argsort(-near[:, own], axis=1, kind="stable")[:, :_NEAREST]]
        share[np.arange(n)[:, None], nearest] = 1.0 / np.arange(1, nearest.shape[1] + 1)
    links = np.where(people[:, None] != people, share * share.T, 0.0)
    total = float(links.sum())
    return np.asarray(similar + (_SHARE * float(similar.sum()) / total if total > 0 else 0.0) * links)
