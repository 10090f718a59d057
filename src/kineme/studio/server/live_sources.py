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
        """Add a program that was not there yet."""
        self._last += 1
        source = self.sources[self._last] = Source(self.tell)
        return source

    def remove(self, source: Source) -> None:
        """Remove a program that has gone."""
        self.sources = {key: other for key, other in self.sources.items() if other is not source}
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
        if not self.samples or rows.shape[1] == len(self.samples[0]):  # as wide as the first, and later than the last
            latest = self.samples[-1][0] if self.samples else -np.inf
            before = np.maximum.accumulate(np.concatenate(([latest], rows[:-1, 0])))
            self.samples += rows[rows[:, 0] > before].tolist()
        more = max(len(self.samples) - MOST, 0)
        del self.samples[:more]
        self.dropped += more
        self.state = state
        self._changed()

    def end(self, ended: dict[str, Any]) -> None:
        """End the movement, if one is under way, with an answer or an error."""
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


class _FollowedSource(NamedTuple):
    """A source, and how much of it one page knows."""

    source: Source
    movement: int = 0
    samples: int = 0
    changes: int = -1


class Follower:
    """One page that shows the sources: what it knows of each."""

    def __init__(self, sources: Sources) -> None:
        self._sources = sources
        self._followed: dict[int, _FollowedSource] = {}

    def news(self) -> list[dict[str, Any]]:
        """Return what the page does not know yet; empty if it knows all."""
        gone = self._followed.keys() - self._sources.sources.keys()
        for key, source in self._sources.sources.items():
            self._followed.setdefault(key, _FollowedSource(source))
        news = []
        for key, (source, movement, n_samples, changes) in self._followed.items():
            if changes == source.changes:
                continue
            first = max(n_samples - source.dropped, 0) if movement == source.movement else 0
            self._followed[key] = _FollowedSource(
                source, source.movement, source.dropped + len(source.samples), source.changes
            )
            news.append(
                {
                    "id": key,
                    "name": source.name,
                    "movement": source.movement,
                    "samples": source.samples[first:],
                    "state": source.state,
                    "ended": source.ended,
                }
            )
        for key in sorted(gone):  # after what they have sent last
            news.append({"id": key, "gone": True})
            del self._followed[key]
        return news


def parsed_name(given: Any) -> str:
    """Check the name of a program, as its message holds it.

    Raises TrajectoryError: anything but some characters; halves of them cannot be sent on.
    """
    name = given.strip() if isinstance(given, str) else ""
    if not 0 < len(name) <= LONGEST or any("\ud800" <= mark <= "\udfff" for mark in name):
        raise TrajectoryError(f"expected a name of 1 to {LONGEST} characters, got something else; send one")
    return name
