"""Run the studio until it is stopped.

Whoever opens a connection needs no token before the head of a request is there. Without limits a few hundred heads that
never end take every file descriptor, and each connection that then cannot be accepted is logged.
"""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import os
import secrets
import signal
import socket
import time
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from threading import Timer
from typing import Any, NamedTuple

from uvicorn.protocols.http.h11_impl import H11Protocol

from kineme.errors import DataError, SpecificationError
from kineme.library.storage.address import Address

HEAD_SECONDS = 10.0  # that the head of a request may take
BACKLOG = 64  # connections that wait to be accepted: as many are accepted at once
_MOST, _LEAST = 512, 8  # connections that are open at once
_SHARE = 4  # a connection for so many file descriptors: the library, uploads and new connections take some
_AGAIN = 60.0  # seconds after which the same error is logged again
_MOST_LOGGED = 100  # errors that are remembered as logged

LOOPBACK = "127.0.0.1"
PORT = 8420  # unless it is taken
TOKEN = "KINEME_STUDIO_TOKEN"  # in the environment: one that stays when the studio is started again
_LEAST_TOKEN, _MOST_TOKEN = 16, 1000  # characters; browsers keep no cookie of more than 4,096 bytes
_MESSAGE = 2**20  # bytes of one message of a websocket
_GRACE = 2.0  # seconds for what runs when it is stopped


class Options(NamedTuple):
    """Options of the server; port None is 8420, or any that is free."""

    folder: Path | Address
    host: str = LOOPBACK
    port: int | None = None
    read_only: bool = False
    recordings: Path | None = None  # what is shown of episodes


def serve(options: Options, ready: Callable[[str, str], object]) -> None:
    """Serve a library until interrupted; once it can be opened, `ready` is called with its address.

    The second argument of `ready` is an address for the browser of this machine, without the token: it opens once.
    """
    try:
        import uvicorn  # noqa: F401
        import websockets  # noqa: F401

        from kineme.studio.server.app import create_app
    except ImportError as error:
        raise DataError(
            f"expected the packages of the studio ({error}); install them with: pip install 'kineme[studio]'"
        ) from error
    from kineme.studio.server.access import own_names

    token, once = token_of_server(), secrets.token_urlsafe(24)
    with closing(listening_at(options.host, options.port)) as listening:
        hosts = () if is_loopback(options.host) else own_names(options.host)
        app = create_app(
            options.folder, token, once=once, read_only=options.read_only, hosts=hosts, recordings=options.recordings
        )
        address = f"http://{name_of(options.host)}:{listening.getsockname()[1]}/"
        studio = app.state.studio

        def tell() -> None:
            ready(f"{address}?token={token}", f"{address}?once={once}")

        run(app, listening, tell, studio.join, studio.uploads.close)


def run(
    app: Any,
    listening: socket.socket,
    ready: Callable[[], object],
    join: Callable[[], object],
    end: Callable[[], object],
) -> None:
    """Serve an application at a socket that listens, until interrupted.

    `ready` is called once it can be asked, `join` when it has stopped. What does not stop within two seconds is ended
    with the process, after `end` was called.
    """
    import uvicorn

    def end_at_once() -> None:
        """End the process: a thread that computes cannot be ended otherwise, and nothing is lost."""
        end()
        os._exit(0)

    last_resort = Timer(_GRACE, end_at_once)  # also where the event loop itself waits

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            # A closed terminal is an interruption, unless that is ignored, as after `nohup`.
            if os.name == "posix" and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
                loop = asyncio.get_running_loop()
                loop.add_signal_handler(signal.SIGHUP, lambda: setattr(self, "should_exit", True))
            ready()

        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            last_resort.daemon = True
            last_resort.start()
            await super().shutdown(sockets)

    for name in ("asyncio", "uvicorn.error"):
        logging.getLogger(name).addFilter(OncePerInterval())
    with suppress(KeyboardInterrupt):
        Server(config_of(app)).run(sockets=[listening])
    join()
    last_resort.cancel()


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


def is_loopback(host: str) -> bool:
    """Tell whether only this machine reaches a host."""
    try:
        return host.lower() == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def token_of_server() -> str:
    """Return the token in the environment, or a new one."""
    token = os.environ.get(TOKEN)
    if token is None:
        return secrets.token_urlsafe(24)
    letters = token.isascii() and token.replace("-", "").replace("_", "").isalnum()
    if not letters or not _LEAST_TOKEN <= len(token) <= _MOST_TOKEN:
        raise SpecificationError(
            f"expected {TOKEN} to be at least {_LEAST_TOKEN} letters, digits, - and _, and at most {_MOST_TOKEN:,}, "
            f"got another one of {len(token):,}; choose another one, or leave it out"
        )
    return token


def listening_at(host: str, port: int | None) -> socket.socket:
    """Open a socket that listens; without a port on the usual one if that is free."""
    if not host:  # to the system that is every address
        raise SpecificationError(
            "expected an address to listen at, got an empty --host; leave it out for this machine alone, or write "
            "0.0.0.0 for every address"
        )
    if port is None:
        with suppress(OSError):
            return _bound(host, PORT)
    try:
        return _bound(host, port or 0)
    except OSError as error:
        taken = error.errno == errno.EADDRINUSE
        remedy = "choose another --port, or leave it out" if taken else "correct --host and --port"
        raise DataError(f"expected to serve at {host}:{port or 0}, got: {error.strerror or error}; {remedy}") from error


def _bound(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    both = host == "::" and socket.has_dualstack_ipv6()  # IPv4, too: the name of this machine is often one of those
    bound = socket.create_server((host, port), family=family, dualstack_ipv6=both)
    # Connections inherit it. Without it the body of an answer waits 40 ms for the receipt of its head to be confirmed.
    bound.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return bound


def name_of(host: str) -> str:
    """Write the host in an address that a browser on this machine opens."""
    if host in {"0.0.0.0", "::"}:
        return socket.gethostname()
    return f"[{host}]" if ":" in host else host


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
