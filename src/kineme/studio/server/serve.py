"""Run the studio until it is stopped."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import os
import secrets
import signal
import socket
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, Any, NamedTuple

from kineme.errors import DataError, SpecificationError

if TYPE_CHECKING:
    from kineme.studio.server.studio import Studio

LOOPBACK = "127.0.0.1"
PORT = 8420  # unless it is taken
TOKEN = "KINEME_STUDIO_TOKEN"  # in the environment: one that stays when the studio is started again
_LEAST_TOKEN, _MOST_TOKEN = 16, 1000  # characters; browsers keep no cookie of more than 4,096 bytes
_MESSAGE = 2**20  # bytes of one message of a websocket
_GRACE = 2.0  # seconds for what runs when it is stopped


class Options(NamedTuple):
    """How the studio is served; port None is 8420, or any that is free."""

    folder: Path
    host: str = LOOPBACK
    port: int | None = None
    read_only: bool = False


def serve(options: Options, ready: Callable[[str, str], object]) -> None:
    """Serve a library until interrupted; once it can be opened, `ready` is called with its address.

    The second argument of `ready` is an address for the browser of this machine, without the token: it opens once.

    Raises
    ------
    DataError
        The library cannot be opened, the address is taken, or the extra `studio` is not installed.
    SpecificationError
        A token in the environment that is too short.
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
    from kineme.studio.server.connections import log_errors_once

    log_errors_once()
    token, once = _token(), secrets.token_urlsafe(24)
    with closing(_listening(options)) as listening:
        hosts = () if is_loopback(options.host) else own_names(options.host)
        config = config_of(create_app(options.folder, token, once=once, read_only=options.read_only, hosts=hosts))
        address = f"http://{_name(options.host)}:{listening.getsockname()[1]}/"
        server = _server(config, lambda: ready(f"{address}?token={token}", f"{address}?once={once}"))
        with suppress(KeyboardInterrupt):
            server.run(sockets=[listening])
        config.app.state.studio.join()
        server.last_resort.cancel()


def config_of(app: Any) -> Any:
    """How uvicorn serves the application: quietly, with limits, without trust in headers of proxies."""
    import uvicorn

    from kineme.studio.server.connections import BACKLOG, LimitedConnection

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
    """Whether only this machine reaches a host."""
    try:
        return host.lower() == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _server(config: Any, ready: Callable[[], object]) -> Any:
    """A server that tells when it serves, and ends soon when it is stopped."""
    import uvicorn

    class Server(uvicorn.Server):
        last_resort = Timer(_GRACE, _end_at_once, [config.app.state.studio])  # also where the event loop itself waits

        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            _end_with_the_terminal(self)
            ready()

        async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
            self.last_resort.daemon = True
            self.last_resort.start()
            await super().shutdown(sockets)

    return Server(config)


def _end_at_once(studio: Studio) -> None:
    """End the process: a thread that computes cannot be ended otherwise, and the library loses nothing."""
    studio.uploads.close()
    os._exit(0)


def _end_with_the_terminal(server: Any) -> None:
    """Stop when the terminal is closed as when it is interrupted, unless that is ignored, as after `nohup`."""
    if os.name == "posix" and signal.getsignal(signal.SIGHUP) is signal.SIG_DFL:
        asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, lambda: setattr(server, "should_exit", True))


def _token() -> str:
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


def _listening(options: Options) -> socket.socket:
    """A socket that listens; on the usual port if that is free."""
    if not options.host:  # to the system that is every address
        raise SpecificationError(
            "expected an address to listen at, got an empty --host; leave it out for this machine alone, or write "
            "0.0.0.0 for every address"
        )
    if options.port is None:
        with suppress(OSError):
            return _bound(options.host, PORT)
    try:
        return _bound(options.host, options.port or 0)
    except OSError as error:
        taken = error.errno == errno.EADDRINUSE
        remedy = "choose another --port, or leave it out" if taken else "correct --host and --port"
        raise DataError(
            f"expected to serve at {options.host}:{options.port or 0}, got: {error.strerror or error}; {remedy}"
        ) from error


def _bound(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    both = host == "::" and socket.has_dualstack_ipv6()  # IPv4, too: the name of this machine is often one of those
    bound = socket.create_server((host, port), family=family, dualstack_ipv6=both)
    # Connections inherit it. Without it the body of an answer waits 40 ms for the receipt of its head to be confirmed.
    bound.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return bound


def _name(host: str) -> str:
    """How the host is written in an address that a browser on this machine opens."""
    if host in {"0.0.0.0", "::"}:
        return socket.gethostname()
    return f"[{host}]" if ":" in host else host
