"""Every error and warning that kineme raises on purpose.

A message says what was expected, what came and what to do next. Each class is also the built-in
error that NumPy and scikit-learn users would catch.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

__all__ = [
    "DataError",
    "DegenerateMovementError",
    "DegenerateMovementWarning",
    "ExtrapolationWarning",
    "KinemeError",
    "SpecificationError",
    "TrajectoryError",
]

_HEARD: ContextVar[list[str] | None] = ContextVar("kineme_heard", default=None)


class KinemeError(Exception):
    """Base class: ``except kineme.errors.KinemeError`` catches all of them."""


class TrajectoryError(KinemeError, ValueError):
    """A trajectory or a set of demonstrations is not usable as it is."""


class DegenerateMovementError(TrajectoryError):
    """Start and goal coincide where the original formulation divides by ``g - x0``."""


class SpecificationError(KinemeError, ValueError):
    """A parameter of a specification (DMP, kernel, preprocessing step) is out of its range."""


class DataError(KinemeError, OSError):
    """A file or a packaged data set is missing, truncated or not what its name says."""


class DegenerateMovementWarning(UserWarning):
    """Some movements almost end where they start: their weights are huge and fragile."""


class ExtrapolationWarning(UserWarning):
    """Something is asked for that lies outside what was demonstrated: it is done, and how well is a guess."""


def warn(message: str, category: type[Warning], stacklevel: int) -> None:
    """Warn as `warnings.warn` does; inside `heard_warnings` the message is kept instead."""
    heard = _HEARD.get()
    if heard is None:
        warnings.warn(message, category, stacklevel=stacklevel + 1)
    else:
        heard.append(message)


@contextmanager
def heard_warnings() -> Iterator[list[str]]:
    """Context manager: the messages of `warn` here alone; `warnings.catch_warnings` is for all threads."""
    heard: list[str] = []
    token = _HEARD.set(heard)
    try:
        yield heard
    finally:
        _HEARD.reset(token)
