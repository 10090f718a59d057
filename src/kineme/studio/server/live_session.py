"""One client that sends a movement while it is under way."""

from __future__ import annotations

from typing import Any

import numpy as np

from kineme.errors import SpecificationError, TrajectoryError
from kineme.recognition.answer import Answer
from kineme.recognition.early.stream import Live
from kineme.studio.server.plain import plain_answer, plain_state
from kineme.studio.server.studio import Studio
from kineme.validation import LARGEST, Array

MOST_SAMPLES = 10_000  # in one message
_MOST_WAITING = 200  # messages that are taken in again when the library has changed: a few seconds
_EMPTY: dict[str, Any] = {
    "certainty": None,
    "ranked": [],
    "unknown": None,
    "decided": None,
    "progress": None,
    "arrival": None,
    "path": [],
    "skipped": 0,
    "status": [],
}


class LiveSession:
    """The stream of one client; made anew for the next movement if the library has changed.

    Preparing for a changed library takes a while. Until then movements are followed by what knew the library before;
    what knows it now takes over as soon as it is there. A movement that is under way when the library changes is
    followed on as it began. The answer to the whole movement is that of the library as it is then, in any case.
    """

    def __init__(self, studio: Studio) -> None:
        self.studio = studio
        self._stream: Live | None = None
        self._version, self._begun, self._is_old = -1, False, False
        self._state = _EMPTY
        self._waiting: list[Array] = []  # samples that the next stream is to take in

    def reset(self) -> None:
        """Forget the movement."""
        if self._stream is not None:
            self._stream.reset()
        self._waiting.clear()
        self._begun = False

    def update(self, samples: Array) -> dict[str, Any]:
        """Take in samples (k, 1 + d): the state of the movement."""
        if not self._begun:
            self._begin()
        if self._is_old:
            self._waiting.append(samples)
            if self.studio.warm == self.studio.library.version or len(self._waiting) > _MOST_WAITING:
                self._renew()
                return self._state
        if self._stream is not None:
            self._state = plain_state(self._stream.update(samples[:, 0], samples[:, 1:]))
        return self._state

    def finish(self) -> dict[str, Any] | None:
        """The answer to the whole movement; None if nothing recognizes it."""
        if self._is_old and self._begun:
            self._renew()
        stream, begun = self._stream, self._begun
        self._begun = False
        if stream is None or not begun:
            return None
        try:
            return plain_answer(self._answer(stream))
        except SpecificationError:  # no symbols any more
            return None
        finally:
            stream.reset()

    def _answer(self, stream: Live) -> Answer:
        if self._version == self.studio.library.version:
            return stream.finish()
        return self.studio.library.recognize(stream.movement())  # it has changed since the movement began

    def _begin(self) -> None:
        self._state, version = _EMPTY, self.studio.library.version
        self._is_old = version != self._version and self._stream is not None and self.studio.warm != version
        if version != self._version and not self._is_old:
            self._renew()
        self._begun = True

    def _renew(self) -> None:
        """Follow the movement by the library as it is now; wait for that if need be."""
        version = self.studio.library.version
        try:
            self._stream = self.studio.stream()
        except SpecificationError:  # no symbols to recognize, or one movement
            self._stream = None
        self._version, self._is_old, self._state = version, False, _EMPTY
        for samples in self._waiting:
            if self._stream is not None:
                self._state = plain_state(self._stream.update(samples[:, 0], samples[:, 1:]))
        self._waiting.clear()


def parsed_samples(given: Any) -> Array:
    """Samples of a message: rows of a time stamp and positions.

    Raises
    ------
    TrajectoryError
        Anything else.
    """
    words = f"samples as [[t, x, y, ...], ...], at most {MOST_SAMPLES:,} rows of equally many finite numbers"
    if not isinstance(given, list) or not 0 < len(given) <= MOST_SAMPLES or not all(map(_is_row, given)):
        raise TrajectoryError(f"expected {words}; got something else")
    if len({len(row) for row in given}) > 1:
        raise TrajectoryError(f"expected {words}; got rows of different lengths")
    return np.array(given, dtype=np.float64)


def _is_row(row: Any) -> bool:
    return isinstance(row, list) and 1 < len(row) <= 1000 and all(map(_is_number, row))


def _is_number(value: Any) -> bool:
    return type(value) in {int, float} and abs(value) <= LARGEST  # of NaN this is false
