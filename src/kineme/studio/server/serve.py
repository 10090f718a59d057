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
from typing import Any, NamedTuple

from kineme.errors import DataError, SpecificationError
from kineme.library.storage.address import Address
from kineme.studio.server.connections import OncePerInterval, config_of

LOOPBACK = "127.0.0.1"
PORT = 8420  # unless it is taken
TOKEN = "KINEME_STUDIO_TOKEN"  # in the environment: one that stays when the studio is started again
_LEAST_TOKEN, _MOST_TOKEN = 16, 1000  # characters; browsers keep no cookie of more than 4,096 bytes
_GRACE = 2.0  # seconds for what runs when it is stopped


class Options(NamedTuple):
    """Options of the server; port None is 8420, or any that is free."""

    folder: Path | Address
    host: str = LOOPBACK
    port: int | None = None
    read_only: bool = False
    recordings: Path | None = None  # what is shown of episodes


def serve(options: Options, ready: Callable[[str, str], object]) -> None:
    """Serve a library until interrupted; `ready` is called with its address, and one without token that opens once."""
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
    """Serve an application at a socket until interrupted; `ready` is called once it can be asked.

    Then `join` is called; what does not stop within two seconds is ended with the process, after `end` was called.
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
