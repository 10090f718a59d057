"""Learn a batch of rhythmic movements: resample, estimate the period, fold, align, multiply."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.movements.preparation.preprocess import preprocess
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements_like import MovementsLike
from kineme.primitives.discrete.encode import check_movement
from kineme.primitives.recorded_as import RecordedAs
from kineme.primitives.rhythmic.cycle import fold
from kineme.primitives.rhythmic.harmonics import as_real, waves
from kineme.primitives.rhythmic.operators import encoder, even_phases
from kineme.primitives.rhythmic.periods import FEWEST_CYCLES, SAMPLES_PER_PERIOD, Periodicity, find_cycles
from kineme.primitives.rhythmic.specification import RhythmicSpecification
from kineme.runtime.parallel import for_tiles
from kineme.validation import Array, describe

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
