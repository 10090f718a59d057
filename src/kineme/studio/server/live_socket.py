"""The websocket: samples in, answers to the movement out, and word of every change of the library.

Clients that watch are the pages: they are told of the movements of all others, the programs.
"""

from __future__ import annotations

import asyncio
import json
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from kineme.errors import KinemeError, SpecificationError, TrajectoryError
from kineme.recognition.early.stream import Live
from kineme.studio.server.live_sources import Follower, Source, Sources, parsed_name
from kineme.studio.server.records import plain_answer, plain_state
from kineme.studio.server.studio import Changes, Studio
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

router = APIRouter()

_WAITING = 64  # messages of one client that wait; it is not read on before
_PAUSE = 1 / 60  # seconds between what a client is told unasked; what comes meanwhile is told at once
_WORDS = '{"samples": [[t, x, y, ...], ...]}, {"reset": true}, {"finish": true}, {"name": "..."} or {"watch": true}'


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


class _Received(NamedTuple):
    """A message of a client: samples, a command, its name, or what was wrong with it; `_END` at the end."""

    samples: Array | None = None
    command: str | None = None
    name: str | None = None
    wrong: str | None = None


_END = _Received()


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
                await self._waiting.put(_END)
                return
            await self._waiting.put(_parsed(message))

    async def answer_all(self) -> None:
        """Answer to one message after the other, until the client goes."""
        while (received := await self._next()) is not _END:
            try:
                answer = await self._answer(received)
            except KinemeError as error:
                answer = {"error": str(error)}
            if answer is not None:
                await self._send(answer)

    async def _next(self) -> _Received:
        """Wait for the next message; samples that wait behind samples are taken in with them, and answered once."""
        received, self._held = self._held or await self._waiting.get(), None
        if received.samples is None:
            return received
        blocks = [received.samples]
        while not self._waiting.empty():
            following = self._waiting.get_nowait()
            if following.samples is None or following.samples.shape[1] != received.samples.shape[1]:
                self._held = following
                break
            blocks.append(following.samples)
        return received if len(blocks) == 1 else _Received(np.concatenate(blocks))

    async def _answer(self, received: _Received) -> dict[str, Any] | None:
        run = asyncio.get_running_loop().run_in_executor
        samples, command, name, wrong = received
        if self._source is None and self._follower is None and (samples is not None or name is not None):
            self._source = self._sources.add()  # a program, which the pages show
        source = self._source
        if samples is not None:
            state = await run(self.studio.live, self.session.update, samples)
            if source is not None:
                source.update(samples, state)
            return {"state": state}
        if command == "finish":
            try:
                ended: dict[str, Any] = {"answer": await run(self.studio.live, self.session.finish)}
            except KinemeError as error:
                ended = {"error": str(error)}
            if source is not None:
                source.end(ended)
            return ended
        if command == "reset":
            self.session.reset()
            if source is not None:
                source.reset()
        elif command == "watch":  # a page: it shows the movements of programs, and others do not show its own
            if self._follower is None:
                self._follower = Follower(self._sources)
                self._sources.listen(self._tell_soon)
                self._tell_soon()
            if source is not None:
                self._sources.remove(source)
                self._source = None
        elif name is not None and source is not None:
            source.rename(name)
        return None if wrong is None else {"error": wrong}

    async def _send(self, message: dict[str, Any]) -> None:
        text = json.dumps(message, allow_nan=False, ensure_ascii=False)
        async with self._turn:  # changes are told while an answer is sent
            await self.socket.send_text(text)


def _parsed(message: Any) -> _Received:
    try:
        content = json.loads(message.get("text") or "")
    except (ValueError, RecursionError):
        return _Received(wrong=f"expected JSON: {_WORDS}; got something else")
    try:
        if isinstance(content, dict) and "samples" in content:
            return _Received(samples=parsed_samples(content["samples"]))
        if isinstance(content, dict) and "name" in content:
            return _Received(name=parsed_name(content["name"]))
    except TrajectoryError as error:
        return _Received(wrong=str(error))
    for command in ("finish", "reset", "watch"):
        if isinstance(content, dict) and content.get(command) is True:
            return _Received(command=command)
    return _Received(wrong=f"expected {_WORDS}; got something else")


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
        if self._stream is not None:
            self._state = plain_state(self._stream.update(samples[:, 0], samples[:, 1:]))
        return self._state

    def finish(self) -> dict[str, Any] | None:
        """Return the answer to the whole movement; None if nothing recognizes it."""
        if self._is_old and self._begun:
            self._renew()
        stream, begun = self._stream, self._begun
        self._begun = False
        if stream is None or not begun:
            return None
        try:
            if self._version == self.studio.library.version:
                return plain_answer(stream.finish())
            return plain_answer(self.studio.library.recognize(stream.movement()))  # changed since the movement began
        except SpecificationError:  # no symbols any more
            return None
        finally:
            stream.reset()

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
    """Check samples of a message: rows of a time stamp and positions.

    Raises TrajectoryError: anything else.
    """
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
