"""Preprocessing as explicit steps, applied in order and recorded with the result."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from kineme.errors import SpecificationError
from kineme.trajectories.collect import Movements
from kineme.trajectories.demonstrations import Demonstrations


class Step(Protocol):
    """One frozen, hashable record with its own parameters; see `TrimRest`, `Smooth`, `Resample`."""

    def apply(self, demonstrations: Demonstrations) -> Movements:
        """The movements after this step."""
        ...


def preprocess(demonstrations: Demonstrations, steps: Iterable[Step]) -> Demonstrations:
    """Apply steps in order; the result's ``steps`` records them after those already applied."""
    for step in steps:
        if not callable(getattr(step, "apply", None)):
            raise SpecificationError(
                f"expected preprocessing steps such as kineme.TrimRest() or kineme.Smooth(), got {step!r}"
            )
        demonstrations = Demonstrations.of_movements(step.apply(demonstrations), (*demonstrations.steps, step))
    return demonstrations
