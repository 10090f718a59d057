from __future__ import annotations

import warnings
from contextlib import ExitStack, contextmanager
from shutil import copytree

import pytest
from browser_samples import UNANSWERED
from studio_samples import BEARER, TOKEN, Served, make_library

from browsing import Pages, wait_until

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # later releases of starlette ask for a later httpx, earlier ones for this one
    from fastapi.testclient import TestClient

from kineme.studio.server.app import create_app


@pytest.fixture(scope="session")
def learned(tmp_path_factory):
    """A library that no test opens: each gets a copy."""
    return make_library(tmp_path_factory.mktemp("learned") / "actions")


@pytest.fixture
def folder(learned, tmp_path):
    return copytree(learned, tmp_path / "actions")


@contextmanager
def client_of(folder, **options):
    """A client of a studio in this process."""
    app = create_app(folder, TOKEN, **options)
    with TestClient(app, "http://127.0.0.1:8420", headers=BEARER, raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def open_studio():
    """A function that opens a studio for a client; all are closed at the end."""
    with ExitStack() as opened:
        yield lambda folder, **options: opened.enter_context(client_of(folder, **options))


@pytest.fixture
def client(folder, open_studio):
    return open_studio(folder)


@pytest.fixture(scope="module")
def studio_of_module(learned, tmp_path_factory):
    with client_of(copytree(learned, tmp_path_factory.mktemp("shared") / "actions")) as client:
        yield client


@pytest.fixture
def shared_client(studio_of_module):
    """A client of a studio that the tests of a module share: they see what others have stored there."""
    yield studio_of_module
    studio_of_module.cookies.clear()


@pytest.fixture(scope="module")
def pages(browser):
    """The pages of all tests of a module."""
    pages = Pages(browser, script=UNANSWERED)
    yield pages
    pages.close()


@pytest.fixture
def studio():
    """A function that serves a library; all are ended."""
    served = []

    def start(folder, **options):
        served.append(Served(folder, **options))
        return served[-1]

    yield start
    for server in served:
        server.end()


@pytest.fixture
def allowed():
    """Beginnings of addresses that pages may ask beside those of the studios."""
    return "blob:", "data:"


@pytest.fixture
def opened(pages, studio, allowed):  # studios are ended after their pages
    """A function that opens a studio; at the end nothing went wrong, and nothing was asked from elsewhere.

    Nothing moves by itself unless a test asks for it: to paint sixty pictures a second takes longer than most tests.
    """
    addresses = set()

    def open_page(studio, view="draw", reduced_motion="reduce", **options):
        page = pages.new(reduced_motion=reduced_motion, **options)
        addresses.add(studio.address)
        page.goto(f"{studio.address}/?token={studio.token}" + f"#{view}" * bool(view))
        wait_until(page, "document.getElementById('library-name').textContent.trim() !== ''")
        wait_until(page, "document.getElementById('status').dataset.state === 'here'")
        return page

    yield open_page
    pages.leave(*addresses, *allowed)
