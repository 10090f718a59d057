"""Hypotheses about a movement under way: which stored movement, how much of it, and whether it is over.

Beginnings of movements are described independently of position and size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.kernels.pair_distances import ElasticSpec, shapes_of
from kineme.kernels.procrustes import Procrustes
from kineme.movements.preparation.pauses import uninterrupted
from kineme.movements.preparation.resample import arc_length_phase
from kineme.movements.preparation.smooth import Smooth
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.similarity.comparison import Comparison, References
from kineme.similarity.describe import N_POINTS, Described, Pairs, smooth_evenly
from kineme.similarity.similarity import SHARE, beginning_widths
from kineme.similarity.specification import PAIR_QUANTITIES
from kineme.validation import Array, check_count, check_number

N_PREFIX = ElasticSpec().n_segments + 1  # samples of a beginning: the ends of segments
LAST = 0.02  # share of a beginning's time in which the speed at its end is measured
LEAST_SPEED = 0.01  # of the mean speed
#: Pauses count so many times as long as in whole movements, see `cut_pauses`: where somebody rests, at the start or at
#: a corner, tells how far the movement is. With 1, beginnings are recognized less often: 0.02 of LASA's after 30 % of
#: the path, 0.02 of digits by others after half of it.
ALLOWANCE = 4.0
#: What beginnings are compared by pair by pair; signals by the first of these.
_PAIRS = tuple(PAIR_QUANTITIES.index(quantity) for quantity in ("elastic", "cloud"))

_LEAST_SPREAD = 0.4  # of the logarithm of the speed, where there are few movements
MOST_ODDS = 10.0  # of the logarithm of the likelihood ratio: the speed alone settles nothing
#: Logarithm of the odds that a movement is over before its speed is known: about one in 20, as for any other progress.
#: At 0 a movement slows down at a corner and is taken for a whole one of another class, or of a known one.
PRIOR_ODDS = -3.0

#: An unknown movement is 1.5 times as far as a typical impostor, and as unlikely in size, duration and timing as a true
#: one. Movements by people without demonstrations have -4 to -6 of their own class, one in ten less than -8 to -13;
#: movements of no class have -10 after half of their path and -20 or less at its end.
LOG_UNKNOWN = -0.5 * (1.5 / SHARE) ** 2 - 1.5
#: Exponent of the shares. Elastic paths, point clouds, size, duration and timing are not independent: with 1, labels
#: with a share of 0.9 are right less often than that for people without demonstrations.
TEMPER = 0.8
_MOST_UNKNOWN = 600.0  # by which its logarithm is above that of all classes at most: their shares do not become 0
#: A movement that explains a beginning perfectly does so at about one in 20 values of progress.
EXPLAINING = 20
_MOST_PROGRESS = 1000  # beginnings of one movement
_CONCENTRATION = 0.1  # of the rotation prior, where none is given
_KNOWN_SIZE = 0.1  # spread where the recognizer leaves sizes as they are


@dataclass(frozen=True)
class Early:
    """Options of recognizing movements before they are over.

    Parameters
    ----------
    n_progress : int, default 20
        Beginnings stored of each movement. On a coarse grid a corner that has just been passed falls between two.
    size_spread : float, default 0.7
        Standard deviation of the logarithm of the ratio of sizes of two movements of one class: 0.7 makes a factor of 4
        either way two standard deviations. Take 0.1 where the application knows the size, math.inf where anything
        goes: then a short beginning of anything is a small copy of something straight.
    duration_spread : float, default 0.35
        The same for durations: a factor of 2 either way is two standard deviations.
    timing_spread : float, default 0.05
        Root mean square difference of the times at which the same share of the path is reached, as a share of the time
        so far. Its influence grows only as a logarithm, so that a hesitation cannot outweigh the path.
    max_angle : float, optional
        Largest rotation [rad], instead of the recognizer's limit or prior. By default those hold, with a concentration
        of 0.1 in the plane as in space if none is given: beginnings are nearly straight, and equal once turned.
    """

    n_progress: int = 20
    size_spread: float = 0.7
    duration_spread: float = 0.35
    timing_spread: float = 0.05
    max_angle: float | None = None

    def __post_init__(self) -> None:
        check_count("n_progress", self.n_progress, 2, most=_MOST_PROGRESS)
        for name in ("size_spread", "duration_spread", "timing_spread"):
            value = getattr(self, name)
            if not (isinstance(value, float) and value == math.inf):
                check_number(name, value, above=0.0)
        if self.max_angle is not None:
            check_number("max_angle", self.max_angle, least=0.0)


def as_early(early: Any) -> Early:
    """Return the user's options, or the defaults for None."""
    if early is not None and not isinstance(early, Early):
        raise SpecificationError(
            f"expected early to be kineme.recognition.early.hypotheses.Early(...) or None, got {early!r}"
        )
    return early or Early()


class Hypotheses(NamedTuple):
    """Every stored movement at every progress, ready to be compared; rows run over movements, then progress.

    Attributes
    ----------
    early : Early
    procrustes : Procrustes
    comparison : Comparison
        Of whole movements.
    wholes : Described
        The whole movements.
    progress : ndarray of shape (G,)
    paths : ndarray of shape (m, d, T)
        The smoothed movements, minus their start.
    durations : ndarray of shape (m,)
    prefixes : Prefixes
    described : Described
        Positions, elastic paths and, unless they are signals, point clouds.
    widths : ndarray of shape (3,), or (2,) of signals
    log_lengths, log_durations : ndarray of shape (m * G,)
        Of the stored beginnings.
    timing_squares : ndarray of shape (m * G,)
        Squared norms of the rows of `prefixes.timing`.
    ending : Ending
        How fast the movements are at their end, and before it.
    first : ndarray of shape (C,)
        Index of the first stored movement of each class.
    """

    early: Early
    procrustes: Procrustes
    comparison: Comparison
    wholes: Described
    progress: Array
    paths: Array
    durations: Array
    prefixes: Prefixes
    described: Described
    widths: Array
    log_lengths: Array
    log_durations: Array
    timing_squares: Array
    ending: Ending
    first: NDArray[np.intp]

    @property
    def are_signals(self) -> bool:
        """True for movements of one dimension, which are compared over time; see `Representation.signal`."""
        return are_signals(self.comparison)

    def log_classes(self, evidence: Array) -> Array:
        """Return logarithm of the evidence for each class (n, C), and, last, for an unknown movement: shape (n, C + 1).

        Summed over progress, which is not known, and averaged over a class's movements: a beginning that several
        movements explain, each in several ways, is better explained than one that fits a single one by chance.
        """
        G = len(self.progress)
        top = evidence.max(axis=1, keepdims=True)
        sums = np.add.reduceat(np.exp(evidence - top), self.first * G, axis=1)
        counts = np.diff(self.first, append=len(self.durations)) * (G / EXPLAINING)
        with np.errstate(divide="ignore"):
            logs = np.log(sums / counts) + top
        return np.column_stack((logs, np.full(len(evidence), LOG_UNKNOWN)))

    def shares(self, evidence: Array) -> Array:
        """Return the share of each class, and, last, of an unknown movement, in the evidence to 0.8: (n, C + 1)."""
        logs = TEMPER * self.log_classes(evidence)
        logs[:, -1] = np.minimum(logs[:, -1], logs[:, :-1].max(axis=1) + _MOST_UNKNOWN)
        shares = np.exp(logs - logs.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def hypotheses(comparison: Comparison, references: References, early: Early) -> Hypotheses:
    """Prepare the beginnings of the references."""
    if comparison.normalization.scale == "none" and early.size_spread == Early.size_spread:
        early = replace(early, size_spread=_KNOWN_SIZE)
    procrustes = beginning_procrustes(comparison.procrustes, early.max_angle)
    progress = np.arange(1, early.n_progress + 1) / early.n_progress
    demos = references.all_movements()
    demos = uninterrupted(demos, 0, len(demos), ALLOWANCE) or demos
    paths = smooth_paths(demos, comparison.cutoff)
    prefixes = beginnings(paths, progress, over_time=are_signals(comparison))
    described = describe_prefixes(prefixes, procrustes, signals=are_signals(comparison))
    return Hypotheses(
        early,
        procrustes,
        comparison,
        references.described,
        progress,
        paths,
        demos.durations,
        prefixes,
        described,
        beginning_widths(described, np.searchsorted(references.classes, references.labels)),
        np.log(positive(prefixes.lengths)),
        np.log(positive(np.repeat(demos.durations, len(progress)) * prefixes.elapsed)),
        (prefixes.timing**2).sum(axis=1),
        ending(prefixes.end_speeds.reshape(len(demos), -1)),
        references.first,
    )


def are_signals(comparison: Comparison) -> bool:
    """Tell whether movements are signals of one dimension, which are compared over time."""
    return comparison.n_dims == 1 and all(representation.signal for representation in comparison.representations)


def beginning_procrustes(procrustes: Procrustes, max_angle: float | None) -> Procrustes:
    """Limit rotations of beginnings: by an angle, or as those of whole movements, by default less readily in the plane.

    A beginning is often nearly straight, and the same as any other one if it may be rotated freely.
    """
    if max_angle is not None:
        return replace(procrustes, max_angle=max_angle, prior=None)
    if procrustes.prior is None or procrustes.prior.concentration is not None:
        return procrustes
    return replace(procrustes, prior=replace(procrustes.prior, concentration=_CONCENTRATION))


def positive(values: Array) -> Array:
    """Return the values, at least the smallest positive number."""
    return np.maximum(values, np.finfo(float).tiny)


class Ending(NamedTuple):
    """Speed of stored movements at their end and before it: mean and spread of its logarithm.

    Speeds are shares of the mean speed so far, see `Prefixes`.
    """

    over: tuple[float, float]
    before: tuple[float, float]

    def log_odds(self, speeds: Array) -> Array:
        """Return the logarithm of the odds that movements of these speeds are over, between -13 and 7.

        The likelihood ratio of two normal densities, times prior odds of 0.05. Being slower than at a typical end is no
        evidence against one, nor is being faster than typical before the end evidence for one. Where movements were
        recorded at full speed until their last sample, the speed says nothing, and the odds stay near the prior ones.
        """
        too_fast = np.maximum(speeds - self.over[0], 0.0) / self.over[1]
        too_slow = np.minimum(speeds - self.before[0], 0.0) / self.before[1]
        return np.asarray(PRIOR_ODDS + np.clip(0.5 * (too_slow**2 - too_fast**2), -MOST_ODDS, MOST_ODDS))


def ending(speeds: Array) -> Ending:
    """Estimate it from the speeds (m, G) at the ends of beginnings of m movements, the last of which are whole."""
    return Ending(_moments(speeds[:, -1]), _moments(speeds[:, :-1]))


def _moments(speeds: Array) -> tuple[float, float]:
    return float(speeds.mean()), max(float(speeds.std()), _LEAST_SPREAD)


class Prefixes(NamedTuple):
    """G beginnings of each of n movements; S samples each, evenly spaced along their own arc length, or in time.

    Attributes
    ----------
    positions : ndarray of shape (n * G, d * S)
        Minus their mean, at root mean square distance 1 from it; rows have norm 1.
    timing : ndarray of shape (n * G, S)
        Time at each sample as a share of the beginning's, divided by sqrt(S): squared distances are mean squares.
    sizes, lengths : ndarray of shape (n * G,)
        Root mean square distance from the mean, and length of the path, in the unit of the data.
    elapsed : ndarray of shape (n * G,)
        Time that the beginning takes, as a share of the movement's.
    end_speeds : ndarray of shape (n * G,)
        Logarithm of the speed at the end by the mean speed.
    """

    positions: Array
    timing: Array
    sizes: Array
    lengths: Array
    elapsed: Array
    end_speeds: Array


def smooth_paths(movements: Demonstrations, cutoff: float | None) -> Array:
    """Return movements, whose pauses are cut, smoothed, minus their start, at even times: shape (n, d, T)."""
    paths = smooth_evenly(movements, 0, len(movements), cutoff)
    return paths - paths[:, :, :1]


@lru_cache(maxsize=8)
def smoother(cutoff: float) -> Array:
    """Return the smoothing spline on T even samples as a matrix (T, T): it is linear, so it acts on unit vectors."""
    units = Demonstrations.from_arrays([np.eye(N_POINTS)])
    matrix = Smooth(cutoff).apply(units).positions
    matrix.setflags(write=False)
    return matrix


def beginnings(paths: Array, progress: Array, *, over_time: bool = False) -> Prefixes:
    """Describe the beginnings of smooth, evenly timed paths (n, d, T) until each share (G,) of their arc length.

    The path is compared along its arc length, so that hesitation does not deform it; when the samples were
    reached is kept apart, as `timing`. A signal has no shape but its values over time: with `over_time`, progress and
    samples are shares of the time.
    """
    n, d, n_samples = paths.shape
    even, lengths = np.linspace(0.0, 1.0, n_samples), arc_length_phase(paths)
    phase = np.broadcast_to(even, (n, n_samples)) if over_time else lengths
    shift = 2.0 * np.arange(n)[:, None, None]  # one increasing parameter for all movements
    targets = (progress[:, None] * np.linspace(0.0, 1.0, N_PREFIX) + shift).ravel()
    knots = (phase + shift[:, 0]).ravel()
    shape = (n * len(progress), N_PREFIX)
    along = np.stack([np.interp(targets, knots, paths[:, k].ravel()).reshape(shape) for k in range(d)], axis=1)
    elapsed = np.interp(targets, knots, np.tile(even, n)).reshape(shape)
    chords = np.sqrt((np.diff(along, axis=2) ** 2).sum(axis=1))
    centered = along - along.mean(axis=2, keepdims=True)
    sizes = np.sqrt((centered**2).sum(axis=1).mean(axis=1))
    ends = elapsed[:, -1].reshape(n, -1)
    before, until = (
        np.stack([np.interp(share * end, even, length) for end, length in zip(ends, lengths, strict=True)])
        for share in (1.0 - LAST, 1.0)
    )
    return Prefixes(
        (centered / (_nonzero(sizes) * np.sqrt(N_PREFIX))[:, None, None]).reshape(len(along), -1),
        elapsed / (_nonzero(elapsed[:, -1:]) * np.sqrt(N_PREFIX)),
        sizes,
        chords.sum(axis=1),
        elapsed[:, -1],
        np.asarray(np.log(np.maximum((1.0 - before / _nonzero(until)) / LAST, LEAST_SPEED)).ravel()),
    )


def describe_prefixes(prefixes: Prefixes, procrustes: Procrustes, *, signals: bool = False) -> Described:
    """Return beginnings ready for comparison: positions sample by sample, elastic paths and point clouds pair by pair.

    In single precision, which is far finer than any width. Signals have slopes instead of tangents, and no cloud.
    """
    rows = prefixes.positions
    positions = procrustes.prepare(rows.astype(np.float32))
    paths = procrustes.mixed(math.sqrt(N_PREFIX) * rows.reshape(len(rows), -1, N_PREFIX))
    pairs = Pairs(positions, shapes_of(paths, slopes=signals), _PAIRS[:1] if signals else _PAIRS)
    return Described((positions,), procrustes, pairs=pairs)


def _nonzero(values: Array) -> Array:
    return np.where(values > 0, values, 1.0)
