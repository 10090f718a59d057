"""Python's search for garbage, left out while much is made that is no garbage."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collector_paused() -> Iterator[None]:
    """Context manager: no search for garbage; it would go through all lists again and again while they become more.

    What nothing refers to is freed as ever; only what refers to itself in a circle waits.
    """
    paused = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if paused:
            gc.enable()
