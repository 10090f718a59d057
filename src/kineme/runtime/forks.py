"""The one place that prepares this process for forks.

A fork copies the memory of a process and one of its threads. What another thread was in the middle of stays so for
ever in the copy: a lock that it held, Numba's compiler half way, a connection to a database within a transaction.
Whoever keeps such things between calls says here how to bring them to rest before a fork, and what to make anew in the
child. Forks that Python does not start itself, as those of some servers written in C, cannot be prepared; for them only
the second is done.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack, nullcontext
from functools import cached_property
from threading import RLock
from typing import Any

_guards: list[tuple[Callable[[], AbstractContextManager[Any]], Callable[[], None]]] = []
_turn = RLock()  # one fork at a time
_held = ExitStack()


def at_fork(
    hold: Callable[[], AbstractContextManager[Any]] = nullcontext,
    renew: Callable[[], None] = lambda: None,
    *,
    first: bool = False,
) -> None:
    """Prepare every later fork.

    Parameters
    ----------
    hold : callable
        Gives a context manager, entered before a fork and left after it, in the parent and in the child: a lock, say.
    renew : callable
        Called in the child before it is left there: makes anew what another thread may have held for a moment.
    first : bool
        Enter it before the others: for what waits for work that may need their locks.
    """
    _guards.insert(0 if first else len(_guards), (hold, renew))


def _before() -> None:
    _turn.acquire()
    for hold, _ in _guards:
        _held.enter_context(hold())


def _in_parent() -> None:
    try:
        _held.close()
    finally:
        _turn.release()


def _in_child() -> None:
    global _turn, _held
    held, _turn, _held = _held, RLock(), ExitStack()
    for _, renew in _guards:
        renew()
    held.close()
    if sys.version_info < (3, 12):  # there, all instances compute a cached property under one lock
        _renew_cached_properties()


def _renew_cached_properties() -> None:
    classes = {
        value
        for name, module in list(sys.modules.items())
        if name.partition(".")[0] == "kineme"
        for value in list(vars(module).values())
        if isinstance(value, type)
    }
    for attribute in (value for one in classes for value in vars(one).values() if isinstance(value, cached_property)):
        vars(attribute)["lock"] = RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before, after_in_parent=_in_parent, after_in_child=_in_child)
