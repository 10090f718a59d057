"""Preprocessing as explicit steps, applied in order and recorded with the result."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from kineme.errors import SpecificationError
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.movements.trajectories.movements import Movements
from kineme.movements.trajectories.movements_like import MovementsLike


class Step(Protocol):
    """One frozen, hashable record with its own parameters; see `TrimRest`, `Smooth`, `Resample`."""

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """The movements after this step."""
        ...


def check_steps(steps: Iterable[Step]) -> tuple[Step, ...]:
    """Refuse anything but an iterable of steps; the class of a step, without parentheses, is not a step."""
    try:
        checked = tuple(steps)
    except TypeError:
        raise SpecificationError(
            f"expected a tuple of steps such as (kineme.TrimRest(), kineme.Smooth()), got {steps!r}"
        ) from None
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
