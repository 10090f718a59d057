from __future__ import annotations

import warnings

import pytest
from studio_samples import BEARER, TOKEN, make_library

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # later releases of starlette ask for a later httpx, earlier ones for this one
    from fastapi.testclient import TestClient

from kineme.studio.server.app import create_app


@pytest.fixture
def folder(tmp_path):
    return make_library(tmp_path / "actions")


@pytest.fixture
def open_studio():
    """Clients of studios, closed at the end."""
    opened = []

    def start(folder, **options):
        app = create_app(folder, TOKEN, **options)
        client = TestClient(app, "http://127.0.0.1:8420", headers=BEARER, raise_server_exceptions=False)
        client.__enter__()
        opened.append(client)
        return client

    yield start
    for client in opened:
        client.__exit__(None, None, None)


@pytest.fixture
def client(folder, open_studio):
    return open_studio(folder)
