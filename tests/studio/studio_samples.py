"""Studios for tests: in this process, and as the command runs it."""

from __future__ import annotations

import os
import re
import signal
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import ClassVar

import numpy as np
import uvicorn

from kineme import ActionLibrary, Trajectory
from kineme.studio.server.app import create_app
from kineme.studio.server.connections import config_of

TOKEN = "a-token-for-tests-only"
BEARER = {"Authorization": f"Bearer {TOKEN}"}
LIVE = "ws://127.0.0.1:8420/api/live"
ROOT = Path(__file__).parents[2]


def drawing(k, n=60, seed=None):
    """A smooth movement of its own shape for each k, a little different for each seed."""
    u = np.linspace(0, 1, n)[:, None]
    waves = np.random.default_rng(k).normal(size=(4, 2))
    if seed is not None:
        waves = waves + 0.05 * np.random.default_rng([k, seed]).normal(size=(4, 2))
    return u[:, 0] * 1.5, np.sin(np.pi * u * np.arange(1, 5)) @ waves + u * [1.0, 0.3]


def make_library(folder, symbols=4, members=3, d=2):
    """A library of so many symbols, "kind 0" and so on."""
    shown = [(k, drawing(k, seed=i)) for k in range(symbols) for i in range(members)]
    with ActionLibrary(folder, create=True) as library:
        movements = [Trajectory(t, np.pad(x, ((0, 0), (0, d - 2)))) for _, (t, x) in shown]
        library.learn(movements, [f"kind {k}" for k, _ in shown])
    return folder


def request_of(k, seed=99, **more):
    """A drawing as a request."""
    times, positions = drawing(k, seed=seed)
    return {"times": times.tolist(), "positions": positions.tolist(), **more}


def samples(k, seed=99):
    """A drawing as the samples of the websocket."""
    times, positions = drawing(k, seed=seed)
    return np.column_stack((times, positions)).tolist()


class Running:
    """A studio in a process of its own, as the command starts it."""

    def __init__(self, folder, *options, program=None):
        environment = os.environ | {"PYTHONPATH": str(ROOT / "src"), "KINEME_STUDIO_TOKEN": TOKEN}
        kineme = ["-m", "kineme"] if program is None else ["-c", program]
        command = [sys.executable, *kineme, "studio", "-l", str(folder), "--no-open", *map(str, options)]
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment,
            text=True,
            start_new_session=True,
        )
        guard = threading.Timer(300, self.process.kill)
        guard.start()
        self.line = self.process.stdout.readline() + self.process.stdout.readline()  # its address, and how to stop it
        guard.cancel()
        match = re.search(r"(http://\S+?)/\?token=(\S+)", self.line)
        assert match, self.process.communicate()
        self.address, self.token = match.groups()

    def end(self, how=signal.SIGINT):
        """Stop it; the exit code and what it wrote."""
        self.process.send_signal(how)
        out, err = self.process.communicate(timeout=300)
        return self.process.returncode, self.line + out, err


def _listening(ports):
    """A socket at one of the ports that others have left, or at a new one."""
    while ports:
        with suppress(OSError):  # another process may have taken it
            return socket.create_server(("127.0.0.1", ports.pop()))
    return socket.create_server(("127.0.0.1", 0))


class Served:
    """A studio of this process, served in a thread: it begins at once, where `Running` imports everything first.

    It listens where one that has ended did, so that a browser asks only whether the files that it has are the same.
    """

    left: ClassVar[list[int]] = []  # ports

    def __init__(self, folder, **options):
        self.token, self._socket = TOKEN, _listening(self.left)
        self._port = self._socket.getsockname()[1]
        self.address = f"http://127.0.0.1:{self._port}"
        self._server = uvicorn.Server(config_of(create_app(folder, TOKEN, **options)))
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [self._socket]}, daemon=True)
        self._thread.start()  # what comes before it listens waits in the socket

    def end(self):
        """Stop it."""
        self._server.should_exit = True
        self._thread.join(300)
        self._socket.close()
        self.left.append(self._port)


@contextmanager
def running(folder, *options, program=None):
    studio = Running(folder, *options, program=program)
    try:
        yield studio
    finally:
        studio.process.kill()
        studio.process.communicate()
