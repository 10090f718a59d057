"""The conventions of the diagnosis, against the equations written out."""

import numpy as np
import pytest

import kineme
from kineme_experiments.evaluation.neighbors import PaperFeatures
from kineme_experiments.paper import paper
from kineme_experiments.paper.representations import READINGS, REPRESENTATIONS, specification

PHASE = np.exp(np.log(0.01) * np.linspace(0, 1, paper.N_SAMPLES))


@pytest.fixture(scope="module")
def letters():
    return kineme.load_lasa(["CShape", "NShape"])


def rows(key, demos):
    return REPRESENTATIONS[key].rows(demos).reshape(len(demos), 2, -1)


def test_forcing_over_s_is_forcing_divided_by_the_phase(letters):
    np.testing.assert_allclose(rows("bio-f-over-s", letters) * PHASE, rows("bio-f", letters), rtol=1e-12)


def test_bracket_is_the_shape_attractor_divided_by_the_phase(letters):
    np.testing.assert_allclose(rows("bio-bracket", letters) * PHASE, rows("bio-sa", letters), rtol=1e-12)


def test_bracket_is_section_2_2_to_the_letter(letters):
    primitives = specification("bio-inspired").learn(letters)
    x = primitives.rollout(n_samples=paper.N_SAMPLES).positions.transpose(0, 2, 1)
    f = rows("bio-f", letters)
    literal = paper.STIFFNESS * (f / PHASE + primitives.starts[:, :, None] - x)
    np.testing.assert_allclose(rows("bio-bracket", letters), literal, rtol=1e-9, atol=1e-6)


def test_original_shape_attractor_is_amplitude_times_forcing(letters):
    primitives = specification("original").learn(letters)
    amplitude = (primitives.goals - primitives.starts)[:, :, None]
    np.testing.assert_allclose(rows("original-sa", letters), amplitude * rows("original-f", letters), rtol=1e-9)


def test_each_reading_has_one_representation_per_column():
    for keys in READINGS.values():
        cells = tuple((REPRESENTATIONS[key].formulation, REPRESENTATIONS[key].quantity) for key in keys)
        assert cells == paper.CELLS


def test_accuracies_of_the_paper_are_multiples_of_one_27th():
    printed = [*paper.NEAREST_NEIGHBOR.values(), *paper.SVM_RBF.values(), *paper.SVM_TRE.values()]
    off = [value for value in printed if abs(value * 27 - round(value * 27)) > 0.03]
    assert off == [0.144, 0.565]  # 0.148 and 0.556 with two digits swapped


@pytest.mark.parametrize("formulation", ["original", "bio-inspired"])
def test_the_specification_is_the_papers_whatever_the_default_is(formulation):
    """Section 4.2: the forcing term, fitted by local regression with 80 basis functions at K = 100."""
    dmp = specification(formulation)
    assert (dmp.fit, dmp.regression, dmp.n_basis, dmp.K, dmp.n_points) == ("forcing", "local", 80, 100.0, 150)
    compared = PaperFeatures(formulation, "forcing").features.dmp
    assert (compared.fit, compared.regression, compared.n_basis, compared.K) == ("forcing", "local", 80, 100.0)
