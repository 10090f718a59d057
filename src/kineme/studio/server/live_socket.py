"""The websocket: samples in, answers to the movement out, and word of every change of the library.

Clients that watch are the pages: they are told of the movements of all others, the programs. A page that reads slowly
is told more at once, and nobody waits for it.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from kineme.errors import KinemeError, SpecificationError, TrajectoryError
from kineme.recognition.early.stream import Live
from kineme.studio.server.studio import Changes, News, Studio
from kineme.validation import LARGEST, Array

MOST = 10_000  # samples that are shown of a movement; of a longer one the last ones
LONGEST = 100  # characters of a name
UNNAMED = "a program"

MOST_SAMPLES = 10_000  # in one message
_SHOWN = 8  # classes of a movement under way
_MOST_WAITING = 200  # messages that are taken in again when the library has changed: a few seconds
_EMPTY: dict[str, Any] = {
    **dict.fromkeys(("label", "certainty", "unknown", "progress", "arrival", "goal")),
    **{"ranked": [], "path": [], "skipped": 0, "status": []},
}

router = APIRouter()

_WAITING = 64  # messages of one client that wait; it is not read on before
_PAUSE = 1 / 60  # seconds between what a client is told unasked; what comes meanwhile is told at once
_WORDS = (
    '{"samples": [[t, x, y, ...], ...]}, {"reset": true}, {"finish": true}, {"hand": {"points": ...}}, '
    '{"name": "..."} or {"watch": true}'
)
_NO_WORDS = "wrong", f"expected {_WORDS}; got something else"
_FIELDS = "watch", "name", "hand", "reset", "samples", "finish"  # of a message, in the order in which they are done
_LANDMARKS = 21  # of a hand, as MediaPipe numbers them
_ASPECT = 4 / 3  # of the picture of a camera that does not say how wide it is


@router.websocket("/api/live")
async def live(socket: WebSocket) -> None:
    """Recognize a movement while its samples arrive, and tell of changes and of other programs' movements."""
    studio: Studio = socket.app.state.studio
    changes: Changes = socket.app.state.changes
    await socket.accept()
    client = _Client(socket, studio, socket.app.state.sources)
    changes.listen(client.tell_of)
    reading = asyncio.create_task(client.read())
    try:
        with suppress(WebSocketDisconnect, RuntimeError):  # gone while it was answered
            await client.answer_all()
    finally:
        changes.leave(client.tell_of)
        client.leave()
        reading.cancel()


#: A message of a client by its kind: a key of `_PARSED`, a command, "wrong" with the reason, or "end".
_Received = tuple[str, Any]


class _Client:
    """One websocket, with a task that reads and one that answers."""

    def __init__(self, socket: WebSocket, studio: Studio, sources: Sources) -> None:
        self.socket, self.studio, self.session = socket, studio, LiveSession(studio)
        self._sources = sources
        self._source: Source | None = None  # of a program, once it has sent something
        self._follower: Follower | None = None  # of a page
        self._waiting: asyncio.Queue[_Received] = asyncio.Queue(_WAITING)
        self._held: _Received | None = None
        self._turn = asyncio.Lock()
        self._version = self._sent_version = -1  # of the library, that the client is to know, and that it knows
        self._telling: asyncio.Task[None] | None = None

    def tell_of(self, version: int) -> None:
        """Send the version that the library has now, without waiting for a client that does not read."""
        self._version = version
        self._tell_soon()

    def _tell_soon(self) -> None:
        if self._telling is None or self._telling.done():
            self._telling = asyncio.create_task(self._tell())

    def leave(self) -> None:
        """Tell nothing more, and be shown no more."""
        self._sources.leave(self._tell_soon)
        if self._source is not None:
            self._sources.remove(self._source)
        if self._telling is not None:
            self._telling.cancel()

    async def _tell(self) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                news: list[dict[str, Any]] = []
                if self._sent_version != self._version:
                    news = [{"changed": self._version}]
                    self._sent_version = self._version
                if self._follower is not None:
                    news += [{"source": source} for source in self._follower.news()]
                if not news:
                    return
                for message in news:
                    await self._send(message)
                await asyncio.sleep(_PAUSE)

    async def read(self) -> None:
        """Queue what arrives, and an empty one at the end."""
        while True:
            message = await self.socket.receive()
            if message["type"] == "websocket.disconnect":
                await self._waiting.put(("end", None))
                return
            for received in _parsed(message):
                await self._waiting.put(received)

    async def answer_all(self) -> None:
        """Answer to one message after the other, until the client goes."""
        while (received := await self._next())[0] != "end":
            try:
                answer = await self._answer(*received)
            except KinemeError as error:
                answer = {"error": str(error)}
            if answer is not None:
                await self._send(answer)

    async def _next(self) -> _Received:
        """Wait for the next message; samples that wait behind samples are taken in with them, and answered once."""
        (kind, first), self._held = self._held or await self._waiting.get(), None
        if kind != "samples":
            return kind, first
        blocks = [first]
        while not self._waiting.empty():
            following = self._waiting.get_nowait()
            if following[0] != "samples" or following[1].shape[1] != first.shape[1]:
                self._held = following
                break
            blocks.append(following[1])
        return kind, np.concatenate(blocks)

    async def _answer(self, kind: str, content: Any) -> dict[str, Any] | None:
        run = asyncio.get_running_loop().run_in_executor
        if self._source is None and self._follower is None and kind in _PARSED:
            self._source = self._sources.add()  # a program, which the pages show
        source = self._source
        if kind == "samples":
            state = await run(self.studio.live, self.session.update, content)
            if source is not None:
                source.update(content, state)
            return {"state": state}
        if kind == "finish":
            ended = await run(self.studio.live, self.session.finish)
            if source is not None:
                source.end(ended)
            return ended
        if kind == "reset":
            self.session.reset()
            if source is not None:
                source.reset()
        elif kind == "watch":  # a page: it shows the movements of programs, and others do not show its own
            self._watch()
        elif kind == "name" and source is not None:
            source.rename(content)
        elif kind == "hand" and source is not None:
            source.show_hand(content)
        return {"error": content} if kind == "wrong" else None

    def _watch(self) -> None:
        if self._follower is None:
            self._follower = Follower(self._sources)
            self._sources.listen(self._tell_soon)
            self._tell_soon()
        if self._source is not None:
            self._sources.remove(self._source)
            self._source = None

    async def _send(self, message: dict[str, Any]) -> None:
        text = json.dumps(message, allow_nan=False, ensure_ascii=False)
        async with self._turn:  # changes are told while an answer is sent
            await self.socket.send_text(text)


def _parsed(message: Any) -> list[_Received]:
    """Return what a message holds, in the order in which it is done; nothing of one of which a part is wrong."""
    received: list[_Received] = []
    try:
        content = json.loads(message.get("text") or "")
        for field in _FIELDS if isinstance(content, dict) else ():
            if field in _PARSED and field in content:
                received.append((field, _PARSED[field](content[field])))
            elif content.get(field, False) is True:
                received.append((field, None))
            elif content.get(field, False) is not False:
                return [_NO_WORDS]
    except TrajectoryError as error:
        return [("wrong", str(error))]
    except (ValueError, RecursionError):
        return [("wrong", f"expected JSON: {_WORDS}; got something else")]
    return received or [_NO_WORDS]


class LiveSession:
    """The stream of one client; made anew for the next movement if the library has changed.

    Until it is prepared, movements are followed by the one before, and those under way to their end. The answer to a
    whole movement is that of the library as it is then.
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
        """Take in samples (k, 1 + d), and return the state of the movement."""
        if not self._begun:
            self._state, version = _EMPTY, self.studio.library.version
            self._is_old = version != self._version and self._stream is not None and self.studio.warm != version
            if version != self._version and not self._is_old:
                self._renew()
            self._begun = True
        if self._is_old:
            self._waiting.append(samples)
            if self.studio.warm == self.studio.library.version or len(self._waiting) > _MOST_WAITING:
                self._renew()
                return self._state
        self._take(samples)
        return self._state

    def _take(self, samples: Array) -> None:
        if self._stream is not None:
            self._state = self._stream.update(samples[:, 0], samples[:, 1:]).to_dict(_SHOWN)

    def finish(self) -> dict[str, Any]:
        """Return the "answer" to the whole movement, None if nothing recognizes it; or an "error", of one too short."""
        begun, self._begun = self._begun, False
        try:
            if begun and self._is_old:
                self._renew()
            if self._stream is None or not begun:
                return {"answer": None}
            if self._version == self.studio.library.version:
                return {"answer": self._stream.finish().to_dict()}
            return {"answer": self.studio.library.recognize(self._stream.movement()).to_dict()}  # changed meanwhile
        except SpecificationError:  # no symbols any more
            return {"answer": None}
        except KinemeError as error:
            return {"error": str(error)}
        finally:
            if begun and self._stream is not None:
                self._stream.reset()

    def _renew(self) -> None:
        """Follow the movement by the library as it is now; wait for that if need be."""
        version = self.studio.library.version
        try:
            self._stream = self.studio.stream()
        except SpecificationError:  # no symbols to recognize, or one movement
            self._stream = None
        self._version, self._is_old, self._state = version, False, _EMPTY
        for samples in self._waiting:
            self._take(samples)
        self._waiting.clear()


def parsed_samples(given: Any) -> Array:
    """Check samples of a message: rows of a time stamp and positions."""
    words = f"samples as [[t, x, y, ...], ...], at most {MOST_SAMPLES:,} rows of equally many finite numbers"

    def is_row(row: Any) -> bool:
        return (
            isinstance(row, list)
            and 1 < len(row) <= 1000
            and all(type(value) in {int, float} and abs(value) <= LARGEST for value in row)  # of NaN this is false
        )

    if not isinstance(given, list) or not 0 < len(given) <= MOST_SAMPLES or not all(map(is_row, given)):
        raise TrajectoryError(f"expected {words}; got something else")
    if len({len(row) for row in given}) > 1:
        raise TrajectoryError(f"expected {words}; got rows of different lengths")
    return np.array(given, dtype=np.float64)


class Sources(News):
    """The programs that send samples, by number, for those who are told of them."""

    def __init__(self) -> None:
        super().__init__()
        self.sources: dict[int, Source] = {}
        self._last = 0

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

    def __init__(self, tell: Callable[[], object]) -> None:
        self.name, self._tell = UNNAMED, tell
        self.movement, self.changes = 0, 0
        self.hand: dict[str, Any] | None = None
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

    def show_hand(self, hand: dict[str, Any]) -> None:
        """Show a hand, which pages draw with."""
        self.hand = hand
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
            told = {name: getattr(source, name) for name in ("name", "movement", "state", "ended", "hand")}
            news.append({"id": key, **told, "samples": source.samples[first:]})
        for key in sorted(gone):  # after what they have sent last
            news.append({"id": key, "gone": True})
            del self._followed[key]
        return news


def parsed_hand(given: Any) -> dict[str, Any]:
    """Check landmarks (21, 2) or (21, 3), as fractions of a picture, their time [s], and its width by its height."""
    hand = given if isinstance(given, dict) else {}
    try:
        points = parsed_samples(hand.get("points"))
        ((time, aspect),) = parsed_samples([[hand.get("time"), hand.get("aspect", _ASPECT)]]).tolist()
    except TrajectoryError:
        points, time, aspect = np.empty(0), 0.0, 0.0
    if points.shape not in {(_LANDMARKS, 2), (_LANDMARKS, 3)} or not aspect > 0:
        raise TrajectoryError(
            'expected {"hand": {"points": [[x, y], ...], "time": t, "aspect": width / height}} with 21 points as '
            "fractions of the picture; got something else"
        )
    return {"points": points.tolist(), "time": time, "aspect": aspect}


def parsed_name(given: Any) -> str:
    """Check the name of a program, as its message holds it."""
    name = given.strip() if isinstance(given, str) else ""
    if not 0 < len(name) <= LONGEST or any("\ud800" <= mark <= "\udfff" for mark in name):
        raise TrajectoryError(f"expected a name of 1 to {LONGEST} characters, got something else; send one")
    return name


_PARSED: dict[str, Callable[[Any], Any]] = {"samples": parsed_samples, "name": parsed_name, "hand": parsed_hand}
