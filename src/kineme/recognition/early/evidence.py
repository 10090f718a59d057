"""The evidence for hypotheses about a movement that has begun: roughly for all of them, then in full for a few."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError
from kineme.kernels.pair_distances import pair_distances
from kineme.movements.preparation.pauses import uninterrupted
from kineme.movements.preparation.resample import arc_length_phase, relative_rows
from kineme.movements.trajectories.demonstrations import Demonstrations, check_labels
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.recognition.early.hypotheses import (
    ALLOWANCE,
    EXPLAINING,
    Hypotheses,
    Prefixes,
    beginnings,
    describe_prefixes,
    positive,
)
from kineme.similarity.comparison import Comparison
from kineme.similarity.describe import Described, describe_paths, detailed_paths, smooth_evenly
from kineme.similarity.specification import LOG_MEANS
from kineme.validation import MIN_SAMPLES, Array

_TILE = 2_000_000  # hypotheses compared at a time
_N_SAMPLES = 200  # of a whole movement, of which `cut` takes the first

COMPARED = 200  # hypotheses compared pair by pair, and the best one of each class
WIDENED = 2.0  # widths of positions where they choose those
ROTATION = 10.0  # weight of the rotation prior, whose unit is the inner product of two equal paths
SPEED_SPREAD = 0.5  # of the logarithm of the speed at the end
PROGRESS = 0.25  # exponent of the density of progress
POWER = 3.0  # of the similarity of whole movements, beside the evidence for beginnings
NEGLIGIBLE = 5.0  # whole movements are not compared if they have less than exp(-5) of the largest evidence

_WHOLE = np.ones(1)


class Begun(NamedTuple):
    """n movements so far: as beginnings, described, and their paths (n, d, T), to be described as whole movements."""

    prefixes: Prefixes
    described: Described
    paths: Array
    details: Array
    durations: Array


def describe_begun(
    stored: Hypotheses, paths: Array, starts: Array, durations: Array, wholes: tuple[Array, Array]
) -> Begun:
    """Describe the smooth, evenly timed paths (n, d, T), relative to their first recorded positions (n, d).

    `wholes` are the same paths with their pauses cut as those of whole movements are, and in detail, see
    `ComparisonSpecification.detailed_cutoff`.
    """
    prefixes = beginnings(paths, _WHOLE, over_time=stored.are_signals)
    shift = 0.0 if stored.comparison.normalization.translation else stored.comparison.turned(starts)[:, :, None]
    described = describe_prefixes(prefixes, stored.procrustes, signals=stored.are_signals)
    return Begun(prefixes, described, wholes[0] + shift, wholes[1] + shift, durations)


def log_evidence(stored: Hypotheses, begun: Begun) -> Array:
    """Return logarithm of the evidence for each hypothesis, shape (n, m * G); -inf where another is far more likely.

    ``log mean_r exp(-d_r^2 / (2 sigma_r^2))`` over elastic path and point cloud, after the rotation that brings the
    positions closest, plus the logarithms of the density of that rotation, of a normal density of log size and log
    duration ratio, of Cauchy densities of timing and of the speed at the end, and of the progress, all up to constants.
    Short beginnings are alike, so that much fits them by chance: longer ones are a little likelier. And the movement is
    not over, which its speed tells, see `Ending`; if it is, the recognizer's similarity of whole movements counts.

    The positions' own distances, which are much cheaper, choose the hypotheses for which it is computed: the 200 best
    and the best one of each class.
    """
    priors = _log_priors(stored, begun)
    odds = stored.ending.log_odds(begun.prefixes.end_speeds)
    squares = stored.procrustes.squared_distances(begun.described.blocks[0], stored.described.blocks[0])
    rough = priors - squares / (2.0 * (WIDENED * stored.widths[0]) ** 2)
    evidence = np.full(rough.shape, -np.inf)
    for i in range(len(rough)):
        chosen = _choose(stored, rough[i])
        movement = begun.described.take(slice(i, i + 1))
        evidence[i, chosen] = _near(stored, movement, chosen) + priors[i, chosen] - np.logaddexp(0.0, odds[i])
        whole = begun.paths[i : i + 1], begun.details[i : i + 1]
        _add_over(stored, whole, evidence[i], priors[i] - np.logaddexp(0.0, -odds[i]))
    return evidence


def _log_priors(stored: Hypotheses, begun: Begun) -> Array:
    """Return the logarithms of the densities of size, duration, timing, speed at the end, and progress."""
    sizes = np.log(positive(begun.prefixes.lengths))[:, None] - stored.log_lengths
    longer = np.log(positive(begun.durations))[:, None] - stored.log_durations
    timing = begun.prefixes.timing
    norms = (timing**2).sum(axis=1)[:, None] + stored.timing_squares
    late = np.maximum(norms - 2.0 * (timing @ stored.prefixes.timing.T), 0.0)
    early = stored.early
    normal = 0.5 * (sizes / early.size_spread) ** 2 + 0.5 * (longer / early.duration_spread) ** 2
    faster = (begun.prefixes.end_speeds[:, None] - stored.prefixes.end_speeds) / SPEED_SPREAD
    cauchy = (1.0 + late / (2.0 * early.timing_spread**2)) * (1.0 + 0.5 * faster**2)
    progress = np.tile(PROGRESS * np.log(stored.progress), len(stored.durations))
    return np.asarray(progress - normal - np.log(cauchy))


def _choose(stored: Hypotheses, rough: Array) -> NDArray[np.intp]:
    """Hypotheses to be compared pair by pair; all that are equally good are, so that their order does not matter."""
    if len(rough) <= COMPARED:
        return np.arange(len(rough))
    starts = stored.first * len(stored.progress)
    best = np.repeat(np.maximum.reduceat(rough, starts), np.diff(starts, append=len(rough)))
    least = np.partition(rough, len(rough) - COMPARED)[len(rough) - COMPARED]
    return np.flatnonzero((rough >= least) | (rough >= best))


def _near(stored: Hypotheses, movement: Described, chosen: NDArray[np.intp]) -> Array:
    """Return logarithm of the averaged kernel of elastic path and point cloud, times the density of the rotation."""
    others = stored.described.take(chosen)
    assert movement.pairs is not None
    assert others.pairs is not None
    _, rotations = stored.procrustes.align(movement.pairs.positions, others.pairs.positions)
    squares = pair_distances(movement.pairs.shapes, others.pairs.shapes, rotations)[list(movement.pairs.measures), 0]
    logs = squares.astype(float) / (-2.0 * stored.widths[1:, None] ** 2)
    average = LOG_MEANS["arithmetic"](logs)
    if stored.procrustes.prior is None or rotations is None:
        return average
    F = stored.procrustes.prior.matrix(stored.procrustes.n_dims)
    R = rotations[0].astype(float)
    product = R[:, 0] * np.trace(F) if stored.procrustes.n_dims == 2 else np.einsum("kij,ij->k", R, F)
    return np.asarray(average + ROTATION * (product - np.trace(F)))


def _add_over(stored: Hypotheses, whole: tuple[Array, Array], evidence: Array, priors: Array) -> None:
    """Add the evidence that the movement is over, in place, given the other densities (m * G,) if it is.

    It is the recognizer's similarity, which is at most 1, to the power of 3, averaged over each class, and summed over
    classes. If the movement is over, its class is that of the most similar one, nearly always what the recognizer says:
    each class gets a share of that sum in proportion to its largest similarity to the power of 3, whatever its size and
    duration.
    """
    G, counts = len(stored.progress), np.diff(stored.first, append=len(stored.durations))
    most = priors[G - 1 :: G]
    if most.max() < evidence.max() - NEGLIGIBLE:
        return
    rotations = stored.comparison if stored.early.max_angle is None else stored
    described = describe_paths(*whole, stored.comparison, rotations.procrustes)
    similar = POWER * stored.comparison.similarity.log_average(described, stored.wholes)[0]
    log_counts = np.log(counts)
    over = np.logaddexp.reduce(most + similar - np.repeat(log_counts, counts))
    parts = np.split(similar, stored.first[1:])
    best = stored.first + np.array([part.argmax() for part in parts])
    shares = similar[best] - np.logaddexp.reduce(similar[best])
    at = best * G + G - 1
    evidence[at] = np.logaddexp(evidence[at], over + shares + log_counts + math.log(G / EXPLAINING))


def partial_shares(comparison: Comparison, stored: Hypotheses, X: MovementsLike) -> Array:
    """Return share of each class, and, last, of an unknown movement, in the evidence of each beginning: (n, C + 1)."""
    demos = comparison.checked(X)
    step = max(1, _TILE // len(stored.prefixes.lengths))
    return np.concatenate(
        [_shares(comparison, stored, demos[start : start + step]) for start in range(0, len(demos), step)]
    )


def _shares(comparison: Comparison, stored: Hypotheses, demos: Demonstrations) -> Array:
    how = comparison.specification
    wholes = detailed_paths(demos, 0, len(demos), how)
    demos = uninterrupted(demos, 0, len(demos), ALLOWANCE) or demos
    paths = smooth_evenly(demos, 0, len(demos), how.cutoff)
    starts = demos.positions[demos.offsets[:-1]]
    return stored.shares(log_evidence(stored, describe_begun(stored, paths, starts, demos.durations, wholes)))


def cut(movements: MovementsLike, fraction: float) -> Demonstrations:
    """Return the beginnings of movements until a share of their path's length, at even times."""
    demos = Demonstrations.of(movements)
    if not 0 < fraction <= 1:
        raise SpecificationError(f"expected a fraction above 0 and at most 1, got {fraction!r}")
    paths = relative_rows(demos, 0, len(demos), _N_SAMPLES)
    ends = np.maximum((arc_length_phase(paths) <= fraction + 1e-12).sum(axis=1), MIN_SAMPLES)
    seconds = demos.durations / (_N_SAMPLES - 1)
    return Demonstrations.from_arrays(
        [path[:, :end].T for path, end in zip(paths, ends, strict=True)],
        demos.labels,
        [step * np.arange(end) for step, end in zip(seconds, ends, strict=True)],
    )


class PredictsPartial(Protocol):
    """A recognizer, or whatever else names movements by their beginnings."""

    def predict_partial(self, X: MovementsLike) -> NDArray[Any]:
        """Return the most likely class of each beginning, shape (n,)."""
        ...


def earliness(
    recognizer: PredictsPartial,
    X: MovementsLike,
    y: ArrayLike | None = None,
    fractions: Sequence[float] = (0.3, 0.5, 0.7, 1.0),
) -> Array:
    """Return the share of movements recognized after each fraction of their path, shape (len(fractions),)."""
    demos = Demonstrations.of(X)
    labels = check_labels(demos, y)
    return np.array([np.mean(recognizer.predict_partial(cut(demos, fraction)) == labels) for fraction in fractions])
