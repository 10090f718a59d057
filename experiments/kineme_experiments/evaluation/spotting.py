"""Spotting and segmentation, measured on recordings that are concatenated from movements whose labels are known."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.validation import Array

_MOST = 20  # movements of one recording
_LEAST_OVERLAP = 0.5  # intersection over union from which a movement counts as found where it is
_RESTS = (0.2, 1.0)  # shortest and longest [s]
_TRANSITS = (0.3, 0.8)  # from one position to the next, between rests [s]
_LINKS = (0.15, 0.4)  # from the end of one movement into the start of the next, without rest [s]
_DRIFT = 0.03  # speed at rest, in extents of a movement per second
_OFFSET = 0.3  # of each movement, in extents
_NO_REST_BEFORE = 0.25  # share of movements that begin where the transit ends


class Stretch(NamedTuple):
    """From when to when [s], and which movement; None: of no known class."""

    start: float
    end: float
    label: Any


class Concatenated(NamedTuple):
    """One recording, and the movements of which it was made, in order.

    Attributes
    ----------
    recording : Trajectory
    truth : tuple of Stretch
    transits : tuple of Stretch
        Motion from one rest to the next that is no movement of the given ones.
    """

    recording: Trajectory
    truth: tuple[Stretch, ...]
    transits: tuple[Stretch, ...]


@dataclass(frozen=True)
class Counts:
    """How many were found right, how many were found, and how many there are; counts of recordings can be added."""

    n_right: int = 0
    n_found: int = 0
    n_true: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(self.n_right + other.n_right, self.n_found + other.n_found, self.n_true + other.n_true)

    @property
    def precision(self) -> float:
        """Share of what was found that is right; 0 where nothing was found, so that finding nothing is not rewarded."""
        return self.n_right / self.n_found if self.n_found else 0.0

    @property
    def recall(self) -> float:
        """Share of what there is that was found."""
        return self.n_right / self.n_true if self.n_true else 1.0


def concatenate_all(
    movements: Demonstrations, labels: Sequence[Any], seed: Sequence[int], *, rests: bool = True
) -> list[Concatenated]:
    """Recordings of up to twenty movements each, in random order; see `concatenate`.

    Parameters
    ----------
    movements : Demonstrations
    labels : sequence
        Of each movement; None for one that is not to be found.
    seed : sequence of int
        Of the order, the rests and the motion between movements.
    rests : bool, default True
    """
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(movements))
    parts = [order[start : start + _MOST] for start in range(0, len(order), _MOST)]
    return [concatenate(movements[part], [labels[i] for i in part], rng, rests=rests) for part in parts]


def concatenate(
    movements: Demonstrations, labels: Sequence[Any], rng: np.random.Generator, *, rests: bool = True
) -> Concatenated:
    """One recording of movements in a row.

    With `rests`, every movement is followed by a drift, a straight transit to the next position, and, mostly, another
    drift. Without, the end of one is linked to the start of the next by a short smooth curve without a stop.

    Parameters
    ----------
    movements : Demonstrations
    labels : sequence
        Of each movement; None for one that is not to be found.
    rng : numpy.random.Generator
    rests : bool, default True
    """
    paths = [movement.positions - movement.positions.mean(axis=0) for movement in movements]
    times = [movement.times - movement.times[0] for movement in movements]
    step = float(np.median(np.concatenate([np.diff(t) for t in times])))
    extent = float(np.median([np.linalg.norm(np.ptp(x, axis=0)) for x in paths]))
    paths = [x + _OFFSET * extent * rng.normal(size=x.shape[1]) / np.sqrt(x.shape[1]) for x in paths]
    rest = _rest(paths[0][0], rng, step, extent) if rests else paths[0][:0]
    samples, stamps, now = [rest], [np.arange(len(rest)) * step], len(rest) * step
    truth, transits = list[Stretch](), list[Stretch]()
    for i, (x, t, label) in enumerate(zip(paths, times, labels, strict=True)):
        truth.append(Stretch(now, now + float(t[-1]), label))
        between, moving = _between(x, paths[i + 1] if i + 1 < len(paths) else None, rng, step, extent, rests)
        samples += [x, between]
        stamps += [now + t, now + t[-1] + step * np.arange(1, len(between) + 1)]
        now += float(t[-1])
        if rests and moving.stop > moving.start:
            transits.append(Stretch(now + moving.start * step, now + (moving.stop + 1) * step, None))
        now += step * (len(between) + 1)
    recording = Trajectory(np.concatenate(stamps), np.concatenate(samples), name="concatenated")
    return Concatenated(recording, tuple(truth), tuple(transits))


def _rest(position: Array, rng: np.random.Generator, step: float, extent: float) -> Array:
    """A drift from a position, in any direction."""
    n = max(2, round(rng.uniform(*_RESTS) / step))
    velocity = rng.normal(size=len(position)) * _DRIFT * extent / np.sqrt(len(position))
    return np.asarray(position + np.arange(1, n + 1)[:, None] * step * velocity)


def _between(
    ending: Array, following: Array | None, rng: np.random.Generator, step: float, extent: float, rests: bool
) -> tuple[Array, slice]:
    """What lies between two movements, and which of its samples are in transit."""
    if not rests:
        link = ending[:0] if following is None else _link(ending, following, rng, step)
        return link, slice(0, len(link))
    rest = _rest(ending[-1], rng, step, extent)
    if following is None:
        return rest, slice(0, 0)
    second = following[:0] if rng.random() < _NO_REST_BEFORE else _rest(following[0], rng, step, extent)[::-1]
    goal = second[0] if len(second) else following[0]
    u = np.linspace(0.0, 1.0, max(3, round(rng.uniform(*_TRANSITS) / step)))[1:-1, None]
    transit = rest[-1] + u**3 * (10 - 15 * u + 6 * u**2) * (goal - rest[-1])
    return np.concatenate((rest, transit, second)), slice(len(rest), len(rest) + len(transit))


def _link(ending: Array, following: Array, rng: np.random.Generator, step: float) -> Array:
    """A cubic curve that leaves and arrives at the velocities that the movements have there."""
    distance = float(np.linalg.norm(following[0] - ending[-1]))
    fast = max(float(np.quantile(np.linalg.norm(np.diff(x, axis=0), axis=1), 0.9)) for x in (ending, following))
    n = max(3, round(rng.uniform(*_LINKS) / step), round(distance / fast) if fast > 0 else 0)
    u = (np.arange(1, n) / n)[:, None]
    leaving, arriving = (ending[-1] - ending[-3]) / 2 * n, (following[2] - following[0]) / 2 * n
    a, b = ending[-1], following[0]
    return np.asarray(
        (2 * u**3 - 3 * u**2 + 1) * a
        + (u**3 - 2 * u**2 + u) * leaving
        + (3 * u**2 - 2 * u**3) * b
        + (u**3 - u**2) * arriving
    )


def overlap(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Intersection over union of two stretches of time."""
    union = max(a[1], b[1]) - min(a[0], b[0])
    return max(0.0, min(a[1], b[1]) - max(a[0], b[0])) / union if union > 0 else 0.0


def count_spotted(found: Iterable[Any], truth: Sequence[Stretch]) -> Counts:
    """How many movements of known classes were spotted: the label is equal, and at least half of the union common.

    Parameters
    ----------
    found : iterable of Spotted
        What has no label is not counted.
    truth : sequence of Stretch
        Those without a label must not be found.
    """
    named = [one for one in found if one.label is not None]
    known = [one for one in truth if one.label is not None]
    right = sum(
        any(one.label == other.label and overlap(one[:2], other[:2]) >= _LEAST_OVERLAP for one in named)
        for other in known
    )
    return Counts(right, len(named), len(known))


def count_boundaries(cuts: Array, truth: Sequence[Stretch], tolerance: float = 0.15) -> Counts:
    """How many starts and ends of movements were found, each within a share `tolerance` of its movement's duration.

    Parameters
    ----------
    cuts : ndarray of shape (n, 2)
        As of a `Segmentation` [s]; a time that is both an end and a start counts once.
    truth : sequence of Stretch
    """
    found = np.unique(np.asarray(cuts, dtype=np.float64).round(9))
    true = np.array([bound for one in truth for bound in one[:2]])
    within = tolerance * np.repeat([one.end - one.start for one in truth], 2)
    near = np.abs(found[:, None] - true) <= within
    matched = _matched(near)
    return Counts(matched, len(found), len(true))


def _matched(near: NDArray[np.bool_]) -> int:
    """Most pairs of rows and columns that are near, each used once."""
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(near, maximize=True)
    return int(near[rows, columns].sum())
