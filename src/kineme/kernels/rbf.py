"""The Gaussian kernel, Eq. (6)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kineme.kernels._rows import Rows
from kineme.kernels._sums import SQUARED, fill_gram
from kineme.kernels._widths import median_of_sums
from kineme.kernels.base import Kernel
from kineme.runtime.parallel import for_tiles

# Elements of the Gram matrix that stay in cache between the passes over them.
_STRIP = 2**17


@dataclass(frozen=True)
class RBF(Kernel):
    r"""Radial basis function: ``k(x, y) = exp(-‖x - y‖² / (2 σ²))``, Eq. (6).

    Positive semi-definite for every σ: it is the characteristic function of a Gaussian (Bochner).
    Its power ``k^t`` is the RBF with ``σ / sqrt(t)``, so it is infinitely divisible.

    The paper decomposes it as ``d = |x_j - y_j|``, ``g(z) = z² / (2 σ)``, ``h(z) = exp(-z)``, Eq. (5); Eq. (6)
    needs ``g(z) = z² / (2 σ²)``, which is what is computed.

    Parameters
    ----------
    sigma : float > 0, optional
        In the unit of the features. By default the median Euclidean distance between different
        reference rows (1000 evenly spaced ones where there are more).
        scikit-learn's gamma is ``1 / (2 σ²)``.
    """

    sigma: float | None = field(default=None, metadata={"width": True})

    def __post_init__(self) -> None:
        self._check_widths()

    def _median_width(self, name: str, X: Rows) -> float:
        return median_of_sums(SQUARED, lambda tile: np.sqrt(tile, out=tile), X)

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        # ‖a - b‖² = ‖a‖² + ‖b‖² - 2 a·b is one matrix product, but loses the digits that the norms
        # and the distance do not share: so center first, and sum the differences themselves where
        # more than a quarter of the digits of the exponent would go.
        assert self.sigma is not None
        center = (A if B is None else B).mean(axis=0, dtype=np.float64).astype(A.dtype)
        with np.errstate(over="ignore"):  # then the differences decide
            a = (A - center) / A.dtype.type(self.sigma)
            b = a if B is None else (B - center) / A.dtype.type(self.sigma)
            a2, b2 = np.einsum("ij,ij->i", a, a) / 2, np.einsum("ij,ij->i", b, b) / 2
        if max(a2.max(), b2.max()) * float(np.finfo(A.dtype).eps) ** 0.25 <= 1:
            _exp_of_product(a, b, a2, b2, gram)
        else:
            fill_gram(SQUARED, 0.0, self._exp_of_sums, A, B, gram)
        if B is None:
            np.fill_diagonal(gram, 1)

    def _exp_of_sums(self, tile: Rows) -> None:
        assert self.sigma is not None
        with np.errstate(over="ignore"):  # exp(-inf) = 0 is right
            tile *= tile.dtype.type(-0.5 / self.sigma**2)
        np.exp(tile, out=tile)


def _exp_of_product(a: Rows, b: Rows, a2: Rows, b2: Rows, gram: Rows) -> None:
    """Write exp(min(0, a·b - a2 - b2)) to `gram`."""
    np.matmul(a, b.T, out=gram)  # the threads of the linear algebra library; a·a is exactly symmetric

    def work(start: int, stop: int) -> None:
        strip = gram[start:stop]
        strip -= np.add.outer(a2[start:stop], b2)  # in this order it keeps the symmetry
        np.minimum(strip, 0, out=strip)
        np.exp(strip, out=strip)

    for_tiles(work, len(gram), max(1, _STRIP // gram.shape[1]))
