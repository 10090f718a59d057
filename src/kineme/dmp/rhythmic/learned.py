"""The arrays of learned limit cycles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.dmp.batch import Batch
from kineme.dmp.recorded_as import RecordedAs
from kineme.dmp.rhythmic.specification import RhythmicSpecification
from kineme.validation import Array


@dataclass(frozen=True, eq=False, repr=False)
class RhythmicLearned(Batch):
    """What `RhythmicPrimitives` holds; its arrays are explained there."""

    ROWS = {  # noqa: RUF012 - declared as a class variable by Batch
        "scaled_weights": "ndN",
        "baselines": "nd",
        "amplitudes": "n",
        "periods": "n",
        "phases": "n",
        "aligned_on": "n",
        "explained": "n",
    }

    dmp: RhythmicSpecification
    scaled_weights: Array
    baselines: Array
    amplitudes: Array
    periods: Array
    phases: Array
    aligned_on: NDArray[np.intp]
    explained: Array
    labels: NDArray[Any] | None = None
    names: tuple[str | None, ...] | None = None
    recorded_as: RecordedAs | None = None
