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
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from importlib import import_module
from threading import RLock
from typing import Any

from kineme.errors import SpecificationError, warn
from kineme.runtime.forks import at_fork

CHOICE = "KINEME_COMPILED"  # the variable of the environment
CHOICES = ("auto", "always", "never")

# Elementary operations that take NumPy about as long as importing Numba and loading a cached
# kernel (0.6 s), and, once Numba is there, about as long as one dispatch.
_REPAYS_IMPORT = 100_000_000
_REPAYS_CALL = 10_000

# Another thread may disturb the import of Numba: number of tries, and how long to wait for that thread [s].
_ATTEMPTS, _PATIENCE = 4, 10.0

_spent = 0  # elementary operations of jobs that ran plain so far
_loading = RLock()
_modules: dict[str, Any] = {}  # Numba and the modules with compiled functions that are completely imported
_failure = ""  # why Numba cannot be imported; "" if it can, or has not been tried
_tell: list[Callable[[], object]] = []  # what is called before the first function is compiled that is not on disk


def use_compiled(n_operations: int, now: int | None = None) -> bool:
    """Tell whether a job of about `n_operations` elementary operations runs compiled; if so, Numba has been loaded.

    Numba is imported for a job that is large enough to repay the import, and also once small jobs together have cost as
    much: many small calls then take at most twice the time that compiling at once would have taken. `now` is the part
    of the job that this call does. Where Numba cannot be imported, a warning says so once, and everything runs plain.
    """
    global _spent  # noqa: PLW0603 - counted over the whole process
    choice = _choice()
    if choice != "auto":
        return choice == "always" and _load(required=True)
    if "numba" in sys.modules:  # also while another thread is importing it
        return n_operations >= _REPAYS_CALL and _load()
    _spent += n_operations if now is None else now
    return max(n_operations, _spent) >= _REPAYS_IMPORT and _load()


def load_compiled() -> None:
    """Import Numba now, for work that must not stop for it later; without effect where compiling is ruled out."""
    choice = _choice()
    if choice != "never":
        _load(required=choice == "always")


def tell_when_compiling(tell: Callable[[], object]) -> None:
    """Let `tell` be called once, when this process begins to compile what no earlier one has left on disk."""
    _tell[:] = [tell]


def _compiling() -> None:
    with suppress(IndexError):  # told already; no lock, since this thread holds the compiler's
        _tell.pop()()


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
            compiled_module("kineme.runtime.machine_code").keep(dispatcher, _compiling)
    return dispatcher


@contextmanager
def compiled_always() -> Iterator[None]:
    """Context manager: loops are compiled, however little work there is, so that all processes get the same digits."""
    before = os.environ.get(CHOICE)
    os.environ[CHOICE] = before or "always"
    try:
        yield
    finally:
        if before is None:
            del os.environ[CHOICE]


def _choice() -> str:
    choice = os.environ.get(CHOICE, "auto")
    if choice not in CHOICES:
        raise SpecificationError(
            f"expected the environment variable KINEME_COMPILED to be one of {CHOICES}, got {choice!r}; "
            "unset it to let kineme choose"
        )
    return choice


def _load(required: bool = False) -> bool:
    """Import Numba, unless that was done or failed before; return whether it is imported."""
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
            numba = import_module("numba")
            if hasattr(numba, "core") and hasattr(numba, "njit"):
                _modules["numba"] = numba
                return
            failure = "ImportError: parts of it are missing, as after an import that failed"
        except Exception as error:  # a broken installation can raise anything
            failure = f"{type(error).__name__}: {error}"
        except BaseException:  # Ctrl-C
            _remove_parts()
            raise
        _let_others_finish(attempt)
        _remove_parts()
    _failure = failure
    if not required:
        warn(
            f"Numba cannot be imported ({failure}); kineme goes on with plain NumPy, which is slower. Install Numba "
            "again, or set KINEME_COMPILED=never to do without it",
            RuntimeWarning,
            stacklevel=4,
        )


def _remove_parts() -> None:
    """Remove the modules that a failed or interrupted import leaves behind, so that the next import loads all again.

    Otherwise that import would reuse half-imported modules, and Numba would lack some of its parts.
    """
    for name in _parts_of_numba():
        sys.modules.pop(name, None)


def _let_others_finish(attempt: int) -> None:
    """Wait until no other thread imports a part of Numba; modules whose import is under way are marked."""
    time.sleep(0.05 * attempt)  # the other thread may be just before its import
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
def _compiler_held() -> Iterator[None]:
    """Hold off other threads' compilations over a fork: the child could not finish them."""
    with _loading:
        compiler = sys.modules.get("numba.core.compiler_lock")
        with getattr(compiler, "global_compiler_lock", nullcontext()):
            yield


at_fork(_compiler_held)
