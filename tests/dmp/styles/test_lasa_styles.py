"""Real handwriting: names under which two kinds of movement were recorded."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP, load_lasa
from kineme.styles import average, learn_styles

MIXED = {"Multi_Models_2": 4, "Multi_Models_3": 4, "Multi_Models_4": 4}  # name -> movements of its first style


def reconstruction_error(learned, n_styles):
    """Root mean square distance between path and reconstruction, mean over movements, in largest extents."""
    model = learn_styles(learned, n_styles)
    away = model.primitive(model.styles).rollout().positions - learned.rollout().positions
    distance = np.sqrt(np.mean(np.sum(away**2, axis=2), axis=1))
    return np.mean(distance / learned.extents.max(axis=1))


@pytest.mark.parametrize("shape", MIXED)
def test_few_styles_reconstruct_many_movements(shape):
    learned = DMP().learn(load_lasa([shape]))
    errors = [reconstruction_error(learned, n_styles) for n_styles in (1, 2, 4, 6)]
    assert (np.diff(errors) < 0).all()
    assert (np.array(errors) < [0.075, 0.055, 0.03, 1e-9]).all()


@pytest.mark.parametrize("shape", MIXED)
def test_the_first_style_tells_the_two_styles_apart(shape):
    model = learn_styles(DMP().learn(load_lasa([shape])), 1)
    ordered = np.sort(model.styles[:, 0])
    widest = int(np.argmax(np.diff(ordered)))
    second = model.styles[:, 0] > ordered[widest]
    assert model.explained_variance[0] > 0.95
    assert len(set(second[: MIXED[shape]])) == len(set(second[MIXED[shape] :])) == 1
    assert second[0] != second[-1]


def test_a_held_out_letter_lies_in_the_band_of_the_others():
    """Seven Gs: each is within three deviations of the average of the other six nearly everywhere."""
    inside = []
    learned = DMP().learn(load_lasa(["GShape"]))
    for i in range(7):
        others = average(learned[np.arange(7) != i])
        away = np.abs(learned[i].rollout().positions - others.primitive.rollout().positions)[0]
        inside.append(np.mean(away <= 3 * others.deviation(learned.dmp.n_points) + 1e-9))
    assert min(inside) > 0.85
    assert np.mean(inside) > 0.95
