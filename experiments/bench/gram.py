"""Gram matrices of the kernels: speed beside SciPy and scikit-learn, and memory beyond the result."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

import numpy as np

from bench.movements import SEED
from bench.rows import Row
from bench.timing import medians

N_FEATURES = 200
MEBIBYTE = 2**20


def measure(quick: bool) -> list[Row]:
    from scipy.spatial.distance import cdist
    from sklearn.metrics.pairwise import rbf_kernel

    from kineme.kernels import RBF, TruncatedEuclidean

    n, repeats = (1_000, 3) if quick else (4_000, 7)
    random = np.random.default_rng(SEED)
    A, B = random.normal(size=(n, N_FEATURES)), random.normal(size=(n, N_FEATURES))
    a, b = A.astype(np.float32), B.astype(np.float32)
    sigma = float(np.sqrt(N_FEATURES))
    gamma = 1 / (2 * sigma**2)
    tre, rbf = TruncatedEuclidean(m=1.0, sigma=1.0), RBF(sigma)
    ours: dict[str, Callable[[], np.ndarray]] = {
        "TrE, float64": lambda: tre(A, B),
        "TrE, float64, symmetric": lambda: tre(A),
        "TrE, float32": lambda: tre(a, b),
        "TrE, float32, symmetric": lambda: tre(a),
        "RBF, float64": lambda: rbf(A, B),
        "RBF, float64, symmetric": lambda: rbf(A),
        "RBF, float32": lambda: rbf(a, b),
        "RBF, float32, symmetric": lambda: rbf(a),
    }
    seconds = medians(
        {
            **ours,
            "cdist": lambda: cdist(A, B, "cityblock"),
            "rbf_kernel, float64": lambda: rbf_kernel(A, B, gamma=gamma),
            "rbf_kernel, float32": lambda: rbf_kernel(a, b, gamma=gamma),
            "rbf_kernel, float64, symmetric": lambda: rbf_kernel(A, gamma=gamma),
            "rbf_kernel, float32, symmetric": lambda: rbf_kernel(a, gamma=gamma),
        },
        repeats,
        warm_up=1,
    )
    details = {"shape": [n, n, N_FEATURES], "repeats": repeats, "seed": SEED, "seconds": seconds}
    details |= {"kernels": [repr(tre), repr(rbf)], "gamma": gamma, "note": "cdist has no float32; it converts"}
    rows = []
    for name, work in ours.items():
        is_rbf = name.startswith("RBF")
        peer = name.replace("RBF", "rbf_kernel") if is_rbf else "cdist"
        rows.append(_speed(f"{name}, {n} x {n}", n * n, seconds[name], seconds[peer], is_rbf))
        rows.append(_memory(f"{name}, memory beyond the result", work))
    rows[0].details.update(details)
    return rows


def _speed(what: str, n_pairs: int, ours: float, peer: float, is_rbf: bool) -> Row:
    mega = 1e-6 * n_pairs
    name = "scikit-learn rbf_kernel" if is_rbf else "scipy cdist cityblock"
    return Row(what, "M pairs/s", mega / ours, mega / peer, name, peer / ours, (">=", 1.0 if is_rbf else 10.0))


def _memory(what: str, work: Callable[[], np.ndarray]) -> Row:
    """What NumPy and Python hold at the worst moment, less the result; the inputs came before."""
    tracemalloc.start()
    try:
        result = work()
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    return Row(what, "MiB", (peak - result.nbytes) / MEBIBYTE, target=("<=", 64.0))
