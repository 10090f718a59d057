"""Variants of a primitive that are smooth in acceleration and keep start, goal and how they are reached.

The weights of one dimension are changed with the covariance ``(L'L)^-1``, L being second differences with zeros beyond
both ends, as in E. Theodorou, J. Buchli and S. Schaal, "A Generalized Path Integral Control Approach to Reinforcement
Learning", JMLR 11, 2010, and M. Kalakrishnan et al., "STOMP", ICRA 2011. Theirs are differences of the
path; weights are accelerations, so here the acceleration itself has no kinks. That covariance is conditioned on no
change of position and velocity at the end.
"""

from __future__ import annotations

import numpy as np

from kineme.primitives.condition import condition
from kineme.primitives.discrete.operators import decoder
from kineme.primitives.discrete.specification import Specification
from kineme.validation import Array

_NEGLIGIBLE = 1e-2  # of the largest: directions that change the path less are not explored


def exploration_factor(dmp: Specification) -> Array:
    """F of shape (r, N), ``F.T @ F`` being the covariance of one dimension's change of W.

    The standard deviation of the path is 1 where it is largest; rows are in the order of how much they change the path.
    """
    n_basis = dmp.n_basis
    L = np.diff(np.eye(n_basis + 4, n_basis, -2), n=2, axis=0)
    smooth = np.linalg.inv(np.linalg.qr(L, mode="r")).T  # F0' F0 = (L'L)^-1
    response = decoder(dmp, dmp.n_points)
    kept = condition(smooth, response.Phi[:2, -1]).factor
    U, S, paths = np.linalg.svd(kept @ response.Phi[0].T, full_matrices=False)
    chosen = _NEGLIGIBLE * S[0] < S
    largest = np.linalg.norm(S[chosen, None] * paths[chosen], axis=0).max()
    return np.asarray(U[:, chosen].T @ kept / largest)
