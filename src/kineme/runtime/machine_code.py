"""Compiled functions on disk, read again by later processes. Importing this imports Numba."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numba.core.caching import FunctionCache, IndexDataCacheFile


def keep(dispatcher: Callable[..., Any], compiling: Callable[[], object]) -> None:
    """Cache a function's machine code on disk, if there is a writable folder for it.

    `compiling` is called whenever the machine code for some types of arguments is not there.
    """
    function = getattr(dispatcher, "py_func", None)  # missing with NUMBA_DISABLE_JIT, which returns plain functions
    if function is not None:
        with suppress(RuntimeError):  # no writable folder, as in a read-only installation
            dispatcher._cache = _Cache(function, compiling)  # type: ignore[attr-defined]


def _inlined(names: Mapping[str, Any]) -> str:
    """Digest of what machine code holds besides its own file: constants of a module, and compiled functions of others.

    Numba looks at the file of the function alone. After an update that changes a constant elsewhere it would go on with
    the machine code of before.
    """
    digest, modules, waiting = sha256(), {names["__name__"]}, [names]
    while waiting:
        own = waiting.pop()
        for name, value in own.items():
            if _is_constant(value) and not name.startswith("__"):
                digest.update(f"{name} = {value!r};".encode())
            elif hasattr(value, "py_func") or type(value).__module__.startswith("numba."):
                module = sys.modules.get(str(getattr(value, "__module__", "")))
                if module is not None and module.__name__ not in modules and module.__file__ is not None:
                    modules.add(module.__name__)
                    digest.update(Path(module.__file__).read_bytes())
                    waiting.append(vars(module))
    return digest.hexdigest()


def _is_constant(value: Any) -> bool:
    if isinstance(value, tuple):
        return all(map(_is_constant, value))
    return isinstance(value, (int, float, str, np.generic))


class _Cache(FunctionCache):
    def __init__(self, function: Callable[..., Any], compiling: Callable[[], object]) -> None:
        super().__init__(function)
        self._compiling = compiling
        implementation = self._impl
        self._cache_file = _Files(
            cache_path=self._cache_path,
            filename_base=implementation.filename_base,
            source_stamp=(implementation.locator.get_source_stamp(), _inlined(function.__globals__)),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        overload = super().load_overload(sig, target_context)
        if overload is None:
            self._compiling()
        return overload


class _Files(IndexDataCacheFile):
    """Numba's cache files, each with its own key inside.

    Numba numbers the files of a function and lists them in an index. Two processes that compile a function at the same
    time for different arguments take the same number: the index then names one version and the file holds the other,
    and every later process fails. Here a file whose key does not match, or that cannot be read, counts as missing: the
    function is compiled and the file is written again. If a file cannot be written, as on a full disk, nothing is
    cached.
    """

    def save(self, key: Any, data: Any) -> None:
        with suppress(OSError):
            super().save(key, (key, self._source_stamp, data))

    def load(self, key: Any) -> Any:
        try:
            *said, data = super().load(key)
        except Exception:  # a missing file, or damaged bytes, on which unpickling may raise anything
            return None
        return data if said == [key, self._source_stamp] else None

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:
            return {}
