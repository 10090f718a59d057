"""Segmentation at minima of speed and, optionally, at sharp turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from kineme.errors import SpecificationError
from kineme.movements.segmentation.bouts import Rows, consecutive, typical_duration
from kineme.movements.segmentation.motion import Motion
from kineme.validation import Array, check_number

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
    kept = np.zeros(len(cuts), dtype=bool)
    for i in np.argsort(-strength, kind="stable"):
        kept[i] = not (np.abs(cuts[kept] - cuts[i]) < distance).any()
    return cuts[kept]
