"""Drop the samples at rest before and after a movement; apply preprocessing steps in order and record them."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from kineme.errors import SpecificationError
from kineme.movements.preparation.glitches import without_glitches
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.movements.trajectories.trajectory import MovementsLike
from kineme.validation import MIN_SAMPLES, Array, check_number


@dataclass(frozen=True)
class TrimRest:
    """Drop leading and trailing samples that stay near the first and the last position.

    A badly cropped recording contains rest before and after the movement; a tenth of its duration at rest
    changes the forcing term by a third. Rest is detected by distance, not by speed: that needs no derivative of
    noisy data, and a slow movement is not mistaken for rest.

    Parameters
    ----------
    tolerance : float, default 0.01
        Radius within which the movement is at rest, as a share of its extent (the diagonal of its bounding
        box). Choose it above the noise.

    Notes
    -----
    The last resting sample before, and the first one after the movement are kept, and never fewer than four
    samples remain. A movement that does not move is left as it is.
    """

    tolerance: float = 0.01

    def __post_init__(self) -> None:
        check_number("tolerance", self.tolerance, least=0.0, below=0.5)

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """The movements without their rest."""
        recorded, offsets, lengths = demonstrations.positions, demonstrations.offsets, demonstrations.lengths
        x = without_glitches(recorded, offsets)  # one sample far away would make the extent, and all else near the ends
        first, last = offsets[:-1], offsets[1:] - 1
        extent = np.maximum.reduceat(x, first) - np.minimum.reduceat(x, first)
        radius = self.tolerance * np.linalg.norm(extent, axis=1)
        row = np.arange(len(x))
        away_from_start = _distance(x, x[first], lengths) > np.repeat(radius, lengths)
        away_from_goal = _distance(x, x[last], lengths) > np.repeat(radius, lengths)
        begin = np.minimum.reduceat(np.where(away_from_start, row, len(x)), first) - 1
        end = np.maximum.reduceat(np.where(away_from_goal, row, -1), first) + 1
        begin, end = np.clip(begin, first, last), np.clip(end, first, last)
        begin = np.maximum(np.minimum(begin, end - (MIN_SAMPLES - 1)), first)
        end = np.minimum(np.maximum(end, begin + (MIN_SAMPLES - 1)), last)
        still = extent.max(axis=1) == 0
        begin, end = np.where(still, first, begin), np.where(still, last, end)
        keep = (row >= np.repeat(begin, lengths)) & (row <= np.repeat(end, lengths))
        times, channels = demonstrations.times, demonstrations.movements.recorded
        return replace(
            demonstrations.movements,
            positions=recorded[keep],
            offsets=np.concatenate(([0], np.cumsum(end - begin + 1))),
            times=times[keep],
            durations=times[end] - times[begin],
            recorded=None if channels is None else channels[keep],
        )


def _distance(x: Array, points: Array, lengths: np.ndarray) -> Array:
    return np.asarray(np.linalg.norm(x - np.repeat(points, lengths, axis=0), axis=1))


class Step(Protocol):
    """One frozen, hashable record with its own parameters; see `TrimRest`, `Smooth`, `Resample`."""

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """The movements after this step."""


def check_steps(steps: Iterable[Step]) -> tuple[Step, ...]:
    """Refuse anything but an iterable of steps; the class of a step, without parentheses, is not a step."""
    checked: tuple[Step, ...] = ()
    wrong: list[Any] = [steps]
    with suppress(TypeError):  # of what is not iterable
        checked = tuple(steps)
        wrong = [step for step in checked if isinstance(step, type) or not callable(getattr(step, "apply", None))]
    if wrong:
        raise SpecificationError(
            f"expected a tuple of steps such as (kineme.TrimRest(), kineme.Smooth()), got {wrong[0]!r}"
        )
    return checked


def preprocess(movements: MovementsLike, steps: Iterable[Step]) -> Demonstrations:
    """Apply steps in order to movements; they are appended to the ``steps`` of the result."""
    demonstrations = Demonstrations.of(movements)
    for step in check_steps(steps):
        demonstrations = Demonstrations.of_movements(step.apply(demonstrations), (*demonstrations.steps, step))
    return demonstrations
