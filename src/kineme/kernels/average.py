"""Similarity of multi-dimensional movements: an A-average of per-dimension similarities (Section 3.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from kineme.errors import SpecificationError
from kineme.kernels._rows import Rows
from kineme.kernels.base import Kernel
from kineme.runtime.parallel import for_tiles


@dataclass(frozen=True)
class Mean:
    """One A-average."""

    average: Callable[[Rows], Rows]  # similarities (d, ...) to their average (...)
    formula: str
    psd: str  # for which positive semi-definite kernels the average is proved positive semi-definite
    reason: str  # the proof, or why there is none
    nonnegative: bool = False  # whether it is defined for non-negative similarities only


def _geometric(similarities: Rows) -> Rows:
    with np.errstate(divide="ignore"):  # log 0 = -inf, and exp(-inf) = 0 is right
        logarithms = np.log(similarities)
    mean = logarithms.mean(axis=0)
    return np.exp(mean, out=mean)


def _harmonic(similarities: Rows) -> Rows:
    with np.errstate(divide="ignore", over="ignore"):  # 1 / 0 = inf, and 1 / inf = 0 is right
        mean = np.reciprocal(similarities).mean(axis=0)
        return np.reciprocal(mean, out=mean)


#: Name of a mean -> how it averages similarities, and what is proved of it.
MEANS: dict[str, Mean] = {
    "arithmetic": Mean(
        lambda k: k.mean(axis=0),
        "1/d Σ k_j",
        "always",
        "Sums of positive semi-definite kernels, with positive factors, are positive semi-definite.",
    ),
    "geometric": Mean(
        _geometric,
        "(Π k_j)^(1/d)",
        "infinitely divisible",
        "Where every power k_j^(1/d) is positive semi-definite (an infinitely divisible kernel), so is "
        "their product (Schur). Other kernels: not claimed.",
        nonnegative=True,
    ),
    "harmonic": Mean(
        _harmonic,
        "d / Σ (1 / k_j)",
        "not claimed",
        "Reciprocals of positive semi-definite kernels are not positive semi-definite.",
        nonnegative=True,
    ),
    "quadratic": Mean(
        lambda k: np.sqrt(np.square(k).mean(axis=0)),
        "√(1/d Σ k_j²)",
        "not claimed",
        "The sum of squares is positive semi-definite (Schur), its square root need not be.",
    ),
    "min": Mean(
        lambda k: k.min(axis=0),
        "min k_j",
        "not claimed",
        "The smaller of two positive semi-definite kernels need not be positive semi-definite.",
    ),
}

# Bytes of per-dimension similarities that exist at a time.
_SCRATCH = 2**24
_MOST_DIMS = 10_000


@dataclass(frozen=True)
class Averaged(Kernel):
    """An A-average of per-dimension similarities; made by `averaged`.

    Parameters
    ----------
    kernel : Kernel or tuple of n_dims kernels
        One for all dimensions, or one for each. A width of None is chosen per dimension.
    n_dims : int
        The columns are that many equal blocks, Eq. (9): x_1..x_S, y_1..y_S.
    mean : str
        A key of `MEANS`, which says what is proved about positive semi-definiteness.
    """

    kernel: Kernel | tuple[Kernel, ...]
    n_dims: int
    mean: str = "arithmetic"

    def __post_init__(self) -> None:
        if (
            isinstance(self.n_dims, bool)
            or not isinstance(self.n_dims, int | np.integer)
            or not 1 <= self.n_dims <= _MOST_DIMS
        ):
            raise SpecificationError(
                f"expected n_dims to be a whole number from 1, got {self.n_dims!r}; at most {_MOST_DIMS:,}"
            )
        object.__setattr__(self, "n_dims", int(self.n_dims))
        if not isinstance(self.mean, str) or self.mean not in MEANS:
            raise SpecificationError(f"expected mean to be one of {tuple(MEANS)}, got {self.mean!r}")
        for kernel in self._kernels():
            if not isinstance(kernel, Kernel):
                raise SpecificationError(f"expected a kernel, such as RBF(), got {kernel!r}; pass an instance")
        if len(self._kernels()) != self.n_dims:
            raise SpecificationError(
                f"expected one kernel, or one for each of n_dims={self.n_dims} dimensions, got {len(self._kernels())}"
            )

    def _kernels(self) -> tuple[Kernel, ...]:
        return self.kernel if isinstance(self.kernel, tuple) else (self.kernel,) * self.n_dims

    def _with_widths(self, X: Rows) -> Self:
        kernels, blocks = self._kernels(), self._blocks(X)
        fitted = tuple(_fitted(kernels[j], blocks[j], j) for j in range(len(kernels)))
        return self if fitted == kernels else replace(self, kernel=fitted)

    def _check_dtype(self, dtype: np.dtype[np.floating]) -> None:
        for kernel in self._kernels():
            kernel._check_dtype(dtype)

    def _blocks(self, X: Rows) -> list[Rows]:
        if X.shape[1] % self.n_dims:
            raise SpecificationError(
                f"expected columns in n_dims={self.n_dims} blocks of equal size, got {X.shape[1]} columns; "
                "n_dims is the number of dimensions of the movements"
            )
        return [np.ascontiguousarray(block) for block in np.split(X, self.n_dims, axis=1)]

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        a = self._blocks(A)
        b = a if B is None else self._blocks(B)
        step = max(1, _SCRATCH // (self.n_dims * len(b[0]) * A.itemsize))
        for start in range(0, len(A), step):
            band = slice(start, min(start + step, len(A)))
            rows = [block[band] for block in a]
            if B is not None:
                self._average(rows, b, gram[band])
                continue
            self._average(rows, None, gram[band, band])
            if band.start:  # below the diagonal, and its mirror image
                before = slice(0, band.start)
                self._average(rows, [block[before] for block in b], gram[band, before])
                gram[before, band] = gram[band, before].T

    def _average(self, a: list[Rows], b: list[Rows] | None, gram: Rows) -> None:
        """Write the average over dimensions of the similarities of `a` and `b` to `gram`."""
        mean = MEANS[self.mean]
        similarities = np.empty((len(a), *gram.shape), gram.dtype)
        for j, kernel in enumerate(self._kernels()):
            kernel._fill(a[j], None if b is None else b[j], similarities[j])
            if mean.nonnegative and similarities[j].min() < 0:
                raise SpecificationError(
                    f"expected similarities >= 0 for the {self.mean} mean, got {similarities[j].min():.3g} from "
                    f"{kernel} in dimension {j}; use mean='arithmetic'"
                )

        def work(start: int, stop: int) -> None:
            gram[start:stop] = mean.average(similarities[:, start:stop])

        for_tiles(work, len(gram), 64)


def averaged(kernel: Kernel | tuple[Kernel, ...], n_dims: int, mean: str = "arithmetic") -> Averaged:
    """Compare dimension by dimension with `kernel`, then average the similarities (Section 3.2).

    Parameters
    ----------
    kernel : Kernel or tuple of n_dims kernels
    n_dims : int
        Dimensions of the movements: the columns are that many equal blocks, Eq. (9).
    mean : {"arithmetic", "geometric", "harmonic", "quadratic", "min"}
        Arithmetic keeps positive semi-definiteness always, geometric that of infinitely divisible
        kernels (`RBF`, `Laplacian`); of the others nothing is claimed. See `MEANS`.

    Raises
    ------
    SpecificationError
        An unknown mean, n_dims below 1, something that is not a kernel; when called, a number of columns
        that n_dims does not divide.

    Examples
    --------
    >>> from kineme.kernels import RBF, averaged
    >>> averaged(RBF(sigma=1.0), n_dims=2)([[0.0, 0.0]], [[0.0, 100.0]])
    array([[0.5]])
    """
    return Averaged(kernel, n_dims, mean)


def _fitted(kernel: Kernel, block: Rows, dimension: int) -> Kernel:
    try:
        return kernel._with_widths(block)
    except SpecificationError as error:
        n = block.shape[1]
        where = f"dimension {dimension} (columns {dimension * n} to {dimension * n + n - 1})"
        raise SpecificationError(f"in {where}: {error}") from None
