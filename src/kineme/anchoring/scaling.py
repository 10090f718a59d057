"""Places in the plane by distances alone."""

from __future__ import annotations

import numpy as np

from kineme.validation import Array


def classical_scaling(distances: Array) -> tuple[Array, float]:
    """Positions (s, 2) in the plane whose distances are close to those given, and the share of their squares kept.

    Classical multidimensional scaling: the two leading eigenvectors of ``-J D^2 J / 2``, J taking out the mean.

    Source: W. S. Torgerson, "Multidimensional scaling: I. Theory and method", Psychometrika 17, 1952.
    """
    squares = distances**2
    centered = squares - squares.mean(axis=0)
    B = -0.5 * (centered - centered.mean(axis=1, keepdims=True))
    values, vectors = np.linalg.eigh(0.5 * (B + B.T))
    positive = np.maximum(values[::-1], 0.0)
    positions = np.zeros((len(distances), 2))
    k = min(2, len(distances))
    leading = vectors[:, ::-1][:, :k]
    sign = np.sign(leading[np.abs(leading).argmax(axis=0), np.arange(k)])  # an eigenvector has no sign of its own
    positions[:, :k] = leading * np.where(sign == 0, 1.0, sign) * np.sqrt(positive[:k])
    total = float(positive.sum())
    return positions, float(positive[:2].sum() / total) if total > 0 else 1.0
