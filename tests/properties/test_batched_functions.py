"""A batch equals its members one by one, in any order and company, compiled and plain."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from batched_functions import TABLE
from drawn_movements import any_movements, many_movements
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from kineme.errors import DegenerateMovementWarning
from soaking import SOAK, examples, slow

#: Numbers of one tile of work, set so small that every batch is many tiles, none of which begins where the batch does.
TILES = {
    "kineme.dmp.discrete.encode._TILE_SAMPLES": 700,
    "kineme.dmp.discrete.rollout._TILE_SAMPLES": 700,
    "kineme.movements.preparation.smooth._TILE_MOVEMENTS": 7,
    "kineme.similarity.describe._TILE_SAMPLES": 3000,
    "kineme.similarity.scores._TILE_PAIRS": 100,
    "kineme.recognition.early.evidence._TILE": 5000,
    "kineme.kernels.procrustes._PAIRS": 300,
    "kineme.kernels.pair_distances._TILE_PAIRS": 500,
    "kineme.kernels.pair_distances._TILE_BOUNDS": 500,
    "kineme.dmp.pose.tangent._TILE_SAMPLES": 400,
    "kineme.dmp.rhythmic.encode._TILE_SAMPLES": 700,
}


def _off(one, other):
    """By how much two results differ, in units of the larger of 1 and the largest number of each array."""
    assert one.keys() == other.keys()
    worst = 0.0
    for name, a in one.items():
        b = other[name]
        assert a.shape == b.shape, name
        if a.size:
            assert (np.isfinite(a) == np.isfinite(b)).all(), name
            worst = max(worst, float(np.abs(a.astype(float) - b).max() / max(1.0, np.abs(b).max())))
    return worst


#: Each kernel is compiled for single precision, for seconds; `make test` does so for one of them.
ROWS = [
    slow(row) if row.name.startswith("Gram") and "float32" in row.name and "rbf" not in row.name else row
    for row in TABLE
]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
@settings(max_examples=examples(1, 12), phases=(Phase.explicit, Phase.generate)[: 1 + SOAK])  # shrinking takes minutes
@example(drawn=any_movements(1), seed=1)
@given(drawn=many_movements, seed=st.integers(0, 10**6))
def test_a_batch_equals_its_members_one_by_one(row, drawn, seed):
    rng = np.random.default_rng(seed)
    batch = row.draw(drawn)
    order = rng.permutation(len(batch))
    some = order[: row.alone if SOAK else 4]
    results = {}
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("ignore", DegenerateMovementWarning)
        for choice in ("always", "never"):  # what is calibrated on first use takes seconds plain
            patch.setenv("KINEME_COMPILED", choice)
            results[choice] = row.call(batch)
            with pytest.MonkeyPatch.context() as tiles:
                for where, size in TILES.items():
                    tiles.setattr(where, size)
                results[f"shuffled {choice}"] = dict(zip(order.tolist(), row.call(batch[order]), strict=True))
            results[f"alone {choice}"] = {i: row.call(batch[[i]])[0] for i in some.tolist()}
    for name, result in results.items():
        for i in some.tolist():
            off = _off(result[i], results["alone never"][i])
            assert off <= row.tolerance, (name, i, drawn[i], off)
