"""Arrays and answers as JSON holds them: lists, finite numbers, nothing where a number is not finite."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import TrajectoryError
from kineme.movements.trajectories.trajectory import Trajectory
from kineme.recognition.answer import Answer
from kineme.recognition.early.live_state import LiveState
from kineme.sampling import evenly_spaced

_THUMBNAIL = 64  # points of a path in a list
_DIGITS = 5  # of its largest coordinate
_SHOWN = 8  # classes of a movement under way


def numbers(values: ArrayLike) -> Any:
    """An array as lists; None where a number is not finite."""
    array = np.asarray(values, dtype=np.float64)
    if np.isfinite(array).all():
        return array.tolist()
    plain = array.astype(object)
    plain[~np.isfinite(array)] = None
    return plain.tolist()


def trajectory(times: list[float], positions: list[list[float]]) -> Trajectory:
    """A movement that a client sent.

    Raises
    ------
    TrajectoryError
        Rows of different lengths, and whatever `Trajectory` refuses.
    """
    if len({len(row) for row in positions}) > 1:
        raise TrajectoryError("expected positions as rows of equally many numbers, got rows of different lengths")
    return Trajectory(np.array(times, dtype=np.float64), np.array(positions, dtype=np.float64))


def thumbnail(positions: ArrayLike) -> Any:
    """At most 64 points of a path, its first and last among them."""
    path = np.asarray(positions, dtype=np.float64)
    digits = _DIGITS - 1 - int(np.floor(np.log10(np.abs(path).max() or 1.0)))
    return numbers(np.round(path[evenly_spaced(len(path), _THUMBNAIL)], digits))


def plain_answer(answer: Answer) -> dict[str, Any]:
    """An answer of a library; `ranked` is best first."""
    return {
        "label": answer.label,
        "certainty": answer.certainty,
        "confidence": numbers(answer.confidence),
        "p_known": numbers(answer.p_known),
        "p_values": {str(name): numbers(value) for name, value in answer.p_values.items()},
        "ranked": [
            {
                "name": name,
                "probability": numbers(answer.probabilities.get(name, np.nan)),
                "p_value": numbers(answer.p_values.get(name, np.nan)),
            }
            for name in answer.ranked
        ],
        "nearest": [
            {"id": near.index, "name": near.name, "similarity": numbers(near.similarity)} for near in answer.nearest
        ],
        "calibrated": answer.calibrated,
        "rule": answer.rule,
        "promise": answer.promise,
    }


def plain_state(state: LiveState) -> dict[str, Any]:
    """A movement under way: the most likely classes, best first, and what is predicted."""
    probabilities = state.probabilities
    return {
        "certainty": state.certainty,
        "ranked": [
            {"name": one.label, "share": numbers(one.confidence), "probability": numbers(probabilities[one.label])}
            for one in state.ranked[:_SHOWN]
        ],
        "unknown": numbers(state.unknown),
        "decided": state.label,
        "progress": numbers(state.progress),
        "arrival": numbers(state.arrival),
        "path": [] if state.path is None else numbers(state.path),
        "skipped": state.skipped,
        "status": list(state.status.messages),
    }
