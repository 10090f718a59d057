"""Base class of the kernels: a frozen specification that maps rows to a Gram matrix."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import fields, replace
from numbers import Real
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from kineme.errors import SpecificationError
from kineme.kernels._parameters import Parameters
from kineme.kernels._rows import Rows, checked_pair, checked_rows


class Kernel(Parameters, ABC):
    """A similarity of feature rows; subclasses are frozen dataclasses.

    A width that is None is chosen from the *reference* rows of each call: B, or A where B is None.
    scikit-learn passes its training rows as B, so a classifier keeps the width of its training data.
    `fit` stores the numbers instead.
    """

    def __call__(self, A: ArrayLike, B: ArrayLike | None = None) -> Rows:
        """Gram matrix of similarities k(A[i], B[j]).

        Parameters
        ----------
        A : array-like (n_A, p)
        B : array-like (n_B, p), optional
            A itself by default, which costs half.

        Returns
        -------
        ndarray (n_A, n_B), float32 where A and B are float32, else float64

        Raises
        ------
        SpecificationError
            Rows that are not finite numbers in two dimensions, columns that do not match, or a
            width that is None with reference rows that do not determine it.
        """
        rows, others = checked_pair(A, B)
        reference = rows if others is None else others
        kernel = self._with_widths(reference)
        kernel._check_dtype(rows.dtype)
        gram = np.empty((len(rows), len(reference)), rows.dtype)
        if gram.size:
            kernel._fill(rows, others, gram)
        return gram

    def fit(self, X: ArrayLike) -> Self:
        """Return the kernel with every width that is None computed from the rows X (n, p)."""
        return self._with_widths(checked_rows(X))

    def _with_widths(self, X: Rows) -> Self:
        missing = [name for name in self._width_names() if getattr(self, name) is None]
        if not missing:
            return self
        # Widths are statistics: float64 whatever the rows are.
        return replace(self, **{name: self._median_width(name, X) for name in missing})  # type: ignore[type-var]

    def _check_dtype(self, dtype: np.dtype[np.floating]) -> None:
        for name in self._width_names():
            _check_representable(getattr(self, name), name, dtype)

    def _check_widths(self) -> None:
        for name in self._width_names():
            value, default = getattr(self, name), getattr(type(self), name)
            hint = "leave it out to take it from the training rows" if default is None else f"the default is {default}"
            if value is not None or default is not None:
                object.__setattr__(self, name, _positive(value, name, hint))

    @classmethod
    def _width_names(cls) -> tuple[str, ...]:
        return tuple(field.name for field in fields(cls) if field.metadata.get("width"))  # type: ignore[arg-type]

    def _median_width(self, name: str, X: Rows) -> float:
        raise NotImplementedError(f"{type(self).__name__} has no rule for {name}")

    @abstractmethod
    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        """Write the Gram matrix of checked, non-empty rows; B None means A."""


def _positive(value: object, name: str, otherwise: str) -> float:
    """Return `value` as a float; refuse it unless it is finite and above zero. The message ends with `otherwise`."""
    try:
        number = float(value) if isinstance(value, Real) else math.nan
    except OverflowError:  # an integer beyond the range of floats
        number = math.inf
    if not math.isfinite(number) or number <= 0:
        raise SpecificationError(f"expected a finite {name} > 0, got {value!r}; {otherwise}")
    return number


def _check_representable(value: float, name: str, dtype: np.dtype[np.floating]) -> None:
    """Raise SpecificationError if `value` squared leaves the range of `dtype`."""
    limits = np.finfo(dtype)
    if not float(limits.tiny) <= value * value <= float(limits.max):
        raise SpecificationError(
            f"expected {name} squared within the range of {dtype}, got {name} = {value:g}; "
            "rescale the features or pass float64 rows"
        )
