"""Methods of segmentation, and their table: rests, minima of speed, and change points of the velocity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from kineme.errors import SpecificationError
from kineme.movements.segmentation.motion import (
    Motion,
    Rows,
    consecutive,
    durations_of,
    merge_across,
    moving_bouts,
    onset_rows,
    typical_duration,
)
from kineme.validation import Array, check_count, check_number

_MIN_REST, _MIN_BETWEEN = 0.035, 0.1  # of the typical duration of a movement
_ROUNDS = 10  # at most: the typical movement gets longer with every pause that is no rest


@dataclass(frozen=True)
class Rest:
    """Cut in the middle of every rest.

    The recording rests where its speed stays below a share of the robust peak speed; a movement is a run above that
    share which reaches twice the share somewhere (hysteresis, so that noise near the threshold does not cut it).

    Parameters
    ----------
    speed : float, default 0.05
        Share of the recording's peak speed below which it rests. A movement that never exceeds twice this share is
        missed: lower it for recordings with both slow and fast movements.
    min_rest : float, optional
        A shorter rest is a pause within a movement [s]; by default 0.035 of the typical movement, which
        is as long as it is without these pauses. Measured between extrapolated ends, so that a smooth reversal is not a
        rest, however slow it is.
    min_movement : float, optional
        A shorter movement is a twitch within a rest [s]; by default a tenth of the typical movement.

    Notes
    -----
    Half of the moving time is spent in movements at least as long as the typical one. Defaults that are shares of it
    make the cuts independent of tempo; fix them in seconds when you know the task.
    """

    speed: float = 0.05
    min_rest: float | None = None
    min_movement: float | None = None

    def __post_init__(self) -> None:
        check_number("speed", self.speed, above=0.0)
        if self.speed >= 0.5:
            raise SpecificationError(f"expected speed to be a share of the peak speed below 0.5, got {self.speed!r}")
        for name in ("min_rest", "min_movement"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), least=0.0)

    @property
    def resolution(self) -> float:
        """Share of the peak speed that must be distinguished from rest."""
        return self.speed

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, without the ends of the recording."""
        bouts, last_enough = self._bouts(motion)
        bouts = bouts[last_enough]
        return (bouts[:-1, 1] + bouts[1:, 0]) // 2

    def pieces(self, motion: Motion) -> Rows:
        """The piece of each movement: it ends in the middle of the rests beside it, or between it and a twitch."""
        bouts, last_enough = self._bouts(motion)
        middles = (bouts[:-1, 1] + bouts[1:, 0]) // 2
        edges = np.concatenate(([0], middles, [len(motion.times)]))
        return np.column_stack((edges[:-1], edges[1:]))[last_enough]

    def _bouts(self, motion: Motion) -> tuple[Rows, NDArray[np.bool_]]:
        """Runs of motion, rows (n, 2), and which of them are movements."""
        low = max(self.speed * motion.peak, 2.0 * motion.noise)
        bouts = moving_bouts(motion.speed, low, 2.0 * low)
        if not len(bouts):  # motion so slow and even that no bout reaches the upper threshold
            return np.array([[0, len(motion.times)]]), np.array([True])
        # A rest is measured between extrapolated ends: a smooth reversal is no rest, however long it is slow.
        bouts = onset_rows(motion, consecutive((bouts[:-1, 1] + bouts[1:, 0]) // 2, len(motion.times)))
        bouts = self._without_pauses(bouts, motion)
        lasting = durations_of(bouts, motion.times)
        least = _MIN_BETWEEN * typical_duration(lasting) if self.min_movement is None else self.min_movement
        return bouts, lasting >= least

    def _without_pauses(self, bouts: Rows, motion: Motion) -> Rows:
        """Bouts merged across pauses."""
        if self.min_rest is not None:
            return merge_across(bouts, motion.times, self.min_rest)
        for _ in range(_ROUNDS):
            before = len(bouts)
            typical = typical_duration(durations_of(bouts, motion.times))
            bouts = merge_across(bouts, motion.times, _MIN_REST * typical)
            if len(bouts) == before:
                break
        return bouts


_FLOOR = 0.02  # of the peak speed: lower speeds count as equally slow
_MIN_MOVEMENT = 0.1  # of the typical piece


@dataclass(frozen=True)
class SpeedMinima:
    """Cut at minima of speed, and optionally at corners taken without slowing down.

    A minimum counts where the speed falls below a share of the lower one of the two peaks beside it: a prominence
    in the logarithm of speed, so that slow and fast, small and large movements are cut alike.

    Parameters
    ----------
    depth : float, default 0.33
        The share. People slow down in bends, too (speed falls with the cube root of curvature): a larger share cuts
        there.
    turn : float, optional
        Also cut where the direction turns by more than this angle [rad] within ``span``; by default nowhere.
    span : float, default 0.02
        Length over which directions before and after are taken, as a share of the recording's extent.
    min_movement : float, optional
        Smallest distance between cuts [s]; by default a tenth of the typical piece.
    """

    depth: float = 0.33
    turn: float | None = None
    span: float = 0.02
    min_movement: float | None = None

    def __post_init__(self) -> None:
        for name in ("depth", "span"):
            check_number(name, getattr(self, name), above=0.0)
            if getattr(self, name) >= 1:
                raise SpecificationError(f"expected {name} to be a share below 1, got {getattr(self, name)!r}")
        if self.turn is not None:
            check_number("turn", self.turn, above=0.0)
            if self.turn >= np.pi:
                raise SpecificationError(f"expected turn below pi, got {self.turn!r}; angles are in radians")
        if self.min_movement is not None:
            check_number("min_movement", self.min_movement, least=0.0)

    @property
    def resolution(self) -> float:
        """Share of the peak speed that must be distinguished from rest."""
        return 2.0 * _FLOOR

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, without the ends of the recording."""
        t = motion.times - motion.times[0]
        even = np.linspace(0.0, t[-1], len(t))
        slowness = np.interp(even, t, -np.log(motion.speed + max(_FLOOR * motion.peak, 2.0 * motion.noise)))
        least = -np.log(self.depth)
        cuts = find_peaks(slowness, prominence=least)[0]
        if self.turn is not None:  # on the same scale: a corner of exactly `turn` counts as just deep enough
            corners = (
                least * turning(motion, self.span * float(np.linalg.norm(np.ptp(motion.positions, axis=0)))) / self.turn
            )
            corners = np.interp(even, t, corners)
            cuts = np.union1d(cuts, find_peaks(corners, height=least, distance=3)[0])
            slowness = np.maximum(slowness - slowness.min(), corners)
        if self.min_movement is not None:
            apart = float(self.min_movement)
        else:
            apart = _MIN_MOVEMENT * typical_duration(np.diff(even[np.concatenate(([0], cuts, [-1]))]))
        chosen = _apart(cuts, slowness[cuts], apart * (len(t) - 1) / t[-1])
        rows = np.searchsorted(t, even[chosen])
        return np.unique(rows[(rows > 0) & (rows < len(t) - 1)])

    def pieces(self, motion: Motion) -> Rows:
        """The pieces between cuts, rows (n, 2)."""
        return consecutive(self.inner_cuts(motion), len(motion.times))


def turning(motion: Motion, span: float) -> Array:
    """Angle [rad] between the directions over the path lengths `span` before and after each sample, shape (T,)."""
    x = motion.positions
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1)))

    def at(s: Array) -> Array:
        return np.column_stack([np.interp(s, length, column) for column in x.T])

    before, after = x - at(length - span), at(length + span) - x
    product = np.einsum("ij,ij->i", before, after)
    norms = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
    inside = (length > span) & (length < length[-1] - span) & (norms > 0)
    cosine = np.divide(product, norms, out=np.ones_like(norms), where=inside)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _apart(cuts: Rows, strength: Array, distance: float) -> Rows:
    """Keep the strongest cuts, none closer than `distance` samples to a stronger one."""
    is_far = np.zeros(len(cuts), dtype=bool)
    for i in np.argsort(-strength, kind="stable"):
        is_far[i] = not (np.abs(cuts[is_far] - cuts[i]) < distance).any()
    return cuts[is_far]


_MOST_POINTS = 10_000
_MIN_POINTS = 5  # even points per piece


@dataclass(frozen=True)
class ChangePoints:
    """Cut at change points of the velocity: kernel change-point detection, PELT or dynamic programming.

    The velocity, in peak speeds, is taken at ``n_points`` even times and cut so that the sum of squared distances to
    each piece's mean, in the feature space of a Gaussian kernel, is smallest. Rest, motion there and motion back are
    three regimes; within a bend the velocity changes continuously, and cuts there mean little.

    Parameters
    ----------
    penalty : float, default 0.1
        Cost of one more cut: larger means fewer cuts. Its unit is the cost of one characteristic time, ``sqrt(mean
        squared speed / mean squared acceleration)``, spent unlike the rest of the piece; so neither the tempo nor the
        length of the recording matters. Not used with ``n_pieces``.
    n_pieces : int, optional
        The number of pieces, if it is known; pieces at rest count.
    n_points : int, default 1000
        Time resolution; the cost grows with its square. At most 10,000.

    References
    ----------
    S. Arlot, A. Celisse, Z. Harchaoui, "A kernel multiple change-point algorithm via model selection", Journal of
    Machine Learning Research 20, 2019.
    """

    penalty: float = 0.1
    n_pieces: int | None = None
    n_points: int = 1000

    def __post_init__(self) -> None:
        check_number("penalty", self.penalty, above=0.0)
        check_count("n_points", self.n_points, 2 * _MIN_POINTS, most=_MOST_POINTS)
        if self.n_pieces is not None:
            check_count("n_pieces", self.n_pieces, 1)
            if self.n_pieces * _MIN_POINTS > self.n_points:
                raise SpecificationError(
                    f"expected n_points of at least {_MIN_POINTS} per piece, got {self.n_points} for "
                    f"{self.n_pieces} pieces"
                )

    @property
    def resolution(self) -> float:
        """Share of the peak speed that must be distinguished from rest."""
        return 0.05

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, without the ends of the recording."""
        t = motion.times - motion.times[0]
        even = np.linspace(0.0, t[-1], self.n_points)
        velocity = np.gradient(motion.positions, t, axis=0) / motion.peak
        signal = np.column_stack([np.interp(even, t, column) for column in velocity.T])
        try:
            import ruptures  # type: ignore[import-untyped, import-not-found, unused-ignore]
        except ImportError:
            raise SpecificationError(
                'expected the library ruptures for by="change-points", found none; '
                'pip install "kineme[segmentation]", or choose by="rest" or by="speed"'
            ) from None
        detector = ruptures.KernelCPD(kernel="rbf", min_size=_MIN_POINTS, params={"gamma": 1.0}).fit(signal)
        if self.n_pieces == 1:
            return np.zeros(0, dtype=np.intp)
        if self.n_pieces is not None:
            breakpoints = detector.predict(n_bkps=self.n_pieces - 1)
        else:
            acceleration = np.gradient(velocity, t, axis=0)
            characteristic = np.sqrt((velocity**2).sum() / (acceleration**2).sum())
            breakpoints = detector.predict(pen=self.penalty * float(characteristic) / even[1])
        rows = np.searchsorted(t, even[np.array(breakpoints[:-1], dtype=np.intp)])
        return np.unique(rows[(rows > 0) & (rows < len(t) - 1)])

    def pieces(self, motion: Motion) -> Rows:
        """The pieces between cuts that move most of the time, rows (n, 2)."""
        pieces = consecutive(self.inner_cuts(motion), len(motion.times))
        fast = motion.speed > 2.0 * max(self.resolution * motion.peak, 2.0 * motion.noise)
        return pieces[2 * np.add.reduceat(fast, pieces[:, 0], dtype=np.intp) > pieces[:, 1] - pieces[:, 0]]


class Segmenter(Protocol):
    """A segmentation method: a frozen record of its parameters."""

    @property
    def resolution(self) -> float:
        """Share of the peak speed that has to be told from rest."""
        ...

    def inner_cuts(self, motion: Motion) -> Rows:
        """Rows at which one movement ends and the next begins, increasing, none at the ends."""
        ...

    def pieces(self, motion: Motion) -> Rows:
        """The piece of each movement, rows (n, 2), disjoint and in order; `segment` narrows them to their motion."""
        ...


#: Name -> method.
SEGMENTERS: dict[str, type[Any]] = {"rest": Rest, "speed": SpeedMinima, "change-points": ChangePoints}
