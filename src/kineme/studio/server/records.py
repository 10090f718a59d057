"""Parts that requests and answers of several kinds have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from fastapi import Path
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from kineme.errors import TrajectoryError
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.sampling import evenly_spaced
from kineme.validation import Array

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


def thumbnail(positions: ArrayLike, n: int = _THUMBNAIL) -> Any:
    """Return at most n points of a path, its first and last among them."""
    path = np.asarray(positions, dtype=np.float64)
    digits = _DIGITS - 1 - int(np.floor(np.log10(np.abs(path).max() or 1.0)))
    return numbers(np.round(path[evenly_spaced(len(path), n)], digits))


def envelope(times: Array, values: Array, width: int) -> tuple[Array, Array]:
    """Reduce signals (T, d) to the least and the greatest value of each of at most `width` stretches of equal count.

    Returns times (n,) and values (n, d) with n at most 2 `width`: two for each stretch, at its first and its last
    sample, in the order in which the extremes occurred. What is no number is passed over; a stretch without numbers is
    NaN. Signals of at most 2 `width` samples are returned as they are.
    """
    n, d = values.shape
    if n <= 2 * width:
        return times, values
    size = -(-n // width)  # samples of a stretch
    starts = np.arange(0, n, size)
    stretches = np.concatenate((values, np.repeat(values[-1:], len(starts) * size - n, axis=0)))
    stretches = stretches.reshape(len(starts), size, d)
    is_number = np.isfinite(stretches)
    least = np.where(is_number, stretches, np.inf).argmin(axis=1)
    greatest = np.where(is_number, stretches, -np.inf).argmax(axis=1)
    order = np.sort(np.stack((least, greatest), axis=1), axis=1)
    pairs = np.take_along_axis(stretches, order, axis=1)
    ends = np.minimum(starts + size, n) - 1
    return np.stack((times[starts], times[ends]), axis=1).ravel(), pairs.reshape(-1, d)


def plot(times: Array, values: Array, names: Sequence[str], width: int) -> dict[str, Any]:
    """Return columns (T, d) over seconds since the first sample as a page draws them, at most 2 `width` of each."""
    if not len(times):
        return {"times": [], "columns": [{"name": name, "values": []} for name in names]}
    shown, thinned = envelope(times - times[0], values, width)
    largest = np.abs(thinned, where=np.isfinite(thinned), out=np.zeros_like(thinned)).max(axis=0)
    steps = 10.0 ** (np.floor(np.log10(np.where(largest > 0, largest, 1.0))) - _DIGITS + 1)
    rounded = [numbers(np.round(thinned[:, k] / step) * step) for k, step in enumerate(steps)]
    columns = [{"name": name, "values": column} for name, column in zip(names, rounded, strict=True)]
    return {"times": numbers(shown), "columns": columns}
