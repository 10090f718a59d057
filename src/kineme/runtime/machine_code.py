"""Compiled functions on disk, read again by later processes. Importing this imports Numba."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from numba.core.caching import FunctionCache, IndexDataCacheFile


def keep(dispatcher: Callable[..., Any], compiling: Callable[[], object]) -> None:
    """Cache a function's machine code on disk, if there is a writable folder for it.

    `compiling` is called whenever the machine code for some types of arguments is not there.
    """
    function = getattr(dispatcher, "py_func", None)  # missing with NUMBA_DISABLE_JIT, which returns plain functions
    if function is not None:
        with suppress(RuntimeError):  # no writable folder, as in a read-only installation
            dispatcher._cache = _Cache(function, compiling)  # type: ignore[attr-defined]


class _Cache(FunctionCache):
    def __init__(self, function: Callable[..., Any], compiling: Callable[[], object]) -> None:
        super().__init__(function)
        self._compiling = compiling
        implementation = self._impl
        self._cache_file = _Files(
            cache_path=self._cache_path,
            filename_base=implementation.filename_base,
            source_stamp=implementation.locator.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        found = super().load_overload(sig, target_context)
        if found is None:
            self._compiling()
        return found


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
