"""Hypotheses about a movement under way: which stored movement, how much of it, and whether it is over."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Procrustes
from kineme.movements.preparation.pauses import without_pauses
from kineme.recognition.early.prefixes import Prefixes, beginnings, describe_prefixes, smooth_paths
from kineme.similarity.comparison import Comparison
from kineme.similarity.described import Described
from kineme.similarity.references import References
from kineme.similarity.widths import SHARE, beginning_widths
from kineme.validation import Array, check_count, check_number

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
#: A movement that explains a beginning perfectly does so at about one in 20 values of progress.
EXPLAINING = 20
_MOST_PROGRESS = 1000  # beginnings of one movement
_CONCENTRATION = 0.1  # of the rotation prior, where none is given
_KNOWN_SIZE = 0.1  # spread where the recognizer leaves sizes as they are


@dataclass(frozen=True)
class Early:
    """How movements are recognized before they are over.

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
    """The user's options, or the defaults for None."""
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
    references : References
        The whole movements.
    progress : ndarray of shape (G,)
    paths : ndarray of shape (m, d, T)
        The smoothed movements, minus their start.
    durations : ndarray of shape (m,)
    prefixes : Prefixes
    described : Described
        Positions, elastic paths and point clouds.
    widths : ndarray of shape (3,)
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
    references: References
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

    def log_classes(self, evidence: Array) -> Array:
        """Logarithm of the evidence for each class (n, C), and, last, for an unknown movement: shape (n, C + 1).

        Summed over progress, which is not known, and averaged over a class's movements: a beginning that several
        movements explain, each in several ways, is better explained than one that fits a single one by chance.
        """
        G = len(self.progress)
        top = evidence.max(axis=1, keepdims=True)
        sums = np.add.reduceat(np.exp(evidence - top), self.first * G, axis=1)
        counts = np.diff(self.first, append=len(self.durations)) * (G / EXPLAINING)
        with np.errstate(divide="ignore"):
            known = np.log(sums / counts) + top
        return np.column_stack((known, np.full(len(evidence), LOG_UNKNOWN)))

    def shares(self, evidence: Array) -> Array:
        """Share of each class, and, last, of an unknown movement, in the evidence to the power of 0.8: (n, C + 1)."""
        logs = TEMPER * self.log_classes(evidence)
        shares = np.exp(logs - logs.max(axis=1, keepdims=True))
        return np.asarray(shares / shares.sum(axis=1, keepdims=True))


def hypotheses(comparison: Comparison, references: References, early: Early) -> Hypotheses:
    """Prepare the beginnings of the references."""
    if comparison.normalization.scale == "none" and early.size_spread == Early.size_spread:
        early = replace(early, size_spread=_KNOWN_SIZE)
    procrustes = beginning_procrustes(comparison.procrustes, early.max_angle)
    progress = np.arange(1, early.n_progress + 1) / early.n_progress
    demos = references.all_movements()
    demos = without_pauses(demos, 0, len(demos)) or demos
    paths = smooth_paths(demos, comparison.cutoff)
    prefixes = beginnings(paths, progress)
    described = describe_prefixes(prefixes, procrustes)
    return Hypotheses(
        early,
        procrustes,
        comparison,
        references,
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


def beginning_procrustes(whole: Procrustes, max_angle: float | None) -> Procrustes:
    """How beginnings are rotated: by at most an angle, or as whole movements, by default less readily in the plane.

    A beginning is often nearly straight, and the same as any other one if it may be rotated freely.
    """
    if max_angle is not None:
        return Procrustes(whole.n_dims, max_angle)
    if whole.prior is None or whole.prior.concentration is not None:
        return whole
    return replace(whole, prior=replace(whole.prior, concentration=_CONCENTRATION))


def positive(values: Array) -> Array:
    """The values, at least the smallest positive number."""
    return np.maximum(values, np.finfo(float).tiny)


class Ending(NamedTuple):
    """How fast stored movements are at their end and before it: mean and spread of the logarithm of the speed.

    Speeds are shares of the mean speed so far, see `Prefixes`.
    """

    over: tuple[float, float]
    before: tuple[float, float]

    def log_odds(self, speeds: Array) -> Array:
        """Logarithm of the odds that movements of these speeds are over, between -13 and 7.

        The likelihood ratio of two normal densities, times prior odds of 0.05. Being slower than at a typical end is no
        evidence against one, nor is being faster than typical before the end evidence for one. Where movements were
        recorded at full speed until their last sample, the speed says nothing, and the odds stay near the prior ones.
        """
        too_fast = np.maximum(speeds - self.over[0], 0.0) / self.over[1]
        too_slow = np.minimum(speeds - self.before[0], 0.0) / self.before[1]
        return np.asarray(PRIOR_ODDS + np.clip(0.5 * (too_slow**2 - too_fast**2), -MOST_ODDS, MOST_ODDS))


def ending(speeds: Array) -> Ending:
    """From the speeds (m, G) at the ends of beginnings of m movements, the last of which are whole."""
    return Ending(_moments(speeds[:, -1]), _moments(speeds[:, :-1]))


def _moments(speeds: Array) -> tuple[float, float]:
    return float(speeds.mean()), max(float(speeds.std()), _LEAST_SPREAD)
