"""Connections that ask nothing lock nobody out, end, and fill no log."""

from __future__ import annotations

import errno
import json
import logging
import os
import socket
from contextlib import ExitStack

import httpx
import pytest
from studio_samples import BEARER, Served, make_library, running, samples
from websockets.sync.client import connect

from kineme.studio.server import connections

#: The command with few file descriptors, as where a user's limit is low.
FEW = (
    "import resource; resource.setrlimit(resource.RLIMIT_NOFILE, (96, 96)); "
    "from kineme.cli import main; main(prog_name='kineme')"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return make_library(tmp_path_factory.mktemp("shared") / "actions")


def _port(address):
    return int(address.rpartition(":")[2].rstrip("/"))


def _open(stack, address, data=b"GET / HTTP/1.1\r\nHost: lo"):
    """A connection with the beginning of a head; None where it is refused."""
    client = stack.enter_context(socket.create_connection(("127.0.0.1", _port(address)), 30))
    client.sendall(data)
    return client


@pytest.mark.skipif(os.name != "posix", reason="file descriptors are limited on POSIX")
def test_hundreds_of_heads_that_never_end_lock_nobody_out_and_fill_no_log(folder):
    with running(folder, program=FEW) as studio, ExitStack() as stack:
        with connect(f"{studio.address.replace('http', 'ws')}/api/live", additional_headers=BEARER) as page:
            for _ in range(300):
                _open(stack, studio.address)
            for _ in range(3):  # each in a connection of its own
                assert httpx.get(f"{studio.address}/api/library", headers=BEARER, timeout=300).status_code == 200
            page.send(json.dumps({"samples": samples(2)}))  # a websocket that is open stays
            assert page.recv(300)
        _, _, written = studio.end()
        assert len(written) < 10_000


@pytest.fixture
def studio(folder, monkeypatch):
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.2)
    served = Served(folder)
    yield served
    served.end()


@pytest.mark.parametrize("before", [b"", b"GET /favicon.ico HTTP/1.1\r\nHost: localhost\r\n\r\n"])
def test_a_head_that_never_ends_is_closed(studio, before):
    """The first of a connection, and one after a request that was answered."""
    with ExitStack() as stack:
        client = _open(stack, studio.address, before)
        if before:
            assert client.recv(1 << 16).startswith(b"HTTP/1.1")
        client.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ")
        try:
            while client.recv(1 << 16):  # until it is closed; a test that waits in vain ends by its own time limit
                pass
        except ConnectionResetError:
            pass


def test_a_websocket_outlives_the_time_limit_of_heads(studio):
    with (
        connect(f"{studio.address.replace('http', 'ws')}/api/live", additional_headers=BEARER) as page,
        ExitStack() as stack,
    ):
        client = _open(stack, studio.address)  # it begins later
        with pytest.raises((ConnectionResetError, StopIteration)):
            next(iter(lambda: client.recv(1), b""))
        page.send(json.dumps({"samples": samples(2)}))
        assert page.recv(300)


def test_limits_follow_the_file_descriptors(monkeypatch):
    resource = pytest.importorskip("resource")
    for descriptors, most in ((16, 8), (96, 24), (1024, 256), (1 << 20, 512), (resource.RLIM_INFINITY, 512)):
        monkeypatch.setattr(resource, "getrlimit", lambda _, n=descriptors: (n, n))
        assert connections.most_connections() == most


def test_the_same_error_is_logged_once_a_minute(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(connections.time, "monotonic", lambda: now[0])
    once = connections.OncePerInterval()

    def logged(text):
        return once.filter(logging.LogRecord("asyncio", logging.ERROR, "", 0, text, (), None))

    first = f"socket.accept() out of system resource\n{os.strerror(errno.EMFILE)}"
    assert logged(first)
    assert not any(logged(first) for _ in range(1000))
    assert logged("another")
    now[0] = 61.0
    assert logged(first)
