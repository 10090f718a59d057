"""The Canberra kernel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kineme.kernels._rows import Rows
from kineme.kernels._sums import CANBERRA, fill_gram
from kineme.kernels.base import Kernel


@dataclass(frozen=True)
class Canberra(Kernel):
    r"""Canberra similarity: ``k(x, y) = 1/n Σ_i (1 - |x_i - y_i| / (|x_i| + |y_i|))``, with 0/0 = 0.

    An instance of Eq. (5) that has no width: it compares ratios, so multiplying a coordinate by any
    number but zero changes nothing.

    Positive semi-definite. A term is 0 where the signs differ, 1 where both are 0, and else
    ``2 min(a, b) / (a + b)`` with ``a = |x_i|``, ``b = |y_i|``: the product of the covariance of Brownian motion,
    ``min(a, b)``, and of ``1 / (a + b) = ∫ exp(-a t) exp(-b t) dt``, both positive semi-definite (Schur).
    Positive, negative and zero coordinates are three blocks without a similarity between them, and a
    block-diagonal matrix of such blocks, and the mean over coordinates, stay positive semi-definite.
    """

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        slope = A.dtype.type(-1 / A.shape[1])

        def similarity(tile: Rows) -> None:
            tile *= slope
            tile += 1
            np.maximum(tile, 0, out=tile)  # rounding only

        fill_gram(CANBERRA, 0.0, similarity, A, B, gram)
