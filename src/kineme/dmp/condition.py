"""Numbers with a Gaussian distribution, conditioned on what some linear functions of them are: one small linear solve.

The covariance is kept as a factor F, ``Sigma = F' F``, and never formed. With ``B = F A'`` and ``B = Q R``,

    Sigma A' (A Sigma A' + diag(s^2))^-1 e = F' Q R'^-1 e,

where s is stacked below B, if it is not 0, before it is decomposed. The condition number of B is not squared, so what
is observed exactly is met to rounding, at close times too. The change is the most probable one: among all that meet e
it has the least Mahalanobis norm.

Source: Y. Zhou, J. Gao, T. Asfour, "Learning Via-Movement Primitives with Inter- and Extrapolation Capabilities",
IROS 2019, for the weights of movements; the formula is that of any Gaussian.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from kineme.errors import SpecificationError
from kineme.validation import Array

_DEPENDENT = 1e-11  # of the largest number on the diagonal of R: smaller ones are rounding


class Conditioned(NamedTuple):
    """Distribution of p numbers after k linear functions of them were observed."""

    gain: Array  # (k, p): the mean changes by e @ gain, with e (k,) or (n, k) observed minus expected
    factor: Array  # (r, p) of the covariance that remains


def condition(factor: Array, observed: Array, deviation: float | Array = 0.0) -> Conditioned:
    """Condition a Gaussian with covariance ``factor.T @ factor`` on observations of ``observed @ numbers``.

    - `factor` (r, p).
    - `observed` (k, p): A, the linear functions that are observed.
    - `deviation` (k,): s, standard deviation of each observation, in its own unit; 0 is exact.

    Raises `SpecificationError`: exact observations of which one follows from the others, or of what the covariance does
    not allow to vary.
    """
    whitened = factor @ observed.T  # B (r, k)
    r, k = whitened.shape
    if not k:
        return Conditioned(np.zeros_like(observed), factor)
    s = np.broadcast_to(np.asarray(deviation, dtype=float), (k,))
    stacked = np.vstack((whitened, np.diag(s))) if s.any() else whitened
    unit = np.linalg.norm(stacked, axis=0)  # rows in different units: a position, an acceleration
    if len(stacked) < k or not unit.all():
        raise SpecificationError(_DEPENDENCE.format(k=k, r=min(r, int(np.count_nonzero(unit)))))
    Q, R = qr(stacked / unit, mode="economic")
    diagonal = np.abs(np.diag(R))
    if (diagonal <= _DEPENDENT * diagonal.max()).any():
        raise SpecificationError(_DEPENDENCE.format(k=k, r=int((diagonal > _DEPENDENT * diagonal.max()).sum())))
    Q = Q[:r]
    along = Q.T @ factor
    # R has nothing below its diagonal, so this is back substitution; SciPy's own waits for threads, milliseconds long.
    return Conditioned(np.linalg.solve(R, along) / unit[:, None], factor - _shrink(Q) @ along)


_DEPENDENCE = (
    "expected observations of which none follows from the others, got {k} of which {r} can be met independently; leave "
    "some out, move their times apart, or use more basis functions"
)


def _shrink(Q: Array) -> Array:
    """S (r, k) with ``(I - S Q')' (I - S Q') = I - Q Q'``: the symmetric square root, from the thin decomposition."""
    U, singular, Vt = np.linalg.svd(Q, full_matrices=False)
    cosine = np.sqrt(np.maximum(0.0, 1.0 - singular**2))
    share = (1.0 - cosine) / np.where(singular > 0, singular, 1.0)
    return np.asarray((U * share) @ Vt)
