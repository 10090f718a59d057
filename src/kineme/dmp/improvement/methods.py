"""How the next variants follow from the costs of the present ones.

Variants are numbers z (p,) around a center, in units in which the first ones have the covariance I.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from kineme.validation import Array

_SHARPNESS = 10.0  # h of PI^BB: exp(-h) is the weight of the worst variant beside the best
_DECAY = 0.95  # of the exploration of PI^BB, in each update


@dataclass(frozen=True, eq=False)
class Search:
    """Where variants are drawn: ``center + size * N(0, covariance)``."""

    center: Array  # (p,)
    size: float
    covariance: Array  # (p, p)
    path: Array  # (p,), evolution path of the covariance
    size_path: Array  # (p,), evolution path of the size
    update: int = 0

    @classmethod
    def start(cls, n_numbers: int) -> Search:
        """Around 0 with the covariance I."""
        return cls(np.zeros(n_numbers), 1.0, np.eye(n_numbers), np.zeros(n_numbers), np.zeros(n_numbers))

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Variants (n, p), the first of which is the center."""
        root = np.linalg.cholesky(self.covariance)
        drawn = self.center + self.size * rng.standard_normal((n, len(self.center))) @ root.T
        drawn[0] = self.center
        return drawn


def path_integral(search: Search, variants: Array, costs: Array) -> Search:
    """PI^BB: the mean of the variants, weighted by ``exp(-h (J - min J) / (max J - min J))``, h = 10.

    F. Stulp and O. Sigaud, "Policy Improvement Methods: Between Black-Box Optimization and Episodic Reinforcement
    Learning", 2012: path integrals with one change for a whole rollout. The exploration shrinks by 5 % an update and
    keeps its shape.
    """
    relative = (costs - costs.min()) / max(np.ptp(costs), np.finfo(float).tiny)
    weights = np.exp(-_SHARPNESS * relative)
    center = weights / weights.sum() @ variants
    return replace(search, center=center, size=search.size * _DECAY, update=search.update + 1)


def covariance_adaptation(search: Search, variants: Array, costs: Array) -> Search:
    """CMA-ES: the better half, ranked; covariance and size follow the steps that were taken.

    N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772, 2016, Figure 6 and Table 1 with positive
    weights: Eq. (42) center, (43)-(44) size, (45)-(47) covariance. The center is one of the variants and no
    draw, so it is left out here.
    """
    p, drawn, paid = len(search.center), variants[1:], costs[1:]
    half = len(drawn) // 2
    weights = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
    weights /= weights.sum()
    effective = 1.0 / np.sum(weights**2)
    c_size = (effective + 2.0) / (p + effective + 5.0)
    damping = 1.0 + 2.0 * max(0.0, np.sqrt((effective - 1.0) / (p + 1.0)) - 1.0) + c_size
    c_path = (4.0 + effective / p) / (p + 4.0 + 2.0 * effective / p)
    c_one = 2.0 / ((p + 1.3) ** 2 + effective)
    c_rank = min(1.0 - c_one, 2.0 * (effective - 2.0 + 1.0 / effective) / ((p + 2.0) ** 2 + effective))
    expected = np.sqrt(p) * (1.0 - 1.0 / (4.0 * p) + 1.0 / (21.0 * p**2))

    steps = (drawn[np.argsort(paid, kind="stable")[:half]] - search.center) / search.size
    step = weights @ steps
    values, vectors = np.linalg.eigh(search.covariance)
    whitened = vectors @ (vectors.T @ step / np.sqrt(values))
    size_path = (1.0 - c_size) * search.size_path + np.sqrt(c_size * (2.0 - c_size) * effective) * whitened
    length = np.linalg.norm(size_path)
    settled = np.sqrt(1.0 - (1.0 - c_size) ** (2 * (search.update + 1)))
    moving = float(length / settled < (1.4 + 2.0 / (p + 1.0)) * expected)
    path = (1.0 - c_path) * search.path + moving * np.sqrt(c_path * (2.0 - c_path) * effective) * step
    kept = 1.0 - c_rank - c_one * (1.0 - (1.0 - moving) * c_path * (2.0 - c_path))
    covariance = kept * search.covariance + c_one * np.outer(path, path) + c_rank * (steps.T * weights) @ steps
    size = search.size * np.exp(min(1.0, c_size / damping * (length / expected - 1.0)))
    return Search(search.center + search.size * step, float(size), covariance, path, size_path, search.update + 1)


METHODS: dict[str, Callable[[Search, Array, Array], Search]] = {
    "cma-es": covariance_adaptation,
    "pi-bb": path_integral,
}
