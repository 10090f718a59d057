"""Learn a batch of rhythmic movements: resample, estimate the period, fold, align, multiply."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.encode import check_movement
from kineme.dmp.recorded_as import RecordedAs
from kineme.dmp.rhythmic.harmonics import Complex, as_real, fit_harmonics, waves
from kineme.dmp.rhythmic.operators import encoder, even_phases
from kineme.dmp.rhythmic.periods import FEWEST_CYCLES, SAMPLES_PER_PERIOD, Periodicity, find_cycles
from kineme.dmp.rhythmic.specification import RhythmicSpecification
from kineme.errors import TrajectoryError
from kineme.movements.preparation.preprocess import preprocess
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array, describe

_RESOLVED = 0.45  # harmonics per sample of a period; one half would be the Nyquist limit

_TILE_SAMPLES = 10_000  # numbers of recording in one tile; the exponentials of the period search are fifty times more
_LEAST_EXPLAINED = 0.5  # share of the variance that a found period must explain
_ALMOST = 1 - 1e-6


def encode(dmp: RhythmicSpecification, movements: MovementsLike) -> dict[str, Any]:
    """Learn one limit cycle per movement; see `RhythmicDMP.learn`."""
    recorded = Demonstrations.of(movements)
    demos = preprocess(recorded, dmp.preprocessing)
    n, n_dims, H = len(demos), demos.n_dims, dmp.n_harmonics
    if dmp.align_on is not None and dmp.align_on >= n_dims:
        raise TrajectoryError(
            f"expected movements with a dimension {dmp.align_on} to align on, got {n_dims} dimensions"
        )
    first = demos.offsets[:-1]
    starts = demos.positions[first]
    extents = np.maximum.reduceat(demos.positions, first) - np.minimum.reduceat(demos.positions, first)
    check_movement(demos, starts, extents)
    estimated = periodicity(dmp, demos)
    coefficients = np.empty((n, n_dims, H + 1), dtype=complex)
    phases, explained, aligned_on = np.empty(n), np.empty(n), np.empty(n, dtype=np.intp)

    def fold_tile(chosen: NDArray[np.intp], rows: Array) -> None:
        one = fold(rows, estimated.cycles[chosen], demos.lengths[chosen], H, dmp.align_on)
        coefficients[chosen], phases[chosen], aligned_on[chosen], explained[chosen] = one

    _for_even_rows(demos, fold_tile)
    series = as_real(coefficients)
    shape = series[:, :, 1:] @ waves(even_phases(dmp.n_points), H)[:, 1:].T
    return {
        "scaled_weights": series @ encoder(dmp),
        "baselines": starts + series[:, :, 0],
        "amplitudes": np.ptp(shape, axis=2).max(axis=1) / 2,
        "periods": demos.durations / estimated.cycles,
        "phases": phases,
        "aligned_on": aligned_on,
        "explained": explained,
        "labels": demos.labels,
        "names": demos.names,
        "recorded_as": None if recorded.channels is None else RecordedAs(recorded.channels),
    }


def _for_even_rows(demos: Demonstrations, work: Callable[[NDArray[np.intp], Array], None]) -> None:
    """Call ``work(chosen, rows)`` on tiles of recordings, each at as many even samples as it has itself.

    Recordings of equal length are processed together, so that the result of one does not depend on the others.
    """
    for length in np.unique(demos.lengths).tolist():
        alike = np.flatnonzero(demos.lengths == length)
        group = demos if len(alike) == len(demos) else demos[alike]

        def tile(start: int, stop: int) -> None:
            work(alike[start:stop], relative_rows(group, start, stop, length))  # noqa: B023 - called in this round

        for_tiles(tile, len(group), max(1, _TILE_SAMPLES // (demos.n_dims * length)))


def periodicity(dmp: RhythmicSpecification, demos: Demonstrations) -> Periodicity:
    """Periods per recording: from the given period, or estimated; refused if there is none."""
    n = len(demos)
    if dmp.period is not None:
        cycles = demos.durations / dmp.period
        # The recording of one period may lack its last sample, which equals the first.
        short = cycles * demos.lengths / (demos.lengths - 1) < _ALMOST
        if short.any():
            i = int(np.argmax(short))
            raise TrajectoryError(
                f"{describe(i, demos.names)}: expected at least one period of {dmp.period:g} s, got a recording of "
                f"{demos.durations[i]:.4g} s; record longer, or correct the period (times are in seconds)"
            )
        _check_samples(demos, dmp.period)
        return Periodicity(cycles, np.ones(n))
    estimated = Periodicity(np.empty(n), np.empty(n))

    def search_tile(chosen: NDArray[np.intp], rows: Array) -> None:
        estimated.cycles[chosen], estimated.explained[chosen] = find_cycles(rows, demos.lengths[chosen])

    _for_even_rows(demos, search_tile)
    aperiodic = ~(estimated.explained >= _LEAST_EXPLAINED)
    if aperiodic.any() and dmp.aperiodic == "raise":
        _refuse(demos, estimated, aperiodic)
    return Periodicity(np.where(np.isnan(estimated.cycles), 1.0, estimated.cycles), estimated.explained)


def _refuse(demos: Demonstrations, estimated: Periodicity, aperiodic: np.ndarray) -> NoReturn:
    i = int(np.argmax(aperiodic))
    best = (
        "nothing in it repeats"
        if np.isnan(estimated.cycles[i])
        else f"the best, {demos.durations[i] / estimated.cycles[i]:.4g} s, explains "
        f"{max(estimated.explained[i], 0.0):.0%}"
    )
    raise TrajectoryError(
        f"{describe(i, demos.names)}: expected a movement of at least {FEWEST_CYCLES:g} periods, found no period: "
        f"{best} ({aperiodic.sum()} of {len(demos)} movements); record longer, remove drift, give period= if known, "
        'learn a single reach with kineme.DMP, or take the best period with aperiodic="accept"'
    )


def _check_samples(demos: Demonstrations, period: float) -> None:
    per_period = (demos.lengths - 1) / demos.durations * period
    if (per_period < SAMPLES_PER_PERIOD).any():
        i = int(per_period.argmin())
        raise TrajectoryError(
            f"{describe(i, demos.names)}: expected at least {SAMPLES_PER_PERIOD} samples per period of {period:g} s, "
            f"got {per_period[i]:.3g}; record faster, or correct the period (times are in seconds)"
        )


class Cycles(NamedTuple):
    """One cycle of each of n recordings."""

    coefficients: Complex  # (n, d, H + 1), Fourier series in the phase
    phases: Array  # (n,), where the recording started, in [0, 2 pi)
    aligned_on: NDArray[np.intp]  # (n,), dimension that set the phase
    explained: Array  # (n,), share of the recording's variance that its cycle explains


def fold(rows: Array, cycles: Array, lengths: NDArray[np.intp], most: int, dimension: int | None) -> Cycles:
    """Average over periods by the least-squares Fourier series, then set the phase.

    For a whole number of periods the series is the Fourier series of the average period. For a fractional number it
    still uses every sample, has no jump where the recording begins and ends, and its mean is that of whole periods.

    Parameters
    ----------
    rows : ndarray of shape (n, d, R)
        Even samples.
    cycles : ndarray of shape (n,)
        Periods per recording.
    lengths : ndarray of shape (n,)
        Recorded samples; no harmonic above the sampling of a period is used.
    most : int
        Largest number of harmonics H.
    dimension : int or None
        Dimension whose first harmonic defines the phase; None for the one with the largest.
    """
    n_harmonics = np.clip(_RESOLVED * (lengths - 1) / cycles, 1, most).astype(np.intp)
    mean = rows.mean(axis=2, keepdims=True)
    fit = fit_harmonics(rows - mean, cycles, n_harmonics)
    total = ((rows - mean) ** 2).sum(axis=(1, 2))
    explained = 1 - ((rows - mean - fit.fitted) ** 2).sum(axis=(1, 2)) / total
    missing = most + 1 - fit.coefficients.shape[2]
    coefficients = np.pad(fit.coefficients, ((0, 0), (0, 0), (0, missing)))
    coefficients[:, :, 0] += mean[:, :, 0]
    first = coefficients[:, :, 1]
    aligned_on = np.abs(first).argmax(axis=1) if dimension is None else np.full(len(rows), dimension)
    phases = start_phases(first[np.arange(len(rows)), aligned_on])
    turn = np.exp(-1j * phases[:, None] * np.arange(most + 1))
    return Cycles(coefficients * turn[:, None], phases, aligned_on, explained)


def start_phases(first: Complex) -> Array:
    """Phase of the first sample, from one first harmonic (n,): phase 0 is where it is largest.

    Unlike a principal axis, a maximum has a sign, so the phase is not ambiguous by half a turn. A dimension without a
    first harmonic defines no phase.
    """
    phases = np.angle(first) % (2 * np.pi)
    return np.where(phases == 2 * np.pi, 0.0, phases)  # the remainder of a tiny negative angle rounds up to 2 pi
