"""Numbers of early recognition that its documentation states: each falls here if it is changed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sklearn.utils import Bunch

from kineme.comparison.widths import SHARE
from kineme.recognition.early.hypotheses import Hypotheses


def log_classes(*movements):
    """Evidence for one class of movements, each with its evidence at 40 values of progress, and for the unknown."""
    evidence = np.log(np.maximum(np.concatenate(movements), 1e-300))[None]
    one_class = Bunch(progress=np.arange(1, 41) / 40, first=np.array([0]), durations=np.ones(len(movements)))
    return Hypotheses.log_classes(one_class, evidence)[0]


def explains(n_progress):
    return np.where(np.arange(40) < n_progress, 1.0, 0.0)


def test_a_movement_explains_perfectly_at_one_of_twenty_values_of_progress():
    assert log_classes(explains(2))[0] == pytest.approx(0.0)
    assert log_classes(explains(4))[0] == pytest.approx(math.log(2))


def test_the_evidence_for_a_class_is_the_mean_over_its_movements():
    assert log_classes(explains(2), explains(0), explains(0))[0] == pytest.approx(-math.log(3))
    assert log_classes(explains(2), explains(2), explains(2))[0] == pytest.approx(0.0)


def test_the_unknown_is_as_far_as_an_impostor_and_a_little_less_likely():
    assert log_classes(explains(2))[1] == pytest.approx(-0.5 / SHARE**2 - 1.5)
