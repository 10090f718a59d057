"""Discrete channels of learned movements: the steps that were recorded, each at its share of the duration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.validation import Array

_ROUNDING = 1e-9  # of a duration: shares that are equal but for rounding


@dataclass(frozen=True, eq=False)
class DiscreteSteps:
    """What the discrete channels of n movements were, and since when.

    Attributes
    ----------
    values : ndarray of shape (m, c)
        Values of the c columns: of each movement at its start, and wherever one changes.
    shares : ndarray of shape (m,)
        When, as a share of the duration: 0 at the start of each movement, 1 at its end.
    offsets : ndarray of shape (n + 1,)
        Movement i has the steps ``offsets[i]:offsets[i + 1]``.
    """

    values: Array
    shares: Array
    offsets: NDArray[np.intp]

    def __post_init__(self) -> None:
        for name in ("values", "shares", "offsets"):
            view = getattr(self, name).view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)

    def at(self, i: int, shares: Array) -> Array:
        """The values (T, c) of movement i at shares (T,) of its duration; past the end the last ones."""
        rows = slice(self.offsets[i], self.offsets[i + 1])
        now = np.searchsorted(self.shares[rows], shares + _ROUNDING, side="right") - 1
        return np.asarray(self.values[rows][now])

    def take(self, chosen: NDArray[np.intp]) -> DiscreteSteps:
        """The steps of the chosen movements, in that order."""
        lengths = np.diff(self.offsets)[chosen]
        offsets = np.concatenate(([0], np.cumsum(lengths)))
        rows = np.arange(offsets[-1]) + np.repeat(self.offsets[:-1][chosen] - offsets[:-1], lengths)
        return DiscreteSteps(self.values[rows], self.shares[rows], offsets)


def steps_of(demonstrations: Demonstrations, columns: Sequence[int]) -> DiscreteSteps:
    """The steps of these columns of `Demonstrations.recorded`."""
    values, first = demonstrations.recorded[:, columns], demonstrations.offsets[:-1]
    changes = np.concatenate(([True], (values[1:] != values[:-1]).any(axis=1)))
    changes[first] = True
    elapsed = demonstrations.times - np.repeat(demonstrations.times[first], demonstrations.lengths)
    kept = np.flatnonzero(changes)
    shares = (elapsed / np.repeat(demonstrations.durations, demonstrations.lengths))[kept]
    return DiscreteSteps(values[kept], shares, np.searchsorted(kept, demonstrations.offsets))


def concatenated(several: Sequence[DiscreteSteps]) -> DiscreteSteps:
    """The steps of the movements of all, in the order given."""
    lengths = np.concatenate([np.diff(one.offsets) for one in several])
    return DiscreteSteps(
        np.concatenate([one.values for one in several]),
        np.concatenate([one.shares for one in several]),
        np.concatenate(([0], np.cumsum(lengths))),
    )
