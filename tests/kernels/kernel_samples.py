"""Rows and kernels that the tests of this folder share."""

import numpy as np

from kineme.kernels import KERNELS, DistanceKernel, averaged


def absolute(x, y):
    return abs(x - y)


def square(z):
    return z * z


def capped(z):
    return min(z, 0.8)


CAUCHY = DistanceKernel(d=absolute, g=square, h=lambda sums: 1 / (1 + sums))

#: Every kernel of the table with its default widths, and averages of them.
NAMED = {name: row.kernel() for name, row in KERNELS.items()}
ALL = {
    **NAMED,
    "cauchy": CAUCHY,
    **{
        f"{mean} of {name}": averaged(NAMED[name], 2, mean)
        for name, mean in zip(KERNELS, ("geometric", "harmonic", "min", "quadratic"), strict=True)
    },
}

KINDS = ("normal", "heavy tails", "duplicates", "far from the origin", "integers", "some zeros", "two rows")


def rows(kind, seed, n=24, p=6, dtype=np.float64):
    """Random rows (n, p) of one kind; p must be even."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n, p))
    if kind == "heavy tails":
        X = rng.standard_cauchy(size=(n, p)) * 10 ** rng.uniform(-2, 2)
    elif kind == "duplicates":
        X[n // 2 :] = X[: n - n // 2]
    elif kind == "far from the origin":
        X += 1e6
    elif kind == "integers":
        X = rng.integers(-3, 4, size=(n, p)).astype(float)
    elif kind == "some zeros":
        X[rng.random((n, p)) < 0.4] = 0
    elif kind == "two rows":
        X = X[:2]
    return X.astype(dtype)
