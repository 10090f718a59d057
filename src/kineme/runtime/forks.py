"""Fork handlers: the one place that prepares this process for forks.

A fork copies the memory of a process but only one of its threads. What another thread was doing is never finished in
the child: a lock stays locked, Numba's compiler stays half way, a database connection stays within a transaction.
Modules that keep such state between calls register here how to bring it into a consistent state before a fork, and what
to create again in the child. Forks that Python does not start itself, as in some servers written in C, cannot be
prepared; for them only the second part is done.
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

    `hold` returns a context manager that is entered before a fork and left after it, in the parent and in the child:
    for example a lock. `renew` is called in the child before that is left: it creates again what another thread may
    have held. `first` enters it before the others, where it waits for work that may need the other locks.
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
    if sys.version_info < (3, 12):  # before 3.12, all instances share one lock per cached property
        classes = {
            value
            for name, module in list(sys.modules.items())
            if name.partition(".")[0] == "kineme"
            for value in list(vars(module).values())
            if isinstance(value, type)
        }
        for attribute in (
            value for klass in classes for value in vars(klass).values() if isinstance(value, cached_property)
        ):
            vars(attribute)["lock"] = RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_before, after_in_parent=_in_parent, after_in_child=_in_child)
