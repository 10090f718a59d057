"""The parameters of tasks: what users give, checked; those to generate for, beside the demonstrated ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError, TrajectoryError
from kineme.validation import LARGEST, Array, as_numbers

_SLACK = 1e-9  # of the range: a demonstrated parameter is inside, whatever the rounding
_ALONE = 1e-9  # of the leverage: a demonstration that differs from all others alone


def demonstrated_parameters(parameters: ArrayLike, n: int) -> Array:
    """The parameters (n, k) of n demonstrations, as a copy.

    Raises
    ------
    TrajectoryError
        Another number or shape, not finite, equal in all demonstrations or in all but one, or depending on each other;
        fewer than k + 2 demonstrations.
    """
    C = as_numbers(parameters, "parameters")
    C = C[:, None] if C.ndim == 1 else C
    if C.ndim != 2 or len(C) != n or not C.shape[1]:
        raise TrajectoryError(
            f"expected parameters of shape ({n},) or ({n}, k), those of each demonstration, got shape "
            f"{np.shape(parameters)}"
        )
    C, k = _finite(C), C.shape[1]
    if n < k + 2:
        raise TrajectoryError(
            f"expected at least {k + 2} demonstrations for {k} parameters, so that one can be left out, got {n}"
        )
    deviations = C - C.mean(axis=0)
    lengths = np.linalg.norm(deviations, axis=0)
    still = lengths <= 1e-12 * np.linalg.norm(C, axis=0)
    if still.any():
        j = int(np.argmax(still))
        raise TrajectoryError(
            f"expected parameter {j} to differ between demonstrations, got {C[0, j]:g} in all; leave it out"
        )
    if np.linalg.matrix_rank(deviations / lengths, tol=1e-9) < k:
        raise TrajectoryError(f"expected {k} parameters of which none follows from the others; leave out those that do")
    _check_alone(deviations / lengths)
    return C.copy()


def _check_alone(deviations: Array) -> None:
    """Refuse a demonstration without which the others say nothing about a parameter: it cannot be left out."""
    leverage = 1.0 / len(deviations) + np.sum(np.linalg.qr(deviations)[0] ** 2, axis=1)
    if leverage.max() > 1.0 - _ALONE:
        raise TrajectoryError(
            f"expected parameters that differ independently in all demonstrations but one, too, so that it can be left "
            f"out, got demonstration {np.argmax(leverage)} alone with its own; demonstrate another one like it"
        )


def task_parameters(parameters: ArrayLike, k: int) -> Array:
    """Parameters (m, k) of m tasks to generate for.

    Raises
    ------
    TrajectoryError
        Another number than the k demonstrated ones, or not finite.
    """
    C = as_numbers(parameters, "parameters")
    C = C.reshape(-1, 1) if k == 1 and C.ndim < 2 else np.atleast_2d(C)
    if C.ndim != 2 or C.shape[1] != k or not len(C):
        raise TrajectoryError(f"expected parameters of shape ({k},) or (m, {k}), got shape {np.shape(parameters)}")
    return _finite(C)


def check_range(C: Array, shown: Array) -> None:
    """Refuse parameters (m, k) outside the box around the demonstrated ones (n, k).

    Raises
    ------
    SpecificationError
        The first such parameter, and how far beyond the range it is.
    """
    lowest, highest = shown.min(axis=0), shown.max(axis=0)
    beyond = np.maximum(np.maximum(lowest - C, C - highest), 0.0)
    outside = beyond > _SLACK * (highest - lowest)
    if outside.any():
        i = int(np.argmax(outside.any(axis=1)))
        j = int(np.argmax(outside[i]))
        share = 100.0 * beyond[i, j] / (highest[j] - lowest[j])
        raise SpecificationError(
            f"parameters {i}: expected parameter {j} within the demonstrated range [{lowest[j]:.6g}, "
            f"{highest[j]:.6g}], got {C[i, j]:.6g}, {beyond[i, j]:.3g} or {share:.3g} % of the range beyond it; "
            "demonstrate it, or pass extrapolate=True"
        )


def _finite(C: Array) -> Array:
    usable = np.abs(C) <= LARGEST
    if not usable.all():
        i = int(np.argmin(usable.all(axis=1)))
        raise TrajectoryError(f"parameters {i}: expected finite numbers up to {LARGEST:g}, got {C[i].tolist()}")
    return C
