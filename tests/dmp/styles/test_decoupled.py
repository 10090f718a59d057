"""The decoupled formulation: when the goal takes over, and that it does."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP
from kineme.dmp.discrete.operators import decoder
from kineme.dmp.discrete.specification import FORMULATIONS, HANDOVER, late_shape_weight


def test_the_shape_weight_is_a_logistic_curve_in_time_from_1_to_0():
    u = np.linspace(0, 3, 301)
    alpha = DMP().basis.phase.alpha
    logistic = 1 / (1 + np.exp(3 * alpha * (u - np.log(1 / HANDOVER) / alpha)))
    weight = late_shape_weight(np.exp(-alpha * u))
    np.testing.assert_allclose(weight, logistic / logistic[0], rtol=1e-12)
    assert (np.diff(weight) < 0).all()
    assert late_shape_weight(np.array([1.0, 0.0])).tolist() == [1.0, 0.0]
    assert weight[35] == pytest.approx(0.5, abs=0.01)  # at 35 % of the time


def test_the_goal_acts_later_than_in_the_other_formulations_and_wins_in_all():
    """Share of g - x0 covered at 30 % of the duration, at its end and long after, when nothing else acts."""
    response = {name: decoder(DMP(name), 61, 3.0) for name in FORMULATIONS}
    share = {name: one.goal[0] for name, one in response.items()}
    assert share["decoupled"][6] < 0.5 * share["bio-inspired"][6] < 0.5 * share["original"][6]
    assert share["decoupled"][20] > share["bio-inspired"][20] > 0.96
    assert np.abs(response["decoupled"].goal[2]).max() < np.abs(response["bio-inspired"].goal[2]).max()
    for goal in share.values():
        assert goal[-1] == pytest.approx(1.0, abs=1e-4)


def test_the_docstring_says_how_far_a_change_of_the_goal_has_gone_through():
    said = " ".join(late_shape_weight.__doc__.split())
    shares = {name: decoder(DMP(name), 101, 1.0).goal[0] for name in ("decoupled", "bio-inspired")}
    at_30, of_30, at_40, of_40, at_end, of_end = (
        round(100 * float(share[k])) for k in (30, 40, 100) for share in shares.values()
    )
    assert (
        f"to {at_30} % at 30 % of the time, against {of_30} % in Eq. (4), to {at_40} % at 40 % of the time, "
        f"against {of_40} %, and to {at_end} % at the end, against {of_end} %"
    ) in said


def test_a_new_goal_changes_the_first_third_of_a_movement_less(make_movement):
    x = make_movement(41)[1]
    change = {}
    for name in ("bio-inspired", "decoupled"):
        learned = DMP(name, n_basis=20).learn([x])
        moved = learned.rollout(goal=x[-1] + 1.0, n_samples=91).positions - learned.rollout(n_samples=91).positions
        change[name] = np.abs(moved[0, :31]).mean()
        np.testing.assert_allclose(moved[0, -1], 1.0, atol=0.04)
    assert change["decoupled"] < 0.35 * change["bio-inspired"]


@pytest.mark.parametrize("phase_end", [0.5, 1e-2, 1e-6])
def test_no_vanishing_weight_is_divided_by(make_movement, phase_end):
    x = make_movement(42, n_samples=80)[1]
    learned = DMP("decoupled", n_basis=20, phase_end=phase_end, fit="trajectory").learn([x])
    plain = DMP("bio-inspired", n_basis=20, phase_end=phase_end, fit="trajectory").learn([x])
    assert np.abs(learned.weights).max() < 5 * np.abs(plain.weights).max()
    away = learned.rollout(n_samples=80).positions[0] - x
    assert np.abs(away).max() < 0.02 * np.ptp(x)
