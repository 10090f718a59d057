"""Small drawings of movements: in the plane as they are, in space in their widest view, one dimension over time."""

from __future__ import annotations

from typing import Any

import numpy as np

from kineme.validation import Array


def principal_axes(path: Array) -> Array:
    """Two axes (2, d) of the plane in which a path (d, T) is widest, for movements of three dimensions and more.

    Of the two recorded dimensions that lie most in that plane, the first points right and the second up, as far as both
    can: what was written is not drawn on its side, nor as if seen from behind.
    """
    centered = path - path.mean(axis=1, keepdims=True)
    plane = np.linalg.svd(centered, full_matrices=False)[0].T[:2]
    right, up = np.sort(np.argsort(-np.linalg.norm(plane, axis=0), kind="stable")[:2])
    U, _, Vt = np.linalg.svd(plane[:, [right, up]])
    return np.asarray((U @ Vt).T @ plane)


def flat(paths: Array, like: Array) -> Array:
    """Paths (n, d, T) as drawn, (n, 2, T): over the phase, as they are, or in the principal axes of the path `like`."""
    n, d, T = paths.shape
    if d == 1:
        phase = np.broadcast_to(np.linspace(0.0, 1.0, T), (n, 1, T))
        return np.concatenate((phase, paths), axis=1)
    return paths if d == 2 else np.asarray(principal_axes(like) @ paths)


def plot_paths(axes: Any, drawn: Array, color: str, **style: Any) -> None:
    """Lines of paths (n, 2, T)."""
    for x, y in drawn:
        axes.plot(x, y, color=color, **style)


def mark_start(axes: Any, drawn: Array, color: str, size: float = 4.0) -> None:
    """A dot where each path (n, 2, T) starts."""
    axes.plot(drawn[:, 0, 0], drawn[:, 1, 0], "o", color=color, markersize=size, linestyle="none", zorder=4)


def bare(axes: Any, n_dims: int) -> None:
    """No ticks, no frame, and one scale for both directions where both are lengths."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)
    if n_dims > 1:
        axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
