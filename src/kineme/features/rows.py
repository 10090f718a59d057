"""Feature rows of learned primitives, Eq. (9)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

from kineme.primitives.discrete.primitives import Primitives
from kineme.primitives.rhythmic.primitives import RhythmicPrimitives

#: Feature name -> (primitives, S) -> array (n, size, d).
FEATURES: dict[str, Callable[[Primitives | RhythmicPrimitives, int], NDArray[Any]]] = {
    "shape-attractor": lambda primitives, n_samples: primitives.shape_attractor(n_samples),
    "forcing": lambda primitives, n_samples: primitives.forcing(n_samples),
    "weights": lambda primitives, _: primitives.weights,
}


def features_of(primitives: Primitives | RhythmicPrimitives, feature: str, n_samples: int) -> NDArray[Any]:
    """Feature rows (n, d * size) of learned primitives, dimension-major as in Eq. (9)."""
    by_time = FEATURES[feature](primitives, n_samples)
    return by_time.transpose(0, 2, 1).reshape(len(primitives), -1)
