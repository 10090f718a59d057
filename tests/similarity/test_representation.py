"""Representations where position or size distinguishes movements."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import Demonstrations, Recognizer
from kineme.similarity.describe import describe, squared_distances
from kineme.similarity.specification import (
    DEFAULT_REPRESENTATIONS,
    ROW_REPRESENTATIONS,
    Normalization,
    default_representations,
)
from movement_samples import draw_shapes


@pytest.mark.parametrize("scale", ["path", "per-dimension", "none"])
@pytest.mark.parametrize("translation", [True, False])
def test_what_is_compared_pair_by_pair_knows_the_shape_alone(scale, translation):
    shape_alone = translation and scale != "none"
    expected = DEFAULT_REPRESENTATIONS if shape_alone else ROW_REPRESENTATIONS
    assert default_representations(Normalization(translation, scale)) == expected
    assert Recognizer(translation=translation, scale=scale).specification.representations == expected


def test_where_position_counts_it_counts_in_every_representation():
    demos = draw_shapes([1] * 3)
    moved = Demonstrations.from_arrays(
        [one.positions + 5.0 for one in demos], demos.labels, [one.times for one in demos]
    )
    for translation, least, most in ((False, 1.0, np.inf), (True, 0.0, 1e-2)):
        one, other = (describe(each, Recognizer(translation=translation, max_angle=0)) for each in (demos, moved))
        squares = squared_distances(one, other)[:, np.arange(3), np.arange(3)]
        assert (squares >= least).all()
        assert (squares <= most).all()
