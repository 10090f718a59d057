"""The column `annotation.motion` of version 2 of LeRobot, whose programs read texts but no lists of rows.

A frame holds the rows of its episode as one text: a list in JSON, with the fields of the rows of version 3.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kineme.errors import DataError
from kineme.io.lerobot.motions import OWN, ROLE, STYLE, Motion

COLUMN = "annotation.motion"
FEATURE = {"dtype": "string", "shape": [1], "names": None}


def text_type(schema: Any) -> Any:
    """The type of the column; a `DataError` if the shard has another of that name."""
    import pyarrow as pa

    kind = schema.field(COLUMN).type if COLUMN in schema.names else pa.string()
    if kind not in (pa.string(), pa.large_string()):
        raise DataError(f"expected texts in {COLUMN}, got {kind}")
    return kind


def text_leaves(kind: Any) -> list[str]:
    """Paths of the parts of the column in a Parquet file."""
    return [COLUMN]


def with_texts(old: Any, motions: Sequence[Sequence[Motion]], episode_of: NDArray[np.intp], kind: Any) -> Any:
    """The column of some rows, see `kineme.io.lerobot.language.with_language`."""
    import pyarrow as pa

    known, text_of = [""], np.zeros(len(episode_of), dtype=np.intp)
    if old is not None:
        coded = old.dictionary_encode()
        known = [text or "" for text in coded.dictionary.to_pylist()] + [""]
        text_of = coded.indices.fill_null(len(known) - 1).to_numpy(zero_copy_only=False).astype(np.intp)
    both, which = np.unique(np.column_stack((text_of, episode_of)), axis=0, return_inverse=True)
    texts = [json.dumps(_of_others(known[t]) + _rows(motions[e]), ensure_ascii=False) for t, e in both.tolist()]
    return pa.array(texts, kind).take(pa.array(which.ravel()))


def _of_others(text: str) -> list[Any]:
    """The rows of a text that are not of this package."""
    if not text:
        return []
    try:
        rows = json.loads(text)
    except (ValueError, RecursionError):
        rows = None
    if not isinstance(rows, list):
        raise DataError(f"expected lists in JSON in {COLUMN}, got {text[:40]!r}")
    return [one for one in rows if not (isinstance(one, dict) and str(one.get("content")).startswith(OWN))]


def _rows(motions: Sequence[Motion]) -> list[dict[str, Any]]:
    plain = {"role": ROLE, "style": STYLE, "camera": None, "tool_calls": None}
    return [{**plain, "content": one.content, "timestamp": one.start} for one in motions]
