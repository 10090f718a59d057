"""The kernels by name, with their properties, and those of the paper."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from kineme.kernels._rows import Rows
from kineme.kernels._sums import ABSOLUTE, CANBERRA, SQUARED, TRUNCATED, fill_gram, median_difference, median_of_sums
from kineme.kernels.average import MEANS
from kineme.kernels.base import Kernel
from kineme.runtime.parallel import for_tiles


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
            slope = A.dtype.type(-0.5 / self.sigma**2)

            def similarity(tile: Rows) -> None:
                with np.errstate(over="ignore"):  # exp(-inf) = 0 is right
                    tile *= slope
                np.exp(tile, out=tile)

            fill_gram(SQUARED, 0.0, similarity, A, B, gram)
        if B is None:
            np.fill_diagonal(gram, 1)


def _exp_of_product(a: Rows, b: Rows, a2: Rows, b2: Rows, gram: Rows) -> None:
    """Write exp(min(0, a·b - a2 - b2)) to `gram`."""
    np.matmul(a, b.T, out=gram)  # the threads of the linear algebra library; a·a is exactly symmetric

    def work(start: int, stop: int) -> None:
        strip = gram[start:stop]
        strip -= np.add.outer(a2[start:stop], b2)  # in this order it keeps the symmetry
        np.minimum(strip, 0, out=strip)
        np.exp(strip, out=strip)

    for_tiles(work, len(gram), max(1, _STRIP // gram.shape[1]))


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


@dataclass(frozen=True)
class KernelRow:
    """One kernel that can be built from its name.

    `formula`, `equation`: equation number of the paper, empty where the paper has none.
    """

    kernel: type[Kernel]  # called without arguments it takes its widths from the data
    formula: str
    equation: str
    psd: bool  # whether it is proved positive semi-definite for all its parameters
    infinitely_divisible: bool  # whether its powers k^t, t > 0, are proved so too

    @property
    def widths(self) -> tuple[str, ...]:
        """Names of the parameters of the kernel."""
        return self.kernel._width_names()

    @property
    def psd_means(self) -> tuple[str, ...]:
        """Means of `MEANS` whose average of this kernel is proved positive semi-definite."""
        proved = {"always": self.psd, "infinitely divisible": self.infinitely_divisible, "not claimed": False}
        return tuple(name for name, mean in MEANS.items() if proved[mean.psd])


#: Name of a kernel -> its class, its formula, and what is proved of it.
KERNELS: dict[str, KernelRow] = {
    "rbf": KernelRow(RBF, "exp(-‖x - y‖² / (2 σ²))", "(6)", psd=True, infinitely_divisible=True),
    "truncated": KernelRow(
        TruncatedEuclidean, "1/n Σ max(0, m - min(m, |x_i - y_i|) / σ)", "(7)-(8)", psd=True, infinitely_divisible=False
    ),
    "laplacian": KernelRow(Laplacian, "exp(-Σ |x_i - y_i| / σ)", "", psd=True, infinitely_divisible=True),
    "canberra": KernelRow(
        Canberra, "1/n Σ (1 - |x_i - y_i| / (|x_i| + |y_i|))", "", psd=True, infinitely_divisible=False
    ),
}


class PaperKernels(NamedTuple):
    """The two kernels that the paper applies to one feature of one formulation."""

    rbf: RBF
    truncated: TruncatedEuclidean


#: (feature, formulation), as `DMPFeatures` and `DMP` name them -> the kernels of the paper, Table 3.
PAPER_WIDTHS: dict[tuple[str, str], PaperKernels] = {
    ("weights", "original"): PaperKernels(RBF(500), TruncatedEuclidean(750, 1)),
    ("weights", "bio-inspired"): PaperKernels(RBF(3.5e7), TruncatedEuclidean(1e7, 1)),
    ("forcing", "original"): PaperKernels(RBF(6e4), TruncatedEuclidean(1e4, 1)),
    ("forcing", "bio-inspired"): PaperKernels(RBF(7000), TruncatedEuclidean(350, 1)),
}
for _kernels in PAPER_WIDTHS.values():
    hash(_kernels)  # they are constants: a kernel that was hashed refuses set_params
