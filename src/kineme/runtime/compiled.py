"""The one place that chooses between a compiled loop and its NumPy twin, and the only one that loads Numba.

Every compiled function has a plain twin that defines it. Importing Numba costs about half a second,
so small work stays with the twin. The environment variable ``KINEME_COMPILED`` forces the choice:
``always``, ``never`` or ``auto`` (default).

Numba's modules import each other in circles. Two threads that enter the circle at different places wait for each
other's import; Python breaks the deadlock by failing one of them, and leaves behind a Numba that never works again in
that process. Therefore everything that imports Numba, or a module with compiled functions, does so here, under one
lock, and imports the package ``numba`` before any of its modules: Python lets a thread that imports the same package
elsewhere wait until that import is done.
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from importlib import import_module
from threading import RLock
from typing import Any

from kineme.errors import SpecificationError
from kineme.runtime.forks import at_fork

CHOICES = ("auto", "always", "never")

# Elementary operations that take NumPy about as long as importing Numba and loading a cached
# kernel (0.6 s), and, once Numba is there, about as long as one dispatch.
_REPAYS_IMPORT = 100_000_000
_REPAYS_CALL = 10_000

# Should other threads get in the way of Numba's import: how often it is tried, and how long they are waited for [s].
_ATTEMPTS, _PATIENCE = 4, 10.0

_spent = 0  # elementary operations of jobs that ran plain so far
_loading = RLock()
_modules: dict[str, Any] = {}  # Numba and the modules with compiled functions, each once it is there as a whole
_failure = ""  # why Numba cannot be imported


def use_compiled(n_operations: int, now: int | None = None) -> bool:
    """Whether a job of about `n_operations` elementary operations should run compiled; if so, Numba has been loaded.

    Numba is imported for a job that repays it, and also once as much time went into small jobs: whoever comes again
    and again waits at most twice as long as if that had been known. `now` is the part of the job that this call does.
    Where Numba cannot be imported, a warning says so once, and everything runs plain.

    Raises
    ------
    SpecificationError
        ``KINEME_COMPILED`` is none of `CHOICES`, or it is "always" and Numba cannot be imported.
    """
    global _spent  # noqa: PLW0603 - the history of the process is what decides
    choice = _choice()
    if choice != "auto":
        return choice == "always" and _load(required=True)
    if "numba" in sys.modules:  # also while another thread imports it: the rest of that is worth waiting for
        return n_operations >= _REPAYS_CALL and _load()
    _spent += n_operations if now is None else now
    return max(n_operations, _spent) >= _REPAYS_IMPORT and _load()


def load_compiled() -> None:
    """Import Numba now, for work that must not stop for it later; without effect where compiling is ruled out."""
    choice = _choice()
    if choice != "never":
        _load(required=choice == "always")


def compiled_module(name: str) -> Any:
    """A module with compiled functions, such as ``kineme.kernels._compiled``; ask `use_compiled` first."""
    if name not in _modules:
        with _loading:
            _modules[name] = import_module(name)
    return _modules[name]


def jit(function: Callable[..., Any], *, cache: bool = True, reorder: bool = True) -> Callable[..., Any]:
    """Compile one thread's loop: cached on disk where possible, without the GIL.

    Pass ``cache=False`` for a function whose arguments are functions: its cache would never be found
    again. Only reassociation and contraction of floating-point operations are allowed, so NaN and infinity
    keep their meaning and validation can be compiled too. With ``reorder=False`` sums are added as they are written, so
    that two places with the same formula round alike.
    """
    _load(required=True)
    with _loading:
        allowed = {"reassoc", "contract", "nsz"} if reorder else {"contract", "nsz"}
        options: dict[str, Any] = {"nogil": True, "fastmath": allowed, "error_model": "numpy"}
        dispatcher: Callable[..., Any] = _modules["numba"].njit(**options)(function)
        if cache:
            compiled_module("kineme.runtime.machine_code").keep(dispatcher)
    return dispatcher


def _choice() -> str:
    choice = os.environ.get("KINEME_COMPILED", "auto")
    if choice not in CHOICES:
        raise SpecificationError(
            f"expected the environment variable KINEME_COMPILED to be one of {CHOICES}, got {choice!r}; "
            "unset it to let kineme choose"
        )
    return choice


def _load(required: bool = False) -> bool:
    """Import Numba, unless that has been done or has failed; whether it is there."""
    if "numba" not in _modules and not _failure:
        with _loading:
            if "numba" not in _modules and not _failure:
                _import_numba(required)
    if required and _failure:
        raise SpecificationError(
            f"expected Numba to be importable, got {_failure}; install it again, or unset KINEME_COMPILED "
            "to go on with plain NumPy"
        )
    return "numba" in _modules


def _import_numba(required: bool) -> None:
    global _failure  # noqa: PLW0603 - an import that failed is not tried again at every call
    for attempt in range(_ATTEMPTS):
        try:
            _modules["numba"] = _whole_numba()
            return
        except Exception as error:  # whatever an installation may raise
            failure = f"{type(error).__name__}: {error}"
        _let_others_finish(attempt)
        _remove_parts()
    _failure = failure
    if not required:
        warnings.warn(
            f"Numba cannot be imported ({failure}); kineme goes on with plain NumPy, which is slower. Install Numba "
            "again, or set KINEME_COMPILED=never to do without it",
            RuntimeWarning,
            stacklevel=4,
        )


def _whole_numba() -> Any:
    """Numba, imported from beginning to end."""
    try:
        numba = import_module("numba")
    except BaseException as error:
        if not isinstance(error, Exception):  # Ctrl-C
            _remove_parts()
        raise
    if not (hasattr(numba, "core") and hasattr(numba, "njit")):
        raise ImportError("parts of it are missing, as after an import that failed")
    return numba


def _remove_parts() -> None:
    """Remove what an import that failed or was interrupted leaves behind, so that the next one starts afresh.

    It would take the modules that are there for whole ones, and build a Numba without some of its parts.
    """
    for name in _parts_of_numba():
        sys.modules.pop(name, None)


def _let_others_finish(attempt: int) -> None:
    """Wait while another thread, which got in the way, imports a part of Numba: it marks what it has begun."""
    time.sleep(0.05 * attempt)  # it may only be about to begin
    late = time.monotonic() + _PATIENCE
    while time.monotonic() < late:
        parts = (sys.modules.get(name) for name in _parts_of_numba())
        if not any(getattr(getattr(part, "__spec__", None), "_initializing", False) for part in parts):
            return
        time.sleep(0.01)


def _parts_of_numba() -> list[str]:
    loaded = list(sys.modules.items())
    return [name for name, module in loaded if name.partition(".")[0] == "numba" and module is not None]


@contextmanager
def _nobody_compiles() -> Iterator[None]:
    """Before a fork: the child could not end what another thread had begun."""
    with _loading:
        compiler = sys.modules.get("numba.core.compiler_lock")
        with getattr(compiler, "global_compiler_lock", nullcontext()):
            yield


at_fork(_nobody_compiles)
