"""Normalization: translation and size of movements are removed before they are compared."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from kineme.errors import TrajectoryError
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.validation import Array, check_choice, check_switch

SCALES = ("path", "per-dimension", "none")
SMALLEST, LARGEST = 1e-15, 1e15  # range of sizes of movements that keep their size
_OPERATIONS_PER_SAMPLE = 5
_FLAT = 1e-6  # share of the whole extent; flatter dimensions are not scaled up


@dataclass(frozen=True)
class Normalization:
    """Translation and scale; rotation belongs to the comparison, see `kernels.procrustes.Procrustes`.

    Parameters
    ----------
    translation : bool, default True
        Remove the position. Movements that differ only in their position become equal.
    scale : {"path", "per-dimension", "none"}, default "path"
        "path" divides by the root mean square distance from the center, one number for all dimensions: a dot and a
        circle become equal. "per-dimension" divides each dimension by its own: a circle and an ellipse become equal
        too. "none" keeps the size, which must be 1e-15 to 1e15 in the unit of the data: movements are compared in
        single precision, where squares of other sizes overflow or underflow.
    """

    translation: bool = True
    scale: str = "path"

    def __post_init__(self) -> None:
        check_switch("translation", self.translation)
        check_choice("scale", self.scale, SCALES)

    def apply(self, paths: Array, dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """Paths (n, d, T) minus their center, divided by their size, as `dtype`."""
        if self.translation and self.scale != "none" and use_compiled(_OPERATIONS_PER_SAMPLE * paths.size):
            least = _FLAT if self.scale == "per-dimension" else math.inf
            normalized = np.empty(paths.shape, dtype)
            compiled_module("kineme.similarity._compiled").fill_normalized(paths, least, normalized)
            return normalized
        return self._apply(paths).astype(dtype, copy=False)

    def _apply(self, paths: Array) -> Array:
        centered = paths - self.center(paths)
        if self.scale == "none":
            _check_size(centered)
            return np.asarray(centered)
        squares = np.einsum("ijk,ijk->ij", centered, centered)[:, :, None] / paths.shape[2]
        centered /= self._size(squares if self.translation else paths.var(axis=2, keepdims=True))
        return np.asarray(centered)

    def center(self, paths: Array) -> Array:
        """The center of each path (n, d, T), shape (n, d, 1): its mean position along the phase."""
        return paths.mean(axis=2, keepdims=True) if self.translation else np.zeros((*paths.shape[:2], 1))

    def size(self, paths: Array) -> Array:
        """The size of each path (n, d, T), shape (n, 1, 1) or (n, d, 1); 1 for a path that does not move."""
        if self.scale == "none":
            return np.ones((len(paths), 1, 1))
        return self._size(paths.var(axis=2, keepdims=True))

    def _size(self, squares: Array) -> Array:
        """From the variance in each dimension, (n, d, 1)."""
        whole = np.sqrt(squares.sum(axis=1, keepdims=True))
        whole[whole == 0] = 1.0
        if self.scale == "path":
            return np.asarray(whole)
        own = np.sqrt(squares)
        return np.where(own > _FLAT * whole, own, whole)


def _check_size(paths: Array) -> None:
    """Refuse paths (n, d, T) that keep a size of which single precision makes zero or infinity."""
    sizes = np.abs(paths).max(axis=(1, 2), initial=0.0)
    wrong = (sizes > LARGEST) | ((sizes > 0) & (sizes < SMALLEST))
    if wrong.any():
        raise TrajectoryError(
            f'expected movements of {SMALLEST:g} to {LARGEST:g} in their unit with scale="none", got '
            f"{sizes[wrong][0]:.3g}; choose another unit, or another scale"
        )
