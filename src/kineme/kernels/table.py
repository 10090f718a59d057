"""The kernels by name, with their properties, and those of the paper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Self

import numpy as np

from kineme.errors import SpecificationError
from kineme.kernels.base import Kernel, Rows, contiguous
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.sampling import evenly_spaced


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
    """An A-average of per-dimension similarities; made by `averaged`, whose parameters are its fields."""

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
        One for all dimensions, or one for each. A width of None is chosen per dimension.
    n_dims : int
        Dimensions of the movements: the columns are that many equal blocks, Eq. (9): x_1..x_S, y_1..y_S.
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


# One call of a Python function costs about as much as this many elementary operations of NumPy.
_PYTHON_CALL = 100

_MAX_ROWS = 1000
_MAX_DIFFERENCES = 2**21

# Pairs of 256 x 256 rows: large enough to repay packing the columns, small enough for the cache.
_TILE = 256
# Elements of a temporary array in the twin.
_TWIN_CHUNK = 2**17

TileSums = Callable[[Rows, Rows, Any, Rows], None]


@dataclass(frozen=True)
class Term:
    """The term that one coordinate adds to the sum: g(d(x, y)), with one constant c."""

    twin: Callable[[Rows, Rows, Any], Any]  # the definition, ``twin(x, y, c)`` over arrays
    load_compiled: Callable[[], TileSums]  # the compiled loop; called only if it is used, because it imports Numba
    cost: int = 4  # elementary operations of NumPy per evaluation of the twin
    symmetric: bool = True  # whether term(x, y) always equals term(y, x)


def _builtin(name: str) -> Callable[[], TileSums]:
    return lambda: getattr(compiled_module("kineme.kernels._compiled"), name)


def _canberra(x: Rows, y: Rows, _c: Any) -> Rows:
    size = np.abs(x) + np.abs(y)
    return np.abs(x - y) / np.where(size > 0, size, 1)


ABSOLUTE = Term(lambda x, y, c: np.abs(x - y), _builtin("absolute_sums"))
SQUARED = Term(lambda x, y, c: (x - y) ** 2, _builtin("squared_sums"))
TRUNCATED = Term(lambda x, y, c: np.minimum(np.abs(x - y), c), _builtin("truncated_sums"))
CANBERRA = Term(_canberra, _builtin("canberra_sums"), cost=8)


def fill_gram(term: Term, c: float, finish: Callable[[Rows], object], A: Rows, B: Rows | None, gram: Rows) -> None:
    """Write h(sums of `term` over coordinates) to `gram`, in threads; `finish`, h of Eq. (5), works in place."""
    mirrored = B is None and term.symmetric
    A = contiguous(A, A.dtype)
    columns = A if B is None else contiguous(B, A.dtype)
    n_pairs = gram.size // (2 if mirrored else 1)
    tile_sums = tile_sums_of(term, n_pairs * A.shape[1])
    constant = A.dtype.type(c)
    tiles = [(i, j) for i in range(0, len(A), _TILE) for j in range(0, i + 1 if mirrored else len(columns), _TILE)]

    def work(first: int, last: int) -> None:
        for i, j in tiles[first:last]:
            a, b = A[i : i + _TILE], columns[j : j + _TILE]
            tile = np.empty((len(a), len(b)), A.dtype)
            tile_sums(a, b, constant, tile)
            finish(tile)
            gram[i : i + _TILE, j : j + _TILE] = tile
            if mirrored and i != j:
                gram[j : j + _TILE, i : i + _TILE] = tile.T

    for_tiles(work, len(tiles), 1)


def tile_sums_of(term: Term, n_terms: int) -> TileSums:
    """The loop to use for `n_terms` evaluations of the term: compiled if that repays its overhead, else plain."""
    if use_compiled(n_terms * term.cost):
        return term.load_compiled()

    def twin_sums(A: Rows, B: Rows, c: Any, sums: Rows) -> None:
        step = max(1, _TWIN_CHUNK // A.shape[1])
        for i, x in enumerate(A):
            for j in range(0, len(B), step):
                sums[i, j : j + step] = term.twin(x, B[j : j + step], c).sum(axis=1)

    return twin_sums


def _median_of_sums(term: Term, finish: Callable[[Rows], object], X: Rows) -> float:
    """Median over pairs of different rows, of at most 1000 evenly spaced ones, of finish(sum of `term`)."""
    rows = _some_rows(X, _MAX_ROWS)
    sums = np.empty((len(rows), len(rows)))
    fill_gram(term, 0.0, finish, rows, None, sums)
    return _median_of_positive(sums[np.triu_indices(len(rows), 1)], len(X))


def _some_rows(X: Rows, most: int) -> Rows:
    """At most `most` evenly spaced rows, in double precision."""
    return np.ascontiguousarray(X[evenly_spaced(len(X), most)] if len(X) > most else X, np.float64)


def _median_of_positive(values: Rows, n_rows: int) -> float:
    positive = values[values > 0]
    if not positive.size:
        raise SpecificationError(
            f"expected training rows that differ, got {n_rows} row(s), all equal, which say nothing about "
            "the widths; pass the widths as numbers, or more rows"
        )
    return float(np.median(positive))


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
        # Of large X, as many evenly spaced rows are used as give about two million differences.
        rows = _some_rows(X, max(10, min(_MAX_ROWS, int((2 * _MAX_DIFFERENCES / X.shape[1]) ** 0.5))))
        first, second = np.triu_indices(len(rows), 1)
        return _median_of_positive(np.abs(rows[first] - rows[second]), len(X))

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        # max(0, m - min(m, t) / σ) = m - min(m min(1, σ), t) / σ: one comparison, not two.
        assert self.m is not None
        m, slope = A.dtype.type(self.m), A.dtype.type(-1 / (A.shape[1] * self.sigma))

        fill_gram(TRUNCATED, self.m * min(1.0, self.sigma), _falling_from(m, slope), A, B, gram)


def _falling_from(top: Any, slope: Any) -> Callable[[Rows], None]:
    """Return what changes sums to ``max(0, top + slope sums)`` in place."""

    def similarity(tile: Rows) -> None:
        tile *= slope
        tile += top
        np.maximum(tile, 0, out=tile)  # rounding only

    return similarity


def _exponential(slope: Any) -> Callable[[Rows], None]:
    """Return what changes sums to ``exp(slope sums)`` in place."""

    def similarity(tile: Rows) -> None:
        with np.errstate(over="ignore"):  # exp(-inf) = 0 is right
            tile *= slope
        np.exp(tile, out=tile)

    return similarity


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
        return _median_of_sums(SQUARED, lambda tile: np.sqrt(tile, out=tile), X)

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
            fill_gram(SQUARED, 0.0, _exponential(A.dtype.type(-0.5 / self.sigma**2)), A, B, gram)
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
        return _median_of_sums(ABSOLUTE, lambda tile: tile, X)

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        assert self.sigma is not None
        fill_gram(ABSOLUTE, 0.0, _exponential(A.dtype.type(-1 / self.sigma)), A, B, gram)


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
        fill_gram(CANBERRA, 0.0, _falling_from(1, A.dtype.type(-1 / A.shape[1])), A, B, gram)


@dataclass(frozen=True)
class KernelRow:
    """One kernel that can be built from its name."""

    kernel: type[Kernel]  # called without arguments it takes its widths from the data
    formula: str
    equation: str  # number in the paper, empty where the paper has none
    psd: bool  # whether it is proved positive semi-definite for all its parameters
    infinitely_divisible: bool  # whether its powers k^t, t > 0, are proved so too

    @property
    def widths(self) -> tuple[str, ...]:
        """Names of the parameters of the kernel."""
        return self.kernel._width_names()


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


@dataclass(frozen=True, repr=False)
class DistanceKernel(Kernel):
    r"""``k(x, y) = h(Σ_j g(d(x_j, y_j)))``, Eq. (5), for functions of your own.

    Nothing is claimed about positive semi-definiteness: it depends on the functions. With
    ``h(z) = exp(-z)`` it holds if ``g(d(x, y))`` is conditionally negative definite (Schoenberg), as for
    ``|x - y|^p`` with ``0 < p <= 2``.

    Parameters
    ----------
    d, g : callables
        d(x, y) and g(z) of single numbers: Python functions that Numba can compile (arithmetic, if,
        min, max, abs, the functions of ``math``), or already compiled ones. Small jobs run them as
        Python. They are compiled once per process.
    h : callable
        h(sums) for an array, elementwise, giving an array of that shape.

    Examples
    --------
    >>> import numpy as np
    >>> from kineme.kernels import DistanceKernel
    >>> cauchy = DistanceKernel(d=lambda x, y: abs(x - y), g=lambda z: z * z, h=lambda s: 1 / (1 + s))
    >>> cauchy([[0.0, 0.0]], [[1.0, 2.0]]).round(3)
    array([[0.167]])
    """

    d: Callable[[Any, Any], Any]
    g: Callable[[Any], Any]
    h: Callable[[Any], Any]

    def __post_init__(self) -> None:
        for name in ("d", "g", "h"):
            if not callable(getattr(self, name)):
                raise SpecificationError(f"expected a function {name}, got {getattr(self, name)!r}")

    def __repr__(self) -> str:
        names = (f"{name}={getattr(f, '__name__', repr(f))}" for name, f in self.get_params().items())
        return f"DistanceKernel({', '.join(names)})"

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        def similarity(tile: Rows) -> None:
            similarities = np.asarray(self.h(tile))
            if similarities.shape != tile.shape:
                raise SpecificationError(
                    f"expected h to map an array of shape {tile.shape} to that shape, got {similarities.shape}; "
                    "write h with array operations, such as np.exp(-s)"
                )
            tile[...] = similarities

        # The caller's d may be asymmetric, so no triangle of the Gram matrix is mirrored.
        term = Term(self._in_python, self._compiled, cost=_PYTHON_CALL, symmetric=False)
        fill_gram(term, 0.0, similarity, A, B, gram)

    def _in_python(self, x: Rows, y: Rows, _c: Any) -> Rows:
        # Numba-compiled functions carry the Python function they were made from; either can be called.
        terms = np.frompyfunc(lambda a, b: self.g(self.d(a, b)), 2, 1)(x, y)
        return np.asarray(terms, dtype=x.dtype)

    def _compiled(self) -> TileSums:
        compiled = compiled_module("kineme.kernels._compiled")
        loop = compiled.user_sums(self.d, self.g)

        def sums(A: Rows, B: Rows, c: Any, sums_of_tile: Rows) -> None:
            try:
                loop(A, B, c, sums_of_tile)
            except compiled.NumbaError as error:
                raise SpecificationError(
                    f"expected functions d and g that Numba can compile, got {self}; use arithmetic and math on "
                    f"numbers, or set KINEME_COMPILED=never to run them as Python. Numba says: {error}"
                ) from error

        return sums
