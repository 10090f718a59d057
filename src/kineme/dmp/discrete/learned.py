"""The arrays of learned movements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from kineme.dmp.batch import Batch
from kineme.dmp.discrete.specification import Specification
from kineme.dmp.recorded_as import RecordedAs
from kineme.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class Learned(Batch):
    """What `Primitives` holds; its arrays are explained there."""

    ROWS = {  # noqa: RUF012 - declared as a class variable by Batch
        "scaled_weights": "ndN",
        "starts": "nd",
        "goals": "nd",
        "velocities": "nd",
        "durations": "n",
        "extents": "nd",
    }

    dmp: Specification
    scaled_weights: Array
    starts: Array
    goals: Array
    velocities: Array
    durations: Array
    extents: Array
    labels: NDArray[Any] | None = None
    names: tuple[str | None, ...] | None = None
    recorded_as: RecordedAs | None = None
