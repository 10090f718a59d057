"""The one place that chooses between a compiled loop and its NumPy twin.

Every compiled function has a plain twin that defines it. Importing Numba costs about half a second,
so small work stays with the twin. The environment variable ``KINEME_COMPILED`` forces the choice:
``always``, ``never`` or ``auto`` (default).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

from kineme.errors import SpecificationError

CHOICES = ("auto", "always", "never")

# Elementary operations that take NumPy about as long as importing Numba and loading a cached
# kernel (0.6 s), and, once Numba is there, about as long as one dispatch.
_REPAYS_IMPORT = 100_000_000
_REPAYS_CALL = 10_000


_spent = 0  # elementary operations of jobs that ran plain so far


def use_compiled(n_operations: int, now: int | None = None) -> bool:
    """Whether a job of about `n_operations` elementary operations should run compiled.

    Numba is imported for a job that repays it, and also once as much time went into small jobs: whoever comes again
    and again waits at most twice as long as if that had been known. `now` is the part of the job that this call does.
    """
    global _spent  # noqa: PLW0603 - the history of the process is what decides
    choice = os.environ.get("KINEME_COMPILED", "auto")
    if choice not in CHOICES:
        raise SpecificationError(
            f"expected the environment variable KINEME_COMPILED to be one of {CHOICES}, got {choice!r}; "
            "unset it to let kineme choose"
        )
    if choice != "auto":
        return choice == "always"
    if "numba" in sys.modules:
        return n_operations >= _REPAYS_CALL
    _spent += n_operations if now is None else now
    return max(n_operations, _spent) >= _REPAYS_IMPORT


def load_compiled() -> None:
    """Import Numba now, for work that must not stop for it later; without effect where compiling is ruled out."""
    if os.environ.get("KINEME_COMPILED", "auto") != "never":
        import numba  # noqa: F401


def jit(function: Callable[..., Any], *, cache: bool = True) -> Callable[..., Any]:
    """Compile one thread's loop: cached on disk where possible, without the GIL.

    Pass ``cache=False`` for a function whose arguments are functions: its cache would never be found
    again. Only reassociation and contraction of floating-point operations are allowed, so NaN and infinity
    keep their meaning and validation can be compiled too.
    """
    from numba import njit

    options: dict[str, Any] = {"nogil": True, "fastmath": {"reassoc", "contract", "nsz"}, "error_model": "numpy"}
    try:
        return njit(cache=cache, **options)(function)
    except RuntimeError:  # no writable place for the cache, as in a read-only installation
        return njit(**options)(function)
