"""Connections of a server, with limits.

Whoever opens a connection needs no token before the head of a request is there. Without limits a few hundred heads that
never end take every file descriptor, and each connection that then cannot be accepted is logged.
"""

from __future__ import annotations

import asyncio
import logging
import time
from contextlib import suppress
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

HEAD_SECONDS = 10.0  # that the head of a request may take
BACKLOG = 64  # connections that wait to be accepted: as many are accepted at once
_MOST, _LEAST = 512, 8  # connections that are open at once
_SHARE = 4  # a connection for so many file descriptors: the library, uploads and new connections take some
_AGAIN = 60.0  # seconds after which the same error is logged again
_MOST_LOGGED = 100  # errors that are remembered as logged
_MESSAGE = 2**20  # bytes of one message of a websocket


def config_of(app: Any) -> Any:
    """Make uvicorn serve the application quietly, with limits, without trust in headers of proxies."""
    import uvicorn

    return uvicorn.Config(
        app,
        log_level=logging.WARNING,
        access_log=False,
        http=LimitedConnection,
        backlog=BACKLOG,
        ws="websockets-sansio",
        ws_max_size=_MESSAGE,
        ws_per_message_deflate=False,  # it takes longer than it saves, and a small message can expand to a large one
        server_header=False,
        proxy_headers=False,
        timeout_graceful_shutdown=1,
    )


def most_connections() -> int:
    """Return how many connections may be open at once, by the limit on file descriptors of this process."""
    with suppress(ImportError, OSError):  # Windows has no such limit
        import resource

        descriptors = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        if descriptors != resource.RLIM_INFINITY:
            return max(_LEAST, min(_MOST, descriptors // _SHARE))
    return _MOST


class LimitedConnection(H11Protocol):
    """A connection that is closed if the head of a request takes too long, or if others need its place.

    Where there are too many, the one that has waited longest for a request is closed, so that whoever sends one at once
    is answered, whatever others keep open. Requests under way and websockets are never closed.
    """

    _timer: asyncio.TimerHandle | None = None
    _since = 0.0

    @property
    def is_waiting(self) -> bool:
        """True where no request is under way: its head is not there, or it has been answered."""
        return self.cycle is None or self.cycle.response_complete

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take the place of the connection that has waited longest where there are too many."""
        super().connection_made(transport)
        self._await_head()
        connections: Any = self.connections
        alive = [connection for connection in connections if not connection.transport.is_closing()]
        if len(alive) > most_connections():
            waiting = [each for each in alive if isinstance(each, LimitedConnection) and each.is_waiting]
            min(waiting, key=lambda connection: connection._since).transport.abort()  # itself where all others work

    def data_received(self, data: bytes) -> None:
        """Limit the time from the first byte of a head to its last."""
        if self._timer is None and self.is_waiting:
            self._await_head()
        super().data_received(data)
        if not self.is_waiting or self not in self.connections:  # a websocket has taken over
            self._forget_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the limit."""
        self._forget_head()
        super().connection_lost(exc)

    def _await_head(self) -> None:
        self._since = self.loop.time()
        self._timer = self.loop.call_later(HEAD_SECONDS, self.transport.abort)

    def _forget_head(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class OncePerInterval(logging.Filter):
    """A filter that logs the same error once a minute, however often it occurs."""

    def __init__(self) -> None:
        super().__init__()
        self._logged: dict[str, float] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Tell whether the first line of a message has not been logged lately."""
        now, line = time.monotonic(), record.getMessage().partition("\n")[0]
        if now - self._logged.get(line, -_AGAIN) < _AGAIN:
            return False
        if len(self._logged) >= _MOST_LOGGED:
            self._logged.clear()
        self._logged[line] = now
        return True
