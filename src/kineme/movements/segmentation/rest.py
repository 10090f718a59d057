"""Segmentation at rests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kineme.errors import SpecificationError
from kineme.movements.segmentation.bouts import (
    Rows,
    consecutive,
    durations_of,
    merge_across,
    moving_bouts,
    typical_duration,
)
from kineme.movements.segmentation.motion import Motion
from kineme.movements.segmentation.onset import onset_rows
from kineme.validation import check_number

_MIN_REST, _MIN_MOVEMENT = 0.035, 0.1  # of the typical duration of a movement
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
        least = _MIN_MOVEMENT * typical_duration(lasting) if self.min_movement is None else self.min_movement
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
