"""Statistics of features, as LeRobot keeps them for each episode and for a whole data set."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

_QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}

Statistics = dict[str, list[Any]]  # min, max, mean, std, count and quantiles, a number for each entry


def statistics_of(values: NDArray[Any]) -> Statistics:
    """Statistics of one feature over the frames of an episode, values of shape (T,) or (T, d)."""
    rows = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
    found = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0), "std": rows.std(axis=0)}
    quantiles = dict(zip(_QUANTILES, np.quantile(rows, list(_QUANTILES.values()), axis=0), strict=True))
    return {
        **{name: one.tolist() for name, one in found.items()},
        "count": [len(rows)],
        **{name: one.tolist() for name, one in quantiles.items()},
    }


def merged_statistics(first: Statistics | None, second: Statistics) -> Statistics:
    """Statistics of all frames from those of two parts; the quantiles are weighted means, as LeRobot takes them."""
    if first is None:
        return second
    a, b = ({name: np.asarray(values, dtype=np.float64) for name, values in one.items()} for one in (first, second))
    n = a["count"] + b["count"]
    share = b["count"] / n
    mean = a["mean"] + share * (b["mean"] - a["mean"])
    variance = (1 - share) * a["std"] ** 2 + share * b["std"] ** 2 + share * (1 - share) * (b["mean"] - a["mean"]) ** 2
    merged = {
        "min": np.minimum(a["min"], b["min"]), "max": np.maximum(a["max"], b["max"]), "mean": mean,
        "std": np.sqrt(variance),
    }  # fmt: skip
    merged |= {name: a[name] + share * (b[name] - a[name]) for name in _QUANTILES if name in a}
    return {**{name: one.tolist() for name, one in merged.items()}, "count": [int(n[0])]}
