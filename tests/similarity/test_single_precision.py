"""Movements are described for comparison in single precision, unless that would cost digits."""

import numpy as np
import pytest

import kineme
from kineme.kernels.procrustes import as_complex
from kineme.runtime.compiled import CHOICES
from kineme.similarity.describe import describe, describe_rows, describe_tile, feature_rows

EPS = float(np.finfo(np.float32).eps)


@pytest.mark.parametrize("scale", ["path", "per-dimension", "none"])
@pytest.mark.parametrize("choice", [choice for choice in CHOICES if choice != "auto"])
def test_rows_of_single_precision_are_close_to_those_of_double(choice, scale, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", choice)
    demos = kineme.load_lasa()[::5]
    how = kineme.Recognizer(scale=scale).specification
    described = describe_tile(demos, 0, len(demos), how, how.procrustes(2))
    assert len(described.blocks) == len(how.by_rows)
    for block, rows in zip(described.blocks, feature_rows(demos, how)[: len(how.by_rows)], strict=True):
        assert block.rows.dtype == np.complex64
        size = np.sqrt((rows**2).mean())
        assert np.abs(block.rows - as_complex(rows)).max() <= 100 * EPS * size  # widths are about two sizes


def test_movements_far_from_the_origin_keep_the_digits_of_their_forcing_term():
    demos = kineme.load_lasa()[::9]
    far = kineme.Demonstrations.from_arrays([one.positions + 1e5 for one in demos], times=[one.times for one in demos])
    how = kineme.Recognizer(translation=False).specification
    described = describe_tile(far, 0, len(far), how, how.procrustes(2))
    for block, rows in zip(described.blocks, feature_rows(far, how), strict=True):
        assert np.array_equal(block.rows, as_complex(rows.astype(np.float32)))


def test_rows_stored_in_single_precision_say_exactly_the_same():
    """The nearest point of a cloud, and so its distance, may jump with the last digit."""
    demos = kineme.load_lasa()[::9]
    how = kineme.Recognizer().specification
    stored = np.concatenate(feature_rows(demos, how), axis=1).astype(np.float32)
    back, given = describe_rows(stored, 2, how), describe(demos, how)
    for ours, theirs in ((back.pairs.shapes, given.pairs.shapes), (back.pairs.details, given.pairs.details)):
        for name, array in theirs.arrays().items():
            np.testing.assert_array_equal(ours.arrays()[name], array)
