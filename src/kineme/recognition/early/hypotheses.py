"""Which stored movement, and how much of it: hypotheses about a movement that is not over yet."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.comparison.sampling import evenly_spaced
from kineme.comparison.similarity import LOG_MEANS
from kineme.errors import SpecificationError
from kineme.kernels.procrustes import Prepared, Procrustes
from kineme.recognition.early.prefixes import Prefixes, beginnings, smooth_paths
from kineme.validation import Array, check_count, check_number

if TYPE_CHECKING:
    from kineme.recognition.recognizer import Recognizer

_WIDTH = 0.35  # of the typical distance to a beginning of another class, as for whole movements
_WIDTH_MOVEMENTS = 60  # that the widths are estimated from, at most
_NO_IMPOSTOR = 0.1  # width where no two beginnings differ
#: An unknown movement is as far as a typical impostor, and as unlikely in size, duration and timing as a true one.
_LOG_UNKNOWN = -0.5 / _WIDTH**2 - 1.5
_EXPLAINING = 20  # a movement that explains a beginning perfectly does so at about one in 20 values of progress
_MOST_PROGRESS = 1000  # beginnings of one movement
_KNOWN_SIZE = 0.1  # spread where the recognizer leaves sizes as they are


@dataclass(frozen=True)
class Early:
    """How movements are recognized before they are over.

    Parameters
    ----------
    n_progress : int, default 40
        Beginnings stored of each movement. On a coarse grid a corner that has just been passed falls between two.
    size_spread : float, default 0.7
        Standard deviation of the logarithm of the ratio of sizes of two movements of one kind: 0.7 makes a factor of 4
        either way two standard deviations. Take 0.1 where the application knows the size, math.inf where anything
        goes: then a short beginning of anything is a small copy of something straight.
    duration_spread : float, default 0.35
        The same for durations: a factor of 2 either way is two standard deviations.
    timing_spread : float, default 0.05
        Root mean square difference of the times at which the same share of the path is reached, as a share of the time
        so far. Its influence grows only as a logarithm, so that a hesitation cannot shout down the path.
    max_angle : float, optional
        Largest rotation [rad]; by default the recognizer's.
    """

    n_progress: int = 40
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
    """What a user passed, or the defaults for None."""
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
    first : ndarray of shape (C,)
        Index of the first movement of each class.
    progress : ndarray of shape (G,)
    paths : ndarray of shape (m, d, T)
        The smoothed movements, minus their start.
    durations : ndarray of shape (m,)
    stored : Prefixes
    views : tuple of Prepared
        Positions and directions.
    widths : ndarray of shape (2,)
    log_lengths, log_durations : ndarray of shape (m * G,)
        Of the stored beginnings.
    timing_squares : ndarray of shape (m * G,)
        Squared norms of the rows of `stored.timing`.
    """

    early: Early
    procrustes: Procrustes
    first: NDArray[np.intp]
    progress: Array
    paths: Array
    durations: Array
    stored: Prefixes
    views: tuple[Prepared, ...]
    widths: Array
    log_lengths: Array
    log_durations: Array
    timing_squares: Array

    def log_evidence(self, seen: Prefixes, durations: Array) -> Array:
        """Logarithm of the evidence for each hypothesis, shape (n, m * G).

        ``log mean_r exp(-d_r^2 / (2 sigma_r^2))`` over positions and directions, each after the best rotation, plus
        the logarithms of a normal density of log size and log duration ratio, and of a Cauchy density of timing, all
        up to constants.
        """
        squares = zip(prepare(self.procrustes, seen), self.views, self.widths, strict=True)
        near = LOG_MEANS["arithmetic"](
            np.stack([-self.procrustes.squared_distances(a, b) / (2.0 * w * w) for a, b, w in squares])
        )
        sizes = np.log(_positive(seen.lengths))[:, None] - self.log_lengths
        longer = np.log(_positive(durations))[:, None] - self.log_durations
        near -= 0.5 * (sizes / self.early.size_spread) ** 2 + 0.5 * (longer / self.early.duration_spread) ** 2
        norms = (seen.timing**2).sum(axis=1)[:, None] + self.timing_squares
        late = norms - 2.0 * (seen.timing @ self.stored.timing.T)
        return np.asarray(near - np.log1p(np.maximum(late, 0.0) / (2.0 * self.early.timing_spread**2)))

    def log_classes(self, evidence: Array) -> Array:
        """Logarithm of the evidence for each class (n, C), and, last, for an unknown movement: shape (n, C + 1).

        Summed over progress, which is not known, and averaged over a class's movements: a beginning that several
        movements explain, each in several ways, is better explained than one that fits a single one by chance.
        """
        G = len(self.progress)
        top = evidence.max(axis=1, keepdims=True)
        sums = np.add.reduceat(np.exp(evidence - top), self.first * G, axis=1)
        counts = np.diff(self.first, append=len(self.durations)) * (G / _EXPLAINING)
        with np.errstate(divide="ignore"):
            known = np.log(sums / counts) + top
        return np.column_stack((known, np.full(len(evidence), _LOG_UNKNOWN)))


def known_hypotheses(recognizer: Recognizer, early: Early) -> Hypotheses:
    """The hypotheses of a fitted recognizer, kept from the last time that the same ones were asked for."""
    known: dict[Early, Hypotheses] = recognizer.hypotheses_
    if early not in known:
        made = hypotheses(recognizer, early)
        known.clear()  # one at a time: memory stays linear in the stored movements
        known[early] = made
    return known[early]


def hypotheses(recognizer: Recognizer, early: Early) -> Hypotheses:
    """Prepare the beginnings of a recognizer's stored movements."""
    if recognizer.scale == "none" and early.size_spread == Early.size_spread:
        early = Early(early.n_progress, _KNOWN_SIZE, early.duration_spread, early.timing_spread, early.max_angle)
    procrustes = recognizer.procrustes_
    if early.max_angle is not None:
        procrustes = Procrustes(recognizer.n_dims_, early.max_angle)
    progress = np.arange(1, early.n_progress + 1) / early.n_progress
    paths = smooth_paths(recognizer.demonstrations_, recognizer.cutoff)
    stored = beginnings(paths, progress)
    views = prepare(procrustes, stored)
    labels = np.searchsorted(recognizer.classes_, recognizer.labels_)
    return Hypotheses(
        early,
        procrustes,
        recognizer.first_,
        progress,
        paths,
        recognizer.demonstrations_.durations,
        stored,
        views,
        _widths(procrustes, views, labels),
        np.log(_positive(stored.lengths)),
        np.log(_positive(np.repeat(recognizer.demonstrations_.durations, len(progress)) * stored.elapsed)),
        (stored.timing**2).sum(axis=1),
    )


def prepare(procrustes: Procrustes, prefixes: Prefixes) -> tuple[Prepared, ...]:
    """Positions and directions ready for comparison; single precision, which is far finer than any width."""
    return tuple(procrustes.prepare(rows.astype(np.float32)) for rows in (prefixes.positions, prefixes.directions))


def _widths(procrustes: Procrustes, views: tuple[Prepared, ...], labels: NDArray[np.intp]) -> Array:
    """A share of the typical distance from a beginning to the nearest one of another class, at any progress."""
    m, G = len(labels), len(views[0].rows) // len(labels)
    chosen = evenly_spaced(m, _WIDTH_MOVEMENTS)
    rows = (chosen[:, None] * G + np.arange(G)).ravel()
    own = np.repeat(labels[chosen], G)
    if (own == own[0]).all():
        own = np.repeat(chosen, G)
    widths = []
    for view in views:
        some = view.take(rows)
        squares = procrustes.squared_distances(some, some)
        squares[own[:, None] == own] = np.inf
        nearest = np.sqrt(squares.min(axis=1))
        nearest = nearest[np.isfinite(nearest) & (nearest > 0)]
        widths.append(_WIDTH * float(np.median(nearest)) if len(nearest) else _NO_IMPOSTOR)
    return np.array(widths)


def _positive(values: Array) -> Array:
    return np.maximum(values, np.finfo(float).tiny)
