"""Movements that programs send, for the pages that show them.

A source keeps what it has sent of its movement of now; each page knows how much of that it was told. A page that reads
slowly is told more at once, and nobody waits for it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import TrajectoryError
from kineme.validation import Array

MOST = 10_000  # samples that are shown of a movement; of a longer one the last ones
LONGEST = 100  # characters of a name
UNNAMED = "a program"

Tell = Callable[[], object]  # must not wait


class Sources:
    """The programs that send samples, by number, and who is told of them."""

    def __init__(self) -> None:
        self.sources: dict[int, Source] = {}
        self._listeners: set[Tell] = set()
        self._last = 0

    def listen(self, tell: Tell) -> None:
        """Call `tell` whenever a source has something new."""
        self._listeners.add(tell)

    def leave(self, tell: Tell) -> None:
        """Call it no more."""
        self._listeners.discard(tell)

    def tell(self) -> None:
        """Tell everyone."""
        for listener in list(self._listeners):
            listener()

    def add(self) -> Source:
        """A program that was not there yet."""
        self._last += 1
        source = self.sources[self._last] = Source(self.tell)
        return source

    def remove(self, source: Source) -> None:
        """A program has gone."""
        self.sources = {key: one for key, one in self.sources.items() if one is not source}
        self.tell()


class Source:
    """A program: its name, its movement of now, and what was answered to it."""

    def __init__(self, tell: Tell) -> None:
        self.name, self._tell = UNNAMED, tell
        self.movement, self.changes = 0, 0
        self._begin()

    def _begin(self) -> None:
        self.movement += 1
        self.dropped, self.samples = 0, list[list[float]]()
        self.state: dict[str, Any] | None = None
        self.ended: dict[str, Any] | None = None  # {"answer": ...} or {"error": ...}

    def rename(self, name: str) -> None:
        """Take another name."""
        self.name = name
        self._changed()

    def update(self, rows: Array, state: dict[str, Any]) -> None:
        """Take in samples (k, 1 + d) and what they were answered with; after an end they begin another movement."""
        if self.ended is not None:
            self._begin()
        self.samples += self._following(rows)
        more = max(len(self.samples) - MOST, 0)
        del self.samples[:more]
        self.dropped += more
        self.state = state
        self._changed()

    def _following(self, rows: Array) -> list[list[float]]:
        """Samples that continue the movement: as wide as its first one, and later than the last."""
        if self.samples and rows.shape[1] != len(self.samples[0]):
            return []
        latest = self.samples[-1][0] if self.samples else -np.inf
        before = np.maximum.accumulate(np.concatenate(([latest], rows[:-1, 0])))
        kept: list[list[float]] = rows[rows[:, 0] > before].tolist()
        return kept

    def end(self, ended: dict[str, Any]) -> None:
        """The movement is over, with an answer or an error, if one was under way."""
        if self.ended is None and self.samples:
            self.ended = ended
            self._changed()

    def reset(self) -> None:
        """Forget the movement, unless it is over: that one is shown until the next one begins."""
        if self.ended is None:
            self._begin()
            self._changed()

    def _changed(self) -> None:
        self.changes += 1
        self._tell()


class _Told(NamedTuple):
    """What one page knows of a source."""

    source: Source
    movement: int = 0
    samples: int = 0
    changes: int = -1


class Follower:
    """What one page was told of the sources."""

    def __init__(self, of: Sources) -> None:
        self._of = of
        self._told: dict[int, _Told] = {}

    def news(self) -> list[dict[str, Any]]:
        """What it is to be told now; empty if it knows all."""
        gone = self._told.keys() - self._of.sources.keys()
        for key, source in self._of.sources.items():
            self._told.setdefault(key, _Told(source))
        news = [self._of_source(key, told) for key, told in self._told.items() if told.changes != told.source.changes]
        for key in sorted(gone):  # after what they have sent last
            news.append({"id": key, "gone": True})
            del self._told[key]
        return news

    def _of_source(self, key: int, told: _Told) -> dict[str, Any]:
        source = told.source
        known = max(told.samples - source.dropped, 0) if told.movement == source.movement else 0
        self._told[key] = _Told(source, source.movement, source.dropped + len(source.samples), source.changes)
        return {
            "id": key,
            "name": source.name,
            "movement": source.movement,
            "samples": source.samples[known:],
            "state": source.state,
            "ended": source.ended,
        }


def parsed_name(given: Any) -> str:
    """The name of a program, as its message holds it.

    Raises
    ------
    TrajectoryError
        Anything but some characters; halves of them cannot be sent on.
    """
    name = given.strip() if isinstance(given, str) else ""
    if not 0 < len(name) <= LONGEST or any("\ud800" <= mark <= "\udfff" for mark in name):
        raise TrajectoryError(f"expected a name of 1 to {LONGEST} characters, got something else; send one")
    return name
