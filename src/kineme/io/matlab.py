"""MATLAB files as LASA's: a list ``demos`` of structures with ``pos`` (d, T) and ``t`` (1, T)."""

from __future__ import annotations

import io
import warnings
from typing import Any, NamedTuple

import numpy as np

from kineme.errors import DataError
from kineme.validation import Array


class Demos(NamedTuple):
    """Times (T,) and positions (T, d) of each demonstration, and the name that the file gives them, if any."""

    times: list[Array]
    positions: list[Array]
    name: str | None


def read_demos(data: bytes) -> Demos:
    """Read all demonstrations of a MATLAB file of version 5 to 7.2.

    Raises
    ------
    DataError
        Not such a file, or damaged, or without ``demos``; SciPy's reader raises many kinds on these.
    """
    from scipy.io import loadmat

    if data[:8] == b"\x89HDF\r\n\x1a\n" or data[:10] == b"MATLAB 7.3":
        raise DataError("expected a MATLAB file of version 7.2 or earlier, got 7.3; save it with -v7")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)
        demos = [_arrays(one) for one in np.atleast_1d(content["demos"])]
    except Exception as error:
        raise DataError(f"expected a MATLAB file with 'demos', got {error!r}") from error
    name = content.get("name")
    return Demos([t for t, _ in demos], [x for _, x in demos], name if isinstance(name, str) and name else None)


def _arrays(demo: Any) -> tuple[Array, Array]:
    t, x = np.array(demo.t, dtype=float), np.array(demo.pos, dtype=float)
    x = x[:, None] if x.ndim == 1 else x.T
    if t.ndim != 1 or x.ndim != 2 or len(t) != len(x):
        raise ValueError(f"t of shape {t.shape} and pos of shape {x.T.shape}")
    return t, x
