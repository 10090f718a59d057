"""The most probable changes of weights that meet what is asked for, and stretches as closely as they can be met.

The points of a stretch may be more than the basis functions can meet, or noisy: met as closely as possible, the path
would swing far out beside them. So each has a deviation of its own, of a millionth of what it has under the covariance.
Where the path swings, larger ones are tried: a stretch may be missed so that the path is led less far away. How far it
swings with both, `python -m bench --only via_points` measures on the shapes of LASA.
"""

from __future__ import annotations

import numpy as np

from kineme.dmp.condition import condition
from kineme.dmp.discrete.operators import decoder
from kineme.dmp.discrete.specification import Specification
from kineme.validation import Array

#: Of a row's own deviation: of the points of a stretch, which may be more than can be met.
SLACK = 1e-6
_SLACKS = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
_SWING = 3.0  # times the largest number that is missing: a change that is larger swings
_PRICE = 0.03  # of a change, beside what it leaves missing
_PER_BASIS = 3  # samples of a change for each basis function


def changes(factor: Array, observed: Array, errors: Array, slack: Array) -> Array:
    """The most probable changes (m, p) with ``observed @ change = errors`` (m, k), of which NaN need not be met.

    `slack` (k,) is the deviation of each, as a share of what it is under the covariance ``factor.T @ factor``.
    """
    slack = slack * np.linalg.norm(observed @ factor.T, axis=1)
    known = np.isfinite(errors)
    if known.all():
        return np.asarray(errors @ condition(factor, observed, slack).gain)
    patterns, which = np.unique(known, axis=0, return_inverse=True)
    found = np.empty((len(errors), observed.shape[1]))
    for i, pattern in enumerate(patterns):  # of free dimensions: few, however many movements
        rows = np.flatnonzero(which.ravel() == i)
        found[rows] = errors[rows][:, pattern] @ condition(factor, observed[pattern], slack[pattern]).gain
    return found


def loose_changes(looks: Array, factor: Array, observed: Array, errors: Array, stretch: Array) -> Array:
    """The same (m, p), of the weights of one or more dimensions of one movement.

    The rows of a stretch, those where `stretch` (k,) is 1 and not 0, are met so closely that the path does not swing,
    which `looks` (N, T) shows: from the weights of a dimension to its path.
    """
    found = changes(factor, observed, errors, SLACK * stretch)
    if not stretch.any():
        return found
    missing = np.where(np.isnan(errors), 0.0, errors)
    rows = np.flatnonzero(_swing(looks, found) > _SWING * np.abs(missing).max(axis=1))
    if len(rows):
        tried = np.stack([found[rows], *(changes(factor, observed, errors[rows], k * stretch) for k in _SLACKS)])
        left = np.where(np.isnan(errors[rows]), 0.0, missing[rows] - tried @ observed.T)[:, :, stretch > 0.0]
        cost = np.abs(left).max(axis=2) + _PRICE * np.stack([_swing(looks, one) for one in tried])
        found[rows] = tried[cost.argmin(axis=0), np.arange(len(rows))]
    return found


def _swing(looks: Array, changed: Array) -> Array:
    """The largest change of a coordinate, anywhere along the paths (m,)."""
    paths = changed.reshape(-1, len(looks)) @ looks
    return np.asarray(np.abs(paths).max(axis=1).reshape(len(changed), -1).max(axis=1))


def looks_of(dmp: Specification) -> Array:
    """From weights to the path at as many times as show how far a change leads (N, T)."""
    return decoder(dmp, _PER_BASIS * dmp.n_basis).Phi[0].T
