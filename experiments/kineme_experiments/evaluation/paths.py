"""How rivals get movements: centered, scaled to unit size, evenly sampled in time, or smoothed and along the path."""

from __future__ import annotations

from kineme.movements.preparation.resample import relative_rows, resample_by_arc_length
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.specification import Normalization
from kineme.validation import Array

_N_SAMPLES = 200  # even in time, before arc length is taken
_CUTOFF = 10.0  # cycles per movement, as in the recognizer of this library


def paths_over_time(demonstrations: Demonstrations, n_points: int) -> Array:
    """Positions at even times, centered and scaled as a whole to unit size, shape (n, d, n_points)."""
    return Normalization().apply(relative_rows(demonstrations, 0, len(demonstrations), n_points))


def smooth_paths(demonstrations: Demonstrations, n_points: int) -> Array:
    """Smoothed positions at even arc length, as they are, shape (n, d, n_points).

    Smoothed, because noise adds length to the path; over arc length, because rivals do better then than over time: on
    gestures in space as on handwriting with noise or uneven timing.
    """
    smooth = Demonstrations.of_movements(Smooth(_CUTOFF).apply(demonstrations))
    return resample_by_arc_length(relative_rows(smooth, 0, len(smooth), _N_SAMPLES), n_points)


def paths_over_length(demonstrations: Demonstrations, n_points: int) -> Array:
    """`smooth_paths`, centered and scaled as a whole to unit size, shape (n, d, n_points)."""
    return Normalization().apply(smooth_paths(demonstrations, n_points))
