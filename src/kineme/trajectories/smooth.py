"""Smooth movements with the cubic smoothing spline."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kineme.compiled import use_compiled
from kineme.errors import TrajectoryError
from kineme.parallel import for_tiles
from kineme.trajectories.collect import Movements
from kineme.trajectories.demonstrations import Demonstrations
from kineme.validation import Array, check_number, describe

_OPERATIONS_PER_SAMPLE = 300  # elementary operations that SciPy's smoothing spline costs per sample and dimension
_MIN_SAMPLES = 5
_TILE_MOVEMENTS = 256


@dataclass(frozen=True)
class Smooth:
    """Replace each movement by its cubic smoothing spline, at its own time stamps.

    The spline g minimizes ``sum_j (x_j - g(u_j))^2 + lam * integral g''(u)^2 du`` in normalized time
    u = (t - t0) / tau. On even samples h apart that is the low-pass filter ``1 / (1 + (nu / cutoff)^4)``, with
    ``lam = 1 / (h (2 pi cutoff)^4)``: zero phase, flat at low frequency, unbiased at both ends.

    Parameters
    ----------
    cutoff : float, default 20.0
        Frequency nu that is halved, in cycles per movement: ``cutoff / duration`` in hertz. Measured per
        movement, so that the same gesture, done faster, comes out the same.

    References
    ----------
    C. H. Reinsch, "Smoothing by spline functions", Numerische Mathematik 10, 1967.
    """

    cutoff: float = 20.0

    def __post_init__(self) -> None:
        check_number("cutoff", self.cutoff, above=0.0)

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """The movements, smoothed.

        Raises
        ------
        TrajectoryError
            A movement of fewer than five samples.
        """
        lengths, offsets, n_dims = demonstrations.lengths, demonstrations.offsets, demonstrations.n_dims
        if lengths.min() < _MIN_SAMPLES:
            i = int(lengths.argmin())
            raise TrajectoryError(
                f"{describe(i, demonstrations.names)}: expected at least "
                f"{_MIN_SAMPLES} samples to smooth, got {lengths[i]}; leave Smooth out or record faster"
            )
        starts = np.repeat(demonstrations.times[offsets[:-1]], lengths)
        u = (demonstrations.times - starts) / np.repeat(demonstrations.durations, lengths)
        penalties = (lengths - 1) / (2 * np.pi * self.cutoff) ** 4
        smoothed = np.empty_like(demonstrations.positions)
        if use_compiled(_OPERATIONS_PER_SAMPLE * len(u) * n_dims):
            from kineme.trajectories._compiled import fill_smoothed

            def smooth_tile(start: int, stop: int) -> None:
                tile = offsets[start : stop + 1]
                fill_smoothed(u, demonstrations.positions, tile, penalties[start:stop], smoothed)

            for_tiles(smooth_tile, len(lengths), _TILE_MOVEMENTS)
        else:
            _fill_smoothed(u, demonstrations.positions, offsets, penalties, smoothed)
        return replace(demonstrations.movements, positions=smoothed)


def _fill_smoothed(u: Array, x: Array, offsets: NDArray[np.intp], penalties: Array, smoothed: Array) -> None:
    """The plain twin of the compiled loop: SciPy's smoothing spline, movement by movement."""
    from scipy.interpolate import make_smoothing_spline

    for i, penalty in enumerate(penalties):
        rows = slice(offsets[i], offsets[i + 1])
        start = x[offsets[i]]
        smoothed[rows] = make_smoothing_spline(u[rows], x[rows] - start, lam=penalty)(u[rows]) + start
