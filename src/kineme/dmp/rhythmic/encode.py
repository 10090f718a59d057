"""Learn a batch of rhythmic movements: resample, estimate the period, fold, align, multiply.

Candidates for a period come from the self-similarity of the recording; a harmonic fit chooses and refines the number of
`cycles` from the first to the last sample. All dimensions are used together, so the widest has the largest weight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.discrete.encode import check_movement
from kineme.dmp.recorded_as import RecordedAs
from kineme.dmp.rhythmic import operators
from kineme.errors import TrajectoryError
from kineme.movements.preparation.resample import relative_rows
from kineme.movements.preparation.trim import preprocess
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.runtime.parallel import for_tiles, single_threaded_blas
from kineme.validation import Array, describe

FEWEST_CYCLES = 1.5  # with fewer, a period cannot be told from a part of it
SAMPLES_PER_PERIOD = 4  # fewer cannot show a shape
_CANDIDATES = 6
_AVERAGED = 0.02  # of a lag, to either side
_VALLEY = 0.1  # of a lag, to either side: a valley is the minimum within it
_RISEN = 0.5  # dissimilarity that must be reached before a period; otherwise noise next to lag 0 gives short ones
_SLACK = 0.25  # dissimilarity by which a candidate may exceed the best one
_HARMONICS = 8
_PER_HARMONIC = 2.5  # samples per period that the highest harmonic needs
_NEWTON_STEPS = 5
_MUCH_BETTER = 0.5  # largest share of the unexplained variance of a shorter period that a longer one may leave
_ROUNDING = 1e-9  # share of the variance below which nothing is left to explain

_RESOLVED = 0.45  # harmonics per sample of a period; one half would be the Nyquist limit

_TILE_SAMPLES = 10_000  # numbers of recording in one tile; the exponentials of the period search are fifty times more
_LEAST_EXPLAINED = 0.5  # share of the variance that a found period must explain
_ALMOST = 1 - 1e-6


def encode(dmp: operators.RhythmicSpecification, movements: MovementsLike) -> dict[str, Any]:
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
        coefficients[chosen], phases[chosen], aligned_on[chosen], explained[chosen] = fold(
            rows, estimated.cycles[chosen], demos.lengths[chosen], H, dmp.align_on
        )

    _for_even_rows(demos, fold_tile)
    series = operators.as_real(coefficients)
    shape = series[:, :, 1:] @ operators.waves(operators.even_phases(dmp.n_points), H)[:, 1:].T
    return {
        "scaled_weights": series @ operators.encoder(dmp),
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
    """Call ``work(chosen, rows)`` on tiles of recordings of one length, with as many even samples as they have."""
    for length in np.unique(demos.lengths).tolist():
        alike = np.flatnonzero(demos.lengths == length)
        group = demos if len(alike) == len(demos) else demos[alike]

        def tile(start: int, stop: int) -> None:
            work(alike[start:stop], relative_rows(group, start, stop, length))  # noqa: B023 - called in this round

        for_tiles(tile, len(group), max(1, _TILE_SAMPLES // (demos.n_dims * length)))


def periodicity(dmp: operators.RhythmicSpecification, demos: Demonstrations) -> Periodicity:
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
        per_period = (demos.lengths - 1) / demos.durations * dmp.period
        if (per_period < SAMPLES_PER_PERIOD).any():
            i = int(per_period.argmin())
            raise TrajectoryError(
                f"{describe(i, demos.names)}: expected at least {SAMPLES_PER_PERIOD} samples per period of "
                f"{dmp.period:g} s, got {per_period[i]:.3g}; record faster, or correct the period (times are in "
                "seconds)"
            )
        return Periodicity(cycles, np.ones(n))
    estimated = Periodicity(np.empty(n), np.empty(n))

    def search_tile(chosen: NDArray[np.intp], rows: Array) -> None:
        estimated.cycles[chosen], estimated.explained[chosen] = find_cycles(rows, demos.lengths[chosen])

    _for_even_rows(demos, search_tile)
    aperiodic = ~(estimated.explained >= _LEAST_EXPLAINED)
    if aperiodic.any() and dmp.aperiodic == "raise":
        i, best = int(np.argmax(aperiodic)), "nothing in it repeats"
        if not np.isnan(estimated.cycles[i]):
            period = demos.durations[i] / estimated.cycles[i]
            best = f"the best, {period:.4g} s, explains {max(estimated.explained[i], 0.0):.0%}"
        raise TrajectoryError(
            f"{describe(i, demos.names)}: expected a movement of at least {FEWEST_CYCLES:g} periods, found no period: "
            f"{best} ({aperiodic.sum()} of {len(demos)} movements); record longer, remove drift, give period= if "
            'known, learn a single reach with kineme.DMP, or take the best period with aperiodic="accept"'
        )
    return Periodicity(np.where(np.isnan(estimated.cycles), 1.0, estimated.cycles), estimated.explained)


def fold(
    rows: Array, cycles: Array, lengths: NDArray[np.intp], most: int, dimension: int | None
) -> tuple[operators.Complex, Array, NDArray[np.intp], Array]:
    """Average over periods by the least-squares Fourier series, then set the phase.

    A fractional number of periods still uses every sample, and its mean is that of whole periods. Of rows (n, d, R),
    `cycles` (n,) periods and `lengths` (n,) recorded samples it finds coefficients of `most` harmonics (n, d, H + 1),
    none above the sampling of a period; where recordings started, in [0, 2 pi); the dimension that set this phase; and
    the share of the variance that is explained.
    """
    n_harmonics = np.clip(_RESOLVED * (lengths - 1) / cycles, 1, most).astype(np.intp)
    mean = rows.mean(axis=2, keepdims=True)
    fit = operators.fit_harmonics(rows - mean, cycles, n_harmonics)
    total = ((rows - mean) ** 2).sum(axis=(1, 2))
    explained = 1 - ((rows - mean - fit.fitted) ** 2).sum(axis=(1, 2)) / total
    missing = most + 1 - fit.coefficients.shape[2]
    coefficients = np.pad(fit.coefficients, ((0, 0), (0, 0), (0, missing)))
    coefficients[:, :, 0] += mean[:, :, 0]
    first = coefficients[:, :, 1]
    aligned_on = np.abs(first).argmax(axis=1) if dimension is None else np.full(len(rows), dimension)
    phases = start_phases(first[np.arange(len(rows)), aligned_on])
    turn = np.exp(-1j * phases[:, None] * np.arange(most + 1))
    return coefficients * turn[:, None], phases, aligned_on, explained


def start_phases(first: operators.Complex) -> Array:
    """Phase of the first sample, of one first harmonic (n,) that is largest at phase 0: a maximum has a sign."""
    phases = np.angle(first) % (2 * np.pi)
    return np.where(phases == 2 * np.pi, 0.0, phases)  # the remainder of a tiny negative angle rounds up to 2 pi


class Periodicity(NamedTuple):
    """Estimated periods of n recordings."""

    cycles: Array  # (n,), periods per recording; NaN where there is no candidate
    explained: Array  # (n,), share of the variance that one repeated cycle explains, corrected for its freedom


def dissimilarity(rows: Array) -> Array:
    """Mean square distance (n, R) of a recording (n, d, R) from itself, shifted by 0 ... R - 1 samples.

    Its unit is twice the variance, and it needs no mean, which a fractional number of periods makes uncertain. It is
    the difference function of A. de Cheveigne and H. Kawahara, "YIN, a fundamental frequency estimator", JASA 111(4),
    2002.
    """
    n_samples = rows.shape[2]
    centered = rows - rows.mean(axis=2, keepdims=True)
    spectrum = np.fft.rfft(centered, 2 * n_samples)
    correlation = np.fft.irfft((spectrum * spectrum.conj()).real.sum(axis=1))[:, :n_samples]
    energy = np.cumsum((centered**2).sum(axis=1), axis=1)  # of the first j + 1 samples
    total = energy[:, -1:]
    early = energy[:, ::-1]  # the first R - lag samples
    late = total - np.column_stack((np.zeros(len(rows)), energy[:, :-1]))  # the last R - lag samples
    overlap = n_samples - np.arange(n_samples)
    return np.asarray((early + late - 2 * correlation) / overlap / (2 * total / n_samples))


def candidates(rows: Array, lengths: NDArray[np.intp]) -> Array:
    """Possible numbers of cycles, descending, (n, C), NaN where there are fewer: valleys of `dissimilarity`.

    Of noise's valleys only the lowest within a tenth of a lag counts, and values within a share of a lag are averaged.
    """
    n_samples = rows.shape[2]
    longest = min(int((n_samples - 1) / FEWEST_CYCLES) + 4, n_samples)
    distance = _averaged(dissimilarity(rows))[:, :longest]
    lag = np.arange(1, longest - 1)
    reach = np.minimum(_share_of(lag, _AVERAGED), np.minimum(lag, longest - 1 - lag))  # to the parabola's outer points
    reach = np.maximum(reach, 1)
    left, here, right = distance[:, lag - reach], distance[:, lag], distance[:, lag + reach]
    resolved = lag * (lengths[:, None] - 1) >= SAMPLES_PER_PERIOD * (n_samples - 1)
    valley = (here <= distance[:, lag - 1]) & (here < distance[:, lag + 1]) & resolved
    valley &= here <= _lowest_near(distance, lag)
    valley &= np.maximum.accumulate(distance, axis=1)[:, lag] >= _RISEN
    best = np.where(valley, here, np.inf).min(axis=1, keepdims=True)
    valley &= here <= best + _SLACK
    valley &= np.cumsum(valley, axis=1) <= _CANDIDATES
    with np.errstate(invalid="ignore", divide="ignore"):
        tip = 0.5 * reach * (left - right) / (left - 2 * here + right)  # vertex of the parabola through three points
        cycles = np.where(valley, (n_samples - 1) / (lag + np.clip(tip, -reach, reach)), np.nan)
    order = np.argsort(~valley, axis=1, kind="stable")[:, :_CANDIDATES]
    return np.take_along_axis(cycles, order, axis=1)


def _share_of(lag: NDArray[np.intp], share: float) -> NDArray[np.intp]:
    return np.asarray(share * lag, dtype=np.intp)


def _averaged(distance: Array) -> Array:
    """Each lag's value (n, R) averaged over the lags within a share of it."""
    lag = np.arange(distance.shape[1])
    reach = np.minimum(_share_of(lag, _AVERAGED), len(lag) - 1 - lag)
    sums = np.zeros((len(distance), len(lag) + 1))
    np.cumsum(distance, axis=1, out=sums[:, 1:])
    means = (sums[:, lag + reach + 1] - sums[:, lag - reach]) / (2 * reach + 1)
    return np.where(reach > 0, means, distance)


def _lowest_near(distance: Array, lag: NDArray[np.intp]) -> Array:
    """Least value within a tenth of each lag (n, len(lag)): from minima over 1, 2, 4, ... neighbors."""
    reach = np.maximum(_share_of(lag, _VALLEY), 1)
    first = lag - reach
    count = np.minimum(lag + reach, distance.shape[1] - 1) - first + 1
    lowest, width, result = distance, 1, np.empty((len(distance), len(lag)))
    while True:
        now = (count >= width) & (count < 2 * width)
        start = first[now]
        result[:, now] = np.minimum(lowest[:, start], lowest[:, start + count[now] - width])
        if 2 * width > count.max():
            return result
        lowest = np.minimum(lowest[:, :-width], lowest[:, width:])
        width *= 2


def find_cycles(rows: Array, lengths: NDArray[np.intp]) -> Periodicity:
    """The number of periods of each recording (n, d, R) of `lengths` (n,) samples: all candidates refined and compared.

    The shortest wins that no longer one beats clearly: a multiple of the period explains as much, and a little of the
    noise. The residual variance is divided by its share of residual degrees of freedom, ``1 - 1 / cycles``.
    """
    rough = candidates(rows, lengths)
    chosen = np.isfinite(rough)
    owner, column = np.nonzero(chosen)
    result = Periodicity(np.full(len(rows), np.nan), np.zeros(len(rows)))
    if len(owner) == 0:
        return result
    centered = rows - rows.mean(axis=2, keepdims=True)
    with single_threaded_blas():  # products this small take many times as long in two threads
        cycles, left = refine(centered[owner], rough[chosen], lengths[owner])
    residuals, refined = np.full(rough.shape, np.inf), rough.copy()
    residuals[owner, column] = left / np.maximum(1 - 1 / cycles, 1e-3) + _ROUNDING
    refined[owner, column] = cycles
    good = residuals * _MUCH_BETTER <= residuals.min(axis=1, keepdims=True)
    pick = np.argmax(good, axis=1)[:, None]
    some = chosen.any(axis=1)
    result.cycles[some] = np.take_along_axis(refined, pick, axis=1)[some, 0]
    result.explained[some] = 1 - np.take_along_axis(residuals, pick, axis=1)[some, 0]
    return result


def refine(rows: Array, cycles: Array, lengths: NDArray[np.intp]) -> tuple[Array, Array]:
    """Cycles (m,) known to a sample's width, or to two percent, improved, and the share of the variance left (m,).

    Variable projection (G. H. Golub and V. Pereyra, 1973) by a scan as fine as the narrowest dip, then Gauss-Newton.
    """
    n_harmonics = np.clip((lengths - 1) / cycles / _PER_HARMONIC, 1, _HARMONICS).astype(np.intp)
    total = (rows**2).sum(axis=(1, 2))

    def unexplained(trial: Array) -> Array:
        fit = operators.fit_harmonics(rows, trial, n_harmonics)
        return np.asarray(((rows - fit.fitted) ** 2).sum(axis=(1, 2)) / total)

    # Change of `cycles` when the period changes by half a sample, or by what noise does to a valley.
    width = np.maximum(0.5 * cycles**2 / (rows.shape[2] - 1), _AVERAGED * cycles)
    # Steps of the scan, of each recording for itself, whatever others need.
    n_steps = np.clip(np.ceil(2 * width * n_harmonics), 2, 40).astype(np.intp)
    best, left = cycles.copy(), unexplained(cycles)
    for step in range(-int(n_steps.max()), int(n_steps.max()) + 1):
        trial = cycles + np.clip(step / n_steps, -1, 1) * width
        value = unexplained(trial)
        best, left = np.where(value < left, trial, best), np.minimum(value, left)
    for _ in range(_NEWTON_STEPS):
        trial = best + np.clip(_newton_step(rows, best, n_harmonics), -width / n_steps, width / n_steps)
        value = unexplained(trial)
        best, left = np.where(value < left, trial, best), np.minimum(value, left)
    return best, left


def _newton_step(rows: Array, cycles: Array, n_harmonics: NDArray[np.intp]) -> Array:
    """Gauss-Newton step of `cycles` on the residual, the series' own freedom projected out."""
    fit = operators.fit_harmonics(rows, cycles, n_harmonics)
    position, h = np.linspace(0.0, 1.0, rows.shape[2]), np.arange(fit.coefficients.shape[2])
    turns = np.exp(2j * np.pi * cycles[:, None, None] * position * h[:, None])  # (n, H + 1, R)
    speed = 2 * ((2j * np.pi * h * fit.coefficients) @ turns).real * position  # of the series by `cycles`
    free = speed - operators.fit_harmonics(speed, cycles, n_harmonics).fitted
    return np.asarray(((rows - fit.fitted) * free).sum(axis=(1, 2)) / (free**2).sum(axis=(1, 2)))
