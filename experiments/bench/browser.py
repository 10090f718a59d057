"""Chromium of the system, for what is measured in a browser."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


def chromium_path() -> str | None:
    """Path of Chromium: that in the environment variable CHROMIUM, or the system's, its headless shell first."""
    names = "chromium-headless-shell", "chromium", "google-chrome"
    return os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, names)), None)


@contextmanager
def chromium(asks: str) -> Iterator[Any]:
    """Headless Chromium, or the program in the environment variable CHROMIUM; None, and a line why, without it.

    Parameters
    ----------
    asks : str
        Which benchmark needs it.
    """
    path = chromium_path()
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        path, missing = None, "the package playwright"
    else:
        missing = "chromium"
    if path is None:
        print(f"{asks}: {missing} is not installed")
        yield None
        return
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, headless=True)
        yield browser
        browser.close()
