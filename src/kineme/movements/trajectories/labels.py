"""Labels of movements, an array of str objects or of numbers, never both; and indices of movements out of n."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Number
from typing import Any
from unicodedata import normalize

import numpy as np
from numpy.typing import NDArray

from kineme.errors import TrajectoryError
from kineme.validation import describe

_WAYS = "an index, a slice, a list of indices or a mask with an entry per movement"

#: What names the action of a movement.
Label = str | int | float

_NUMBERS = (Number, np.bool_)
_ADVICE = "name the action, or leave the movement out"


def label_array(labels: Any, n: int | None = None, names: Sequence[str | None] | None = None) -> NDArray[Any]:
    """One label per movement as an array of shape (n,); names of the movements are for messages.

    Numbers stay numbers. Texts become objects, plain `str`: in an array of fixed width each would be as large as the
    longest, and labels that differ in trailing NULs would be one.
    """
    if not isinstance(labels, np.ndarray):  # `np.asarray` of a list would convert numbers beside texts to texts
        labels = np.asarray(labels) if hasattr(labels, "__array__") else np.array(labels, dtype=object)
    array: NDArray[Any] = labels
    if array.ndim != 1 or (n is not None and len(array) != n):
        many = "each movement" if n is None else "the one movement" if n == 1 else f"each of the {n} movements"
        raise TrajectoryError(
            f"expected one label for {many}, got labels of shape {array.shape}"
            + ("; one array (T, d) is one movement: pass many as a list or as one array (n, T, d)" if n == 1 else "")
        )
    present = array.tolist() if array.dtype.kind in "USTOfc" else []  # other dtypes have no missing values
    kinds = set(map(type, present))
    if kinds == {str}:
        return _objects(present)
    _check_each(present, names)
    if kinds and issubclass(next(iter(kinds)), str):
        return _objects([str.__str__(label) for label in present])  # str itself, not a subclass
    if array.dtype != object:
        return array.copy()
    if not present or not isinstance(present[0], _NUMBERS):
        return _objects(present)
    numbers = np.array(present)
    # NumPy makes floats of whole numbers above the signed ones beside smaller ones, as hashes are.
    are_rounded = numbers.dtype.kind == "f" and all(isinstance(label, (int, np.integer)) for label in present)
    return _objects(list(map(int, present))) if are_rounded else numbers


def spelled_alike(labels: NDArray[Any]) -> NDArray[Any]:
    """Return labels; texts that look the same, composed or not, are spelled as the first of them."""
    if labels.dtype != object or not len(labels) or not isinstance(labels[0], str):
        return labels
    first: dict[str, str] = {}
    spelled = {label: first.setdefault(normalize("NFC", label), label) for label in dict.fromkeys(labels.tolist())}
    return _objects([spelled[label] for label in labels.tolist()])


def _objects(texts: Sequence[Any]) -> NDArray[Any]:
    array = np.empty(len(texts), dtype=object)
    array[:] = texts
    return array


def _check_each(labels: Sequence[Any], names: Sequence[str | None] | None) -> None:
    """Refuse the first label that is missing, neither text nor number, or of another kind than the first."""
    for i, label in enumerate(labels):
        if label is None:
            raise TrajectoryError(
                f"expected a label on every movement or on none, got none on {describe(i, names)}; "
                f"expected text or a number, got None; {_ADVICE}"
            )
        if isinstance(label, _NUMBERS) and label != label:  # noqa: PLR0124 - only NaN differs from itself
            raise TrajectoryError(f"{describe(i, names)}: expected a label, got {label!r}, which names none; {_ADVICE}")
        if _kind(label) != _kind(labels[0]):
            raise TrajectoryError(
                f"{describe(i, names)}: expected labels that are all texts or all numbers, got {label!r} beside "
                f"{labels[0]!r}; pass [str(label) for label in labels]"
            )


def _kind(label: Any) -> str:
    return "text" if isinstance(label, str) else "number" if isinstance(label, _NUMBERS) else "other"


def as_indices(index: Any, n: int) -> NDArray[np.intp]:
    """Return an integer as an index from 0 of shape (), a slice, a list of integers or a mask as indices (k,)."""
    if isinstance(index, (bool, np.bool_)):  # as ("a", "b") == "a" is
        raise IndexError(f"expected {_WAYS}, got {index}; compare an array, numpy.array(labels) == label")
    if isinstance(index, (int, np.integer)):
        if not -n <= index < n:
            raise IndexError(f"expected an index below {n}, got {index}; there are {n} movements, counted from 0")
        return np.asarray(int(index) % n)
    if isinstance(index, slice):
        return np.arange(n)[index]
    array = np.asarray(index)
    if isinstance(index, tuple) or array.ndim != 1 or (array.dtype.kind not in "iub" and array.size):
        raise IndexError(f"expected {_WAYS}, got {index!r}")
    if array.dtype.kind == "b" and len(array) != n:
        raise IndexError(f"expected a mask with an entry for each of the {n} movements, got {len(array)} entries")
    chosen = np.flatnonzero(array) if array.dtype.kind == "b" else array.astype(np.intp)
    outside = (chosen < -n) | (chosen >= n)
    if outside.any():
        raise IndexError(
            f"expected indices below {n}, got {chosen[outside][0]}; there are {n} movements, counted from 0"
        )
    return chosen % n
