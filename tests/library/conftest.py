"""A PostgreSQL server of the tests' own, and places for libraries: a folder, and a schema there."""

from __future__ import annotations

from itertools import count

import pytest

from bench.postgres_server import programs, running_server

_NUMBERS = count(1)


@pytest.fixture(scope="session")
def server():
    """A running server; tests that need it are skipped where there is none, or no psycopg."""
    pytest.importorskip("psycopg")
    if programs() is None:
        pytest.skip("no PostgreSQL server here: apt-get install postgresql")
    with running_server("fsync=off") as running:
        yield running


@pytest.fixture
def address(server, tmp_path, monkeypatch):
    """The address of a library that is not there yet; its caches lie in a folder of this test."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return server.address(f"library {next(_NUMBERS)}".replace(" ", "%20"))


@pytest.fixture(params=["folder", "server"])
def place(request, tmp_path):
    """Where a library may be made: a folder, and an address."""
    return tmp_path / "actions" if request.param == "folder" else request.getfixturevalue("address")
