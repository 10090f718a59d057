"""Random binning: an explicit feature map of the truncated Euclidean kernel, for sets too large for a Gram matrix."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from kineme.errors import SpecificationError
from kineme.kernels.table import TruncatedEuclidean
from kineme.validation import Array, as_numbers, check_count, check_number, check_seed

if TYPE_CHECKING:
    from scipy.sparse import csr_array

_COLUMNS = np.iinfo(np.int32).max
_MOST_SHIFTS = 100_000


class RandomBinning(TransformerMixin, BaseEstimator):
    """Sparse features Z with ``E[Z Z^T]`` equal to the Gram matrix of `TruncatedEuclidean`, Eq. (7)-(8).

    On a grid of pitch m with a uniformly random shift, two numbers fall into the same bin with probability
    ``max(0, 1 - |x - y| / m)``: the truncated kernel of one coordinate, up to the factor m. So the indicators of the
    bins, over all coordinates and a few shifts, are features of the kernel, and a linear SVM on them is an SVM with
    the truncated kernel, in time and memory linear in the number of movements.

    Parameters
    ----------
    m : float, optional
        Difference at which the kernel is truncated; by default from the median heuristic of `TruncatedEuclidean`.
    sigma : float, default 1.0
        As in Eq. (7): below 1 the pitch is ``sigma m``; above 1 the kernel has a constant, one more column.
    n_shifts : int, default 4
        Random grids P per coordinate. The error of ``Z Z^T`` falls as ``1 / sqrt(P n)`` with n coordinates.
    seed : int, default 0
        Seed of the random shifts.

    Attributes
    ----------
    m_ : float
        The difference at which the kernel is truncated.
    pitch_ : float
        Width of a bin, ``min(1, sigma) m``.
    n_features_in_ : int
        Columns of the training rows.
    n_columns_ : int
        Columns of Z. Values outside the bins of the training rows have no column: they share no bin with those rows.

    References
    ----------
    A. Rahimi and B. Recht, "Random features for large-scale kernel machines", NIPS 2007, Section 4. They draw the
    pitch, too; the fixed pitch here gives the triangle of Eq. (7).

    Examples
    --------
    >>> import numpy as np
    >>> from kineme.kernels.random_binning import RandomBinning
    >>> from kineme.kernels import TruncatedEuclidean
    >>> X = np.random.default_rng(0).normal(size=(5, 200))
    >>> Z = RandomBinning(m=1.0, n_shifts=500).fit_transform(X)
    >>> float(np.abs((Z @ Z.T).toarray() - TruncatedEuclidean(1.0)(X)).max()) < 0.01
    True
    """

    def __init__(self, m: float | None = None, sigma: float = 1.0, n_shifts: int = 4, seed: int = 0) -> None:
        self.m = m
        self.sigma = sigma
        self.n_shifts = n_shifts
        self.seed = seed

    def fit(self, X: ArrayLike, y: Any = None) -> Self:
        """Draw the grids and count their bins.

        Raises `SpecificationError`: a parameter out of its range, or too many bins for the memory of a linear model.
        """
        rows = _rows(X)
        check_number("sigma", self.sigma, above=0.0)
        check_count("n_shifts", self.n_shifts, 1, most=_MOST_SHIFTS)
        check_seed("seed", self.seed)
        kernel = TruncatedEuclidean(self.m, self.sigma).fit(rows)
        self.m_ = float(kernel.m)  # type: ignore[arg-type]
        self.n_features_in_ = rows.shape[1]
        self.pitch_ = self.m_ * min(1.0, float(self.sigma))
        draws = np.random.default_rng(self.seed).uniform(size=(rows.shape[1], self.n_shifts))
        self.shifts_ = draws * self.pitch_
        with np.errstate(over="ignore"):  # an overflow means too many bins too, which is refused below
            low, high = (np.floor((edge[:, None] + self.shifts_) / self.pitch_) for edge in (rows.min(0), rows.max(0)))
        counts = (high - low + 1).ravel()
        if not counts.sum() <= _COLUMNS:
            raise SpecificationError(
                f"expected fewer than {_COLUMNS} bins, got {counts.sum():.3g}: m={self.m_:g} is tiny against the "
                "spread of the data; raise m"
            )
        self.lowest_ = low.astype(np.int64)
        self.bins_ = counts.astype(np.int64).reshape(low.shape)
        self.first_ = (np.cumsum(self.bins_.ravel()) - self.bins_.ravel()).reshape(low.shape)
        self.n_columns_ = int(counts.sum()) + (self.sigma > 1)
        return self

    def transform(self, X: ArrayLike) -> csr_array:
        """Features Z, a `scipy.sparse.csr_array` of shape (n, n_columns_).

        Raises `SpecificationError`: another number of columns than in `fit`.
        """
        from scipy.sparse import csr_array, diags_array, hstack

        check_is_fitted(self)
        rows = _rows(X)
        if rows.shape[1] != self.n_features_in_:
            raise SpecificationError(f"expected {self.n_features_in_} columns as in fit, got {rows.shape[1]}")
        n, per_row = len(rows), self.shifts_.size
        bins = np.floor((rows[:, :, None] + self.shifts_) / self.pitch_).astype(np.int64) - self.lowest_
        inside = (bins >= 0) & (bins < self.bins_)
        columns = np.where(inside, bins + self.first_, 0).astype(np.int32).reshape(n, per_row)
        # sigma > 1: k = m (1 - 1/sigma) + (m / sigma) hat; sigma < 1: k = m hat of pitch sigma m.
        weight = np.sqrt(self.m_ / (max(1.0, float(self.sigma)) * per_row))
        values = (weight * inside).reshape(-1)
        index = np.int32 if n * per_row <= _COLUMNS else np.int64  # scikit-learn's linear models need 32-bit indices
        ends = np.arange(n + 1, dtype=index) * per_row  # keeps that type
        Z = csr_array((values, columns.ravel(), ends), shape=(n, int(self.bins_.sum())))
        Z.eliminate_zeros()
        if self.sigma > 1:
            constant = np.full(n, np.sqrt(self.m_ * (1.0 - 1.0 / self.sigma)))
            Z = hstack([Z, diags_array(constant) @ csr_array(np.ones((n, 1)))], format="csr")
        return Z

    def get_feature_names_out(self, input_features: Any = None) -> NDArray[Any]:
        """Names bin_1, bin_2, ..."""
        check_is_fitted(self)
        return np.array([f"bin_{k + 1}" for k in range(self.n_columns_)], dtype=object)


def _rows(X: ArrayLike) -> Array:
    rows = as_numbers(X, "X", "finite rows of features")
    if rows.ndim != 2 or not rows.size or not np.isfinite(rows).all():
        raise SpecificationError(
            f"expected finite rows of features, (n, p), got shape {rows.shape}"
            + ("" if rows.ndim == 2 and rows.size else "; use kineme.DMPFeatures to make them from movements")
        )
    return rows
