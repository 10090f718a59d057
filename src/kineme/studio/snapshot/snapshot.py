"""A library, or a fitted recognizer, as plain data and arrays that a browser computes with."""

from __future__ import annotations

import json
from base64 import b64encode
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMAT, VERSION = "kineme-snapshot", 1
_KINDS = ("float64", "float32", "int32")
_ALIGNMENT = 8  # bytes: arrays in JavaScript begin at multiples of the size of their numbers


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What the runtime in `kineme.studio.javascript` computes with.

    Attributes
    ----------
    header : dict
        JSON data: names, specification, widths, weights.
    arrays : dict from str to ndarray
        Of float64, float32 or int32.
    """

    header: dict[str, Any]
    arrays: dict[str, NDArray[Any]]

    def to_json(self) -> str:
        """One JSON document: the header, where each array is, and all of them as one block of bytes in base64.

        No ``<`` is left in it, so that it can stand in a script element of a page.
        """
        places, block = {}, bytearray()
        for name, array in self.arrays.items():
            if array.dtype.name not in _KINDS:
                raise ValueError(f"expected arrays of {', '.join(_KINDS)}, got {name} of {array.dtype}")
            places[name] = [array.dtype.name, len(block), array.size]
            block += np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).tobytes()
            block += bytes(-len(block) % _ALIGNMENT)
        document = {"format": FORMAT, "version": VERSION, **self.header, "arrays": places}
        document["data"] = b64encode(block).decode()
        return json.dumps(document, allow_nan=False, separators=(",", ":")).replace("<", r"\u003c")
