"""Linear classifier on random convolutions of movements, where many demonstrations of each class are there.

Source: A. Dempster, D. Schmidt, G. Webb, "MiniRocket: a very fast (almost) deterministic transform for time series
classification", KDD 2021: 84 kernels of length 9, dilated, each with several thresholds; the features are shares of
samples above them. Here the series are midpoints and tangents of the detailed segments, 66 of each movement.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.describe import Described
from kineme.similarity.scores import Classifier, Compared
from kineme.similarity.specification import softmax
from kineme.validation import Array

_LENGTH, _HEAVY = 9, 3  # of a kernel, of which so many weights are 2 and the others -1
_FEATURES = 2000
_AT_ONCE = 64  # movements transformed together
_GOLDEN = (np.sqrt(5) + 1) / 2
_ALPHAS = np.logspace(-1, 5, 13)
_TINY, _TIE = 1e-12, 1e-3  # of a probability; put on thresholds, which held values equal, but for rounding
_SHARPNESS = np.logspace(-1, 2, 61)  # of the softmax of scores, of which the most likely is taken

Single = NDArray[np.float32]


class Kernels(NamedTuple):
    """Random convolutions: for each dilation which channels a kernel adds up, and its thresholds."""

    dilations: tuple[int, ...]
    channels: tuple[Single, ...]  # (84, c) of each dilation, 0 or 1
    thresholds: tuple[Single, ...]  # (84, b) of each dilation


def _weights() -> Single:
    """Return the 84 kernels (84, 9): three weights of 2, six of -1, so that a constant has no effect."""
    weights = -np.ones((84, _LENGTH), np.float32)
    for row, heavy in zip(weights, combinations(range(_LENGTH), _HEAVY), strict=True):
        row[list(heavy)] = 2.0
    return weights


def series_of(described: Described) -> Single:
    """Return series (n, 2 d, 66) of movements that are described in detail: midpoints and tangents of segments."""
    assert described.pairs is not None
    assert described.pairs.details is not None
    shapes = described.pairs.details
    return np.concatenate((shapes.midpoints, shapes.tangents), axis=2).transpose(0, 2, 1)


def fit_kernels(series: Single) -> Kernels:
    """Draw the channels of the kernels, and thresholds from quantiles of what they make of movements drawn.

    Movements are drawn from them in the order of their values, so that neither their order nor names change a kernel.
    """
    rng, (n, c, T) = np.random.default_rng(0), series.shape
    series = series[np.lexsort(series.reshape(n, -1)[:, :: max(1, c * T // 32)].T)]
    # As in the source, evenly spaced in the logarithm: most thresholds are of kernels that are narrow.
    exponents = np.linspace(0.0, np.log2((T - 1) / (_LENGTH - 1)), _FEATURES // 84)
    dilations, n_thresholds = np.unique(np.floor(2.0**exponents).astype(int), return_counts=True)
    channels, thresholds, drawn = [], [], 0
    for dilation, n_each in zip(dilations.tolist(), n_thresholds.tolist(), strict=True):
        chosen = np.zeros((84, c), np.float32)
        for row in chosen:
            row[rng.permutation(c)[: int(2 ** rng.uniform(0, np.log2(min(c, _LENGTH) + 1)))]] = 1.0
        one_each = series[rng.integers(n, size=84)]
        own = _convolved(np.einsum("kct,kc->kt", one_each, chosen)[None], dilation)[0]
        shares = ((drawn + np.arange(84 * n_each) + 1) * _GOLDEN % 1.0).reshape(84, -1)
        # `numpy.quantile` takes the same shares of every row; of each its own they are interpolated here as there.
        ordered, place = np.sort(own, axis=1).astype(np.float64), shares * (T - 1)
        low, high = (np.take_along_axis(ordered, each(place).astype(np.intp), axis=1) for each in (np.floor, np.ceil))
        thresholds.append(low + (place % 1.0) * (high - low))
        channels.append(chosen)
        drawn += 84 * n_each
    return Kernels(
        tuple(dilations.tolist()), tuple(channels), tuple((each + _TIE).astype(np.float32) for each in thresholds)
    )


def _convolved(sums: Single, dilation: int) -> Single:
    """Return each kernel of its own sum of channels, (n, 84, T); these are continued by zeros."""
    T = sums.shape[2]
    reach = (_LENGTH // 2) * dilation
    padded, weights = np.pad(sums, ((0, 0), (0, 0), (reach, reach))), _weights()
    convolved = np.zeros_like(sums)
    for k in range(_LENGTH):
        convolved += weights[:, k, None] * padded[:, :, k * dilation : k * dilation + T]
    return convolved


def transform(series: Single, kernels: Kernels) -> Array:
    """Return features (n, f): shares of samples above each threshold."""
    rows = []
    for start in range(0, len(series), _AT_ONCE):
        some, parts = series[start : start + _AT_ONCE], []
        for dilation, chosen, thresholds in zip(*kernels, strict=True):
            sums = _convolved(chosen @ some, dilation)  # a convolution of a sum is the sum of convolutions
            parts.append((sums[:, :, None] > thresholds[:, :, None]).mean(axis=3).reshape(len(some), -1))
        rows.append(np.concatenate(parts, axis=1))
    return np.concatenate(rows) if rows else np.empty((0, 0))


@dataclass(frozen=True, eq=False)
class Convolutions(Classifier):
    """A ridge regression of the classes on features of random convolutions, `transform`.

    Attributes
    ----------
    kernels : Kernels
    mean, scale : ndarray of shape (f,)
        By which features are centered and divided.
    coefficients : ndarray of shape (f, C)
    intercept : ndarray of shape (C,)
    sharpness : float
        Factor of the scores in probabilities, the most likely one for demonstrations left out.
    """

    kernels: Kernels = field(repr=False)
    mean: Array = field(repr=False)
    scale: Array = field(repr=False)
    coefficients: Array = field(repr=False)
    intercept: Array = field(repr=False)
    sharpness: float

    def scores(self, compared: Compared) -> Array:
        """Return the values of the regression, (n, C)."""
        features = transform(series_of(compared.described), self.kernels)
        return np.asarray((features - self.mean) / self.scale @ self.coefficients + self.intercept)

    def probabilities(self, scores: Array) -> Array:
        """Return the probability of each class, (n, C): a softmax of the scores."""
        return softmax(self.sharpness * scores, axis=1)


def convolve(described: Described) -> tuple[Kernels, Array]:
    """Draw kernels for movements; return them with the features of the movements, (n, f)."""
    series = series_of(described)
    kernels = fit_kernels(series)
    return kernels, transform(series, kernels)


def fit_convolutions(
    comparison: Comparison, references: References, convolved: tuple[Kernels, Array] | None = None
) -> tuple[Convolutions, float]:
    """Fit the classifier; return it with the share of references that it recognizes when they are left out.

    The penalty is chosen by leaving out (generalized cross-validation), as `sklearn.linear_model.RidgeClassifierCV`
    does it. `convolved` is what `convolve` gave, if it was called before. Raises `SpecificationError`: references of
    one class, or that are not compared in detail.
    """
    from sklearn.linear_model import RidgeCV

    pairs = references.described.pairs
    if pairs is None or pairs.details is None or len(references.classes) == 1:
        raise SpecificationError(
            "expected movements of two or more classes that are compared in detail for classifier='convolutions', got "
            f"{len(references.classes)} class(es) in {', '.join(each.name for each in comparison.representations)}; "
            "add movements of another class, or pass classifier='nearest-each'"
        )
    kernels, features = convolve(references.described) if convolved is None else convolved
    mean, scale = features.mean(axis=0), features.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    normalized = (features - mean) / scale
    owners = np.searchsorted(references.classes, references.labels)
    targets = np.where(owners[:, None] == np.arange(len(references.classes)), 1.0, -1.0)
    model: Any = RidgeCV(_ALPHAS, store_cv_results=True).fit(normalized, targets)
    left_out = left_out_values(model, normalized, targets)
    rows = np.arange(len(owners))
    likely = [np.log(softmax(sharp * left_out, axis=1)[rows, owners] + _TINY).sum() for sharp in _SHARPNESS]
    sharpness = float(_SHARPNESS[int(np.argmax(likely))])
    fitted = Convolutions(kernels, mean, scale, model.coef_.T, model.intercept_, sharpness)
    return fitted, float((left_out.argmax(axis=1) == owners).mean())


def left_out_values(model: Any, X: Array, targets: Array) -> Array:
    """Return what a fitted `RidgeCV` says of each row of X when it is left out, (n, C).

    It keeps the squares of these errors. They are the errors of the fit, divided by ``1 - h`` with h from 0 to 1 the
    leverage of the row, and so have their signs.
    """
    squares = model.cv_results_[:, :, int(np.flatnonzero(model.alpha_ == _ALPHAS)[0])]
    return np.asarray(targets - np.sqrt(squares) * np.sign(targets - model.predict(X)))
