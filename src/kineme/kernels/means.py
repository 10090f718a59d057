"""A-averages of per-dimension similarities (d, ...), with what is proved about each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from kineme.kernels._rows import Rows


@dataclass(frozen=True)
class Mean:
    """One A-average.

    Attributes
    ----------
    average : callable
        Similarities (d, ...) to their average (...).
    formula : str
    psd : {"always", "infinitely divisible", "not claimed"}
        For which positive semi-definite kernels the average is proved positive semi-definite.
    reason : str
        The proof, or why there is none.
    nonnegative : bool
        Whether it is defined for non-negative similarities only.
    """

    average: Callable[[Rows], Rows]
    formula: str
    psd: str
    reason: str
    nonnegative: bool = False


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
