"""Kernels from any distance of coordinates, Eq. (5)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from kineme.errors import SpecificationError
from kineme.kernels._rows import Rows
from kineme.kernels._sums import Term, TileSums, fill_gram
from kineme.kernels.base import Kernel
from kineme.runtime.compiled import compiled_module

# One call of a Python function costs about as much as this many elementary operations of NumPy.
_PYTHON_CALL = 100


@dataclass(frozen=True, repr=False)
class DistanceKernel(Kernel):
    r"""``k(x, y) = h(Σ_j g(d(x_j, y_j)))``, Eq. (5), for functions of your own.

    Nothing is claimed about positive semi-definiteness: it depends on the functions. With
    ``h(z) = exp(-z)`` it holds if ``g(d(x, y))`` is conditionally negative definite (Schoenberg), as for
    ``|x - y|^p`` with ``0 < p <= 2``.

    Parameters
    ----------
    d, g : callables
        d(x, y) and g(z) of single numbers: Python functions that Numba can compile (arithmetic, if,
        min, max, abs, the functions of ``math``), or already compiled ones. Small jobs run them as
        Python. They are compiled once per process.
    h : callable
        h(sums) for an array, elementwise, giving an array of that shape.

    Examples
    --------
    >>> import numpy as np
    >>> from kineme.kernels import DistanceKernel
    >>> cauchy = DistanceKernel(d=lambda x, y: abs(x - y), g=lambda z: z * z, h=lambda s: 1 / (1 + s))
    >>> cauchy([[0.0, 0.0]], [[1.0, 2.0]]).round(3)
    array([[0.167]])
    """

    d: Callable[[Any, Any], Any]
    g: Callable[[Any], Any]
    h: Callable[[Any], Any]

    def __post_init__(self) -> None:
        for name in ("d", "g", "h"):
            if not callable(getattr(self, name)):
                raise SpecificationError(f"expected a function {name}, got {getattr(self, name)!r}")

    def __repr__(self) -> str:
        names = (f"{name}={getattr(f, '__name__', repr(f))}" for name, f in self.get_params().items())
        return f"DistanceKernel({', '.join(names)})"

    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        def similarity(tile: Rows) -> None:
            similarities = np.asarray(self.h(tile))
            if similarities.shape != tile.shape:
                raise SpecificationError(
                    f"expected h to map an array of shape {tile.shape} to that shape, got {similarities.shape}; "
                    "write h with array operations, such as np.exp(-s)"
                )
            tile[...] = similarities

        # The caller's d may be asymmetric, so no triangle of the Gram matrix is mirrored.
        term = Term(self._in_python, self._compiled, cost=_PYTHON_CALL, symmetric=False)
        fill_gram(term, 0.0, similarity, A, B, gram)

    def _in_python(self, x: Rows, y: Rows, _c: Any) -> Rows:
        # Numba-compiled functions carry the Python function they were made from; either can be called.
        terms = np.frompyfunc(lambda a, b: self.g(self.d(a, b)), 2, 1)(x, y)
        return np.asarray(terms, dtype=x.dtype)

    def _compiled(self) -> TileSums:
        compiled = compiled_module("kineme.kernels._compiled")
        loop = compiled.user_sums(self.d, self.g)

        def sums(A: Rows, B: Rows, c: Any, sums_of_tile: Rows) -> None:
            try:
                loop(A, B, c, sums_of_tile)
            except compiled.NumbaError as error:
                raise SpecificationError(
                    f"expected functions d and g that Numba can compile, got {self}; use arithmetic and math on "
                    f"numbers, or set KINEME_COMPILED=never to run them as Python. Numba says: {error}"
                ) from error

        return sums
