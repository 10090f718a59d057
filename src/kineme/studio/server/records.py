"""Parts that requests and answers of several kinds have in common."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from fastapi import Path
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from kineme.errors import TrajectoryError
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.sampling import evenly_spaced

_THUMBNAIL = 64  # points of a path in a list
_DIGITS = 5  # of its largest coordinate

#: With a limit pydantic also refuses halves of characters, which JSON can hold and which nothing can write.
Text = Annotated[str, Field(max_length=10_000)]
Name = Annotated[Text, Field(min_length=1)]
Description = Annotated[str, Field(max_length=1_000_000)]
Ids = Annotated[list[int], Field(min_length=1, max_length=1_000_000)]
Number = Annotated[float, Field(allow_inf_nan=False)]
Point = Annotated[list[Number], Field(min_length=1, max_length=1000)]
Times = Annotated[list[Number], Field(min_length=1, max_length=1_000_000)]
Points = list[list[float | None]]
SymbolKey = Annotated[str, Path(description="Id of a symbol, as in `/api/library`.")]
MovementKey = Annotated[int, Path(description="Id of a movement, as in `/api/library/movements`.")]
ProposalKey = Annotated[str, Path(description="Id of a proposal, as in `/api/proposals`.")]
RecordingKey = Annotated[str, Path(description="What was answered when the recording was sent.")]

VERSION = "The version that the client has seen; 409 if what is named is gone."


class RequestBody(BaseModel):
    """The body of a request: nothing but the fields that are known."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Change(RequestBody):
    """The body of a request for a change: the version that the client has seen, if it matters."""

    version: int | None = Field(None, description=VERSION)


class ChangedOut(BaseModel):
    """The version of the library after a change."""

    version: int


class LearnedOut(ChangedOut):
    """Ids of the movements; of one that was stored before, the id it had."""

    ids: list[int]


class ChannelOut(BaseModel):
    """A channel: the name, kind and unit of some columns of the recordings."""

    name: str
    kind: str
    columns: list[str]
    unit: str | None


def numbers(values: ArrayLike) -> Any:
    """An array as lists; None where a number is not finite."""
    array = np.asarray(values, dtype=np.float64)
    finite = np.isfinite(array)
    return (array if finite.all() else np.where(finite, array, np.array(None))).tolist()


def trajectory(times: list[float], positions: list[list[float]]) -> Trajectory:
    """A movement that a client sent."""
    if len({len(row) for row in positions}) > 1:
        raise TrajectoryError("expected positions as rows of equally many numbers, got rows of different lengths")
    return Trajectory(np.array(times, dtype=np.float64), np.array(positions, dtype=np.float64))


def thumbnail(positions: ArrayLike) -> Any:
    """At most 64 points of a path, its first and last among them."""
    path = np.asarray(positions, dtype=np.float64)
    digits = _DIGITS - 1 - int(np.floor(np.log10(np.abs(path).max() or 1.0)))
    return numbers(np.round(path[evenly_spaced(len(path), _THUMBNAIL)], digits))
