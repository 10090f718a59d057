"""Base class of the kernels: a frozen specification that maps rows to a Gram matrix.

Its parameters have names, as scikit-learn reads, sets and clones them.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import fields, replace
from numbers import Real
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kineme.errors import SpecificationError

Rows = NDArray[np.floating]


class Parameters:
    """Base of frozen dataclasses whose fields are parameters for scikit-learn's searches.

    scikit-learn clones an estimator with its kernel, then sets the parameters of the clone in place. `set_params` is
    therefore the one way to change such an object. It refuses one that was hashed, since its hash must stay as it is:
    a key of a dict or a member of a set never changes.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.__hash__ = Parameters.__hash__  # type: ignore[method-assign]  # else the dataclass makes one of its own

    def __hash__(self) -> int:
        object.__setattr__(self, "_hashed", True)
        return hash((type(self), *(getattr(self, name) for name in _names(self))))

    def __getstate__(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in _names(self)}

    def __sklearn_clone__(self) -> Self:
        return replace(self, **{name: _copy(getattr(self, name)) for name in _names(self)})  # type: ignore[type-var]

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Parameters by name; `deep` ones of a kernel inside as ``kernel__sigma``, of several ``kernel__0__sigma``."""
        parameters = {name: getattr(self, name) for name in _names(self)}
        if deep:
            for name in tuple(parameters):
                parameters |= _nested(name, parameters[name])
        return parameters

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters by name, in place, and return the kernel; kernels inside are replaced: others may share them.

        Raises `SpecificationError`, and changes nothing: a name that is no parameter, a value out of range, or a kernel
        that was hashed.
        """
        if parameters and self.__dict__.get("_hashed"):
            raise SpecificationError(
                f"expected a kernel that was never hashed, got {self}, which may be a key of a dict or a constant; "
                "set the parameters of sklearn.base.clone(kernel)"
            )
        changed = self._with_parameters(parameters)
        for name in _names(self):
            object.__setattr__(self, name, getattr(changed, name))
        return self

    def _with_parameters(self, parameters: Mapping[str, Any]) -> Self:
        """A copy with other parameters."""
        changes: dict[str, Any] = {}
        for name, value in sorted(parameters.items()):  # "kernel" comes before "kernel__sigma"
            own, _, inner = name.partition("__")
            if own not in _names(self):
                raise SpecificationError(
                    f"expected parameters of {type(self).__name__}, {list(self.get_params())}, got {name!r}"
                )
            changes[own] = _changed(changes.get(own, getattr(self, own)), inner, value) if inner else value
        return replace(self, **changes)  # type: ignore[type-var]


def _names(parameters: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(parameters))


def _copy(value: Any) -> Any:
    if isinstance(value, Parameters):
        return value.__sklearn_clone__()
    return tuple(map(_copy, value)) if isinstance(value, tuple) else value


def _nested(name: str, value: Any) -> dict[str, Any]:
    if isinstance(value, Parameters):
        return {f"{name}__{inner}": part for inner, part in value.get_params().items()}
    parameters: dict[str, Any] = {}
    if isinstance(value, tuple):
        for i, part in enumerate(value):
            parameters |= {f"{name}__{i}": part} | _nested(f"{name}__{i}", part)
    return parameters


def _changed(value: Any, name: str, new: Any) -> Any:
    """`value` with the parameter `name` inside it set to `new`."""
    if isinstance(value, Parameters):
        return value._with_parameters({name: new})
    index, _, inner = name.partition("__")
    if not (isinstance(value, tuple) and index.isdecimal() and int(index) < len(value)):
        raise SpecificationError(f"expected a kernel with the parameter {name!r}, got {value!r}")
    i = int(index)
    return (*value[:i], _changed(value[i], inner, new) if inner else new, *value[i + 1 :])


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
        """Refuse a width whose square leaves the range of `dtype`."""
        limits = np.finfo(dtype)
        for name in self._width_names():
            width = getattr(self, name)
            if not float(limits.tiny) <= width * width <= float(limits.max):
                raise SpecificationError(
                    f"expected {name} squared within the range of {dtype}, got {name} = {width:g}; "
                    "rescale the features or pass float64 rows"
                )

    def __post_init__(self) -> None:
        """Refuse widths that are not finite numbers above zero; the others become floats."""
        for name in self._width_names():
            value, default = getattr(self, name), getattr(type(self), name)
            hint = "leave it out to take it from the training rows" if default is None else f"the default is {default}"
            if value is None and default is None:
                continue
            try:
                number = float(value) if isinstance(value, Real) else math.nan
            except OverflowError:  # an integer beyond the range of floats
                number = math.inf
            if not math.isfinite(number) or number <= 0:
                raise SpecificationError(f"expected a finite {name} > 0, got {value!r}; {hint}")
            object.__setattr__(self, name, number)

    @classmethod
    def _width_names(cls) -> tuple[str, ...]:
        return tuple(field.name for field in fields(cls) if field.metadata.get("width"))  # type: ignore[arg-type]

    def _median_width(self, name: str, X: Rows) -> float:
        raise NotImplementedError(f"{type(self).__name__} has no rule for {name}")

    @abstractmethod
    def _fill(self, A: Rows, B: Rows | None, gram: Rows) -> None:
        """Write the Gram matrix of checked, non-empty rows; B None means A."""


def checked_pair(A: ArrayLike, B: ArrayLike | None) -> tuple[Rows, Rows | None]:
    """Check two sets of rows; B becomes None where both are one object, as scikit-learn calls: half of the work."""
    if B is None or B is A:
        return checked_rows(A, "A"), None
    A, B = checked_rows(A, "A"), checked_rows(B, "B")
    if A.shape[1] != B.shape[1]:
        raise SpecificationError(
            f"expected A and B with the same number of columns, got {A.shape[1]} and {B.shape[1]}; "
            "compute both with the same features"
        )
    dtype = np.result_type(A, B)
    return contiguous(A, dtype), contiguous(B, dtype)


def checked_rows(X: ArrayLike, name: str = "X") -> Rows:
    """Check rows (n, p), and return them read-only and C-contiguous; float32 stays, all else becomes float64."""
    rows = np.asarray(X)
    if rows.ndim != 2:
        raise SpecificationError(
            f"expected {name} to be two-dimensional (rows, features), got shape {rows.shape}; "
            "pass a single row x as x[np.newaxis], and to models of scikit-learn that call a kernel pair by pair, as "
            "KernelPCA does, kernel='precomputed' and the matrix kernel.fit(X)(X)"
        )
    if rows.shape[1] == 0:
        raise SpecificationError(f"expected {name} with at least one column, got shape {rows.shape}")
    if rows.dtype.kind not in "fiub":
        raise SpecificationError(f"expected {name} to hold real numbers, got dtype {rows.dtype}; convert it first")
    rows = contiguous(rows, rows.dtype if rows.dtype == np.float32 else np.dtype(np.float64))
    limit = float(np.sqrt(np.finfo(rows.dtype).max / rows.shape[1]) / 4)  # no squared distance overflows
    # min and max need no array of absolute values, and NaN fails both comparisons.
    if rows.size and not (rows.min() >= -limit and rows.max() <= limit):
        bad_rows, bad_columns = np.nonzero(~(np.abs(rows) <= limit))
        row, column, n_bad = bad_rows[0], bad_columns[0], len(np.unique(bad_rows))
        what = f"{rows[row, column]} in row {row}, column {column} of {name}"
        if np.isfinite(rows[row, column]):
            raise SpecificationError(
                f"expected values up to {limit:.3g} in {rows.dtype}, got {what}; rescale the features or pass float64"
            )
        raise SpecificationError(
            f"expected finite numbers, got {what} ({n_bad} such rows); repair or leave out these rows"
        )
    return rows


def contiguous(rows: Rows, dtype: np.dtype[np.floating]) -> Rows:
    """Read-only C-contiguous view or copy of `rows`: compiled loops need one signature per dtype instead of two."""
    view = np.ascontiguousarray(rows, dtype).view()
    view.flags.writeable = False
    return view
