"""Smooth movements with the cubic smoothing spline."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kineme.movements.preparation.smoothing_spline import even_rows_of_spline, smoothing_spline
from kineme.movements.preparation.spline import fits_lanes
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.runtime.compiled import compiled_module, use_compiled
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array, check_number

_OPERATIONS_PER_SAMPLE = 40  # elementary operations that the banded system costs per sample and dimension
_TILE_MOVEMENTS = 256
_CUTOFFS = 1e-9, 1e9  # cycles per movement, smallest and largest: the fourth powers are far from overflow


@dataclass(frozen=True)
class Smooth:
    """Replace each movement by its cubic smoothing spline, at its own time stamps.

    The spline g minimizes ``sum_j (x_j - g(u_j))^2 + lam * integral g''(u)^2 du`` in normalized time
    ``u = (t - t0) / tau``. On even samples h apart that is the low-pass filter ``1 / (1 + (nu / cutoff)^4)``, with
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
        check_number("cutoff", self.cutoff, above=0.0, smallest=_CUTOFFS[0], most=_CUTOFFS[1])

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """The movements, smoothed."""
        smoothed = np.empty_like(demonstrations.positions)

        def smooth_tile(start: int, stop: int) -> None:
            _fill_smoothed(demonstrations, start, stop, self.cutoff, smoothed)

        for_tiles(smooth_tile, len(demonstrations), _TILE_MOVEMENTS)
        return replace(demonstrations.movements.positions_only, positions=smoothed)


def smooth_rows(demonstrations: Demonstrations, start: int, stop: int, cutoff: float, n_points: int) -> Array:
    """Smoothing splines of movements start:stop, see `Smooth`, at `n_points` even times: (stop - start, d, n_points).

    The smoothing splines themselves are evaluated, from their second derivatives; `Smooth` followed by `Resample`
    would fit other splines through their values. The first recorded position is subtracted, so that a large offset
    costs no digits.
    """
    offsets, scales = _tile(demonstrations, start, stop, cutoff)
    times, positions = demonstrations.movements.spread, demonstrations.positions
    if not _compiled(demonstrations, offsets):
        first, lengths = offsets[0], np.diff(offsets)
        smoothed, m = smoothing_spline(times, positions, offsets, scales)
        elapsed = times[first : offsets[-1]] - np.repeat(times[offsets[:-1]], lengths)
        return even_rows_of_spline(elapsed * np.repeat(scales, lengths), smoothed, m, offsets - first, n_points)
    rows = np.empty((stop - start, demonstrations.n_dims, n_points))
    compiled_module("kineme.movements.preparation._splines").fill_smooth_rows(times, positions, offsets, scales, rows)
    return rows


def _fill_smoothed(demonstrations: Demonstrations, start: int, stop: int, cutoff: float, smoothed: Array) -> None:
    """Smooth movements start:stop at their own stamps."""
    offsets, scales = _tile(demonstrations, start, stop, cutoff)
    times, positions = demonstrations.movements.spread, demonstrations.positions
    if _compiled(demonstrations, offsets):
        splines = compiled_module("kineme.movements.preparation._splines")
        splines.fill_smoothed(times, positions, offsets, scales, smoothed)
        return
    starts = np.repeat(positions[offsets[:-1]], np.diff(offsets), axis=0)
    smoothed[offsets[0] : offsets[-1]] = smoothing_spline(times, positions, offsets, scales)[0] + starts


def _compiled(demonstrations: Demonstrations, offsets: NDArray[np.intp]) -> bool:
    """Whether to run compiled, decided for all movements together although they are smoothed in tiles."""
    whole, now = demonstrations.positions.size, demonstrations.n_dims * int(offsets[-1] - offsets[0])
    return fits_lanes(demonstrations.offsets) and use_compiled(
        _OPERATIONS_PER_SAMPLE * whole, _OPERATIONS_PER_SAMPLE * now
    )


def _tile(demonstrations: Demonstrations, start: int, stop: int, cutoff: float) -> tuple[NDArray[np.intp], Array]:
    """Offsets of movements start:stop, and the factor on their times that makes the penalty 1."""
    offsets = demonstrations.offsets[start : stop + 1]
    penalties = (np.diff(offsets) - 1) / (2.0 * np.pi * cutoff) ** 4
    return offsets, 1.0 / (np.cbrt(penalties) * demonstrations.durations[start:stop])
