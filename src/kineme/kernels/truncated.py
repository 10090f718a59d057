"""The truncated Euclidean kernel, Eq. (7) and (8)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kineme.kernels._rows import Rows
from kineme.kernels._sums import TRUNCATED, fill_gram
from kineme.kernels._widths import median_difference
from kineme.kernels.base import Kernel


@dataclass(frozen=True)
class TruncatedEuclidean(Kernel):
    r"""Truncated Euclidean (TrE): ``k(x, y) = 1/n Σ_i max(0, m - min(m, |x_i - y_i|) / σ)``, Eq. (7), (8).

    Positive semi-definite for every m, σ > 0. For ``σ <= 1`` each term is ``max(0, m - |t| / σ)`` with
    ``t = x_i - y_i``: a triangle, whose Fourier transform is a squared sinc, never negative (Bochner).
    For ``σ > 1`` it is that of ``σ = 1`` divided by σ plus the constant ``m (1 - 1/σ) >= 0``. Sums stay positive
    semi-definite. Its powers ``k^t`` need not be: a triangle is not infinitely divisible.

    ``k(x, x) = m``, and ``k = m max(0, 1 - 1/σ)`` where every coordinate differs by m or more.

    Parameters
    ----------
    m : float > 0, optional
        In the unit of the features: differences of ``min(1, σ) m`` or more are all alike. By default the
        median over pairs of reference rows and coordinates of the differences ``|x_i - y_i|`` that are
        not zero, so half of them are told apart (about two million, of evenly spaced rows).
    sigma : float > 0
        Scale, without unit. The paper uses 1, where Eq. (7) is m minus the mean truncated distance.
    """

    m: float | None = field(default=None, metadata={"width": True})
    sigma: float = field(default=1.0, metadata={"width": True})

    def __post_init__(self) -> None:
        self._check_widths()

    def _median_width(self, name: str, X: Rows) -> float:
        return median_difference(X)

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        # max(0, m - min(m, t) / σ) = m - min(m min(1, σ), t) / σ: one comparison, not two.
        assert self.m is not None
        m, slope = A.dtype.type(self.m), A.dtype.type(-1 / (A.shape[1] * self.sigma))

        def similarity(tile: Rows) -> None:
            tile *= slope
            tile += m
            np.maximum(tile, 0, out=tile)  # rounding only

        fill_gram(TRUNCATED, self.m * min(1.0, self.sigma), similarity, A, B, gram)
