"""The Laplacian kernel."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kineme.kernels._rows import Rows
from kineme.kernels._sums import ABSOLUTE, fill_gram
from kineme.kernels._widths import median_of_sums
from kineme.kernels.base import Kernel


@dataclass(frozen=True)
class Laplacian(Kernel):
    r"""Laplacian: ``k(x, y) = exp(-Σ_i |x_i - y_i| / σ)``, Eq. (5).

    There ``d = |x - y|``, ``g(z) = z / σ`` and ``h(z) = exp(-z)``.

    Positive semi-definite for every σ: a product over coordinates of ``exp(-|t| / σ)``, whose Fourier
    transform is a Cauchy density (Bochner, Schur). Its power ``k^t`` is the Laplacian with ``σ / t``, so it is
    infinitely divisible.

    Parameters
    ----------
    sigma : float > 0, optional
        In the unit of the features. By default the median L1 distance between different reference
        rows (1000 evenly spaced ones where there are more). scikit-learn's gamma is ``1 / σ``.
    """

    sigma: float | None = field(default=None, metadata={"width": True})

    def __post_init__(self) -> None:
        self._check_widths()

    def _median_width(self, name: str, X: Rows) -> float:
        return median_of_sums(ABSOLUTE, lambda tile: tile, X)

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        assert self.sigma is not None
        slope = A.dtype.type(-1 / self.sigma)

        def similarity(tile: Rows) -> None:
            with np.errstate(over="ignore"):  # exp(-inf) = 0 is right
                tile *= slope
            np.exp(tile, out=tile)

        fill_gram(ABSOLUTE, 0.0, similarity, A, B, gram)
