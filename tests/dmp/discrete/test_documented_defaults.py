"""Numbers that the documentation gives for primitives: each falls here if it is changed."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from click.testing import CliRunner

import kineme
from kineme import DMP, DMPFeatures, RhythmicDMP
from kineme.cli import main
from kineme.dmp.batch import specification_from_dict, specification_to_dict
from kineme.errors import DegenerateMovementError, DegenerateMovementWarning
from kineme.library.storage.specification import Specification
from kineme.orientation import PoseDMP


def test_the_path_is_fitted_with_forty_functions():
    """The choice of ``python -m bench --only dmp_defaults``; docs/guide/moving-again.md has the others."""
    assert DMP() == DMP("bio-inspired", fit="trajectory", n_basis=40)
    assert PoseDMP().dmp == Specification().dmp == DMPFeatures().fit([np.eye(5)]).dmp_ == DMP()
    assert RhythmicDMP().fit == DMP().fit


def test_the_command_line_takes_the_same(tmp_path):
    u = np.linspace(0.0, 1.0, 50)
    np.savetxt(tmp_path / "x.csv", np.column_stack((u, np.sin(u), u**2)), delimiter=",", header="t,x,y", comments="")
    files = {name: str(tmp_path / name) for name in ("x.csv", "x.kineme", "y.csv")}
    arguments = ["generate", files["x.csv"], "--save", files["x.kineme"], "-o", files["y.csv"]]
    assert CliRunner().invoke(main, arguments).exit_code == 0
    assert kineme.dmp.Primitives.load(tmp_path / "x.kineme").dmp == DMP()


def test_what_is_saved_names_every_field():
    """A file opens with the specification that it was learned with, whatever the defaults are by then."""
    saved = specification_to_dict(DMP(fit="forcing", n_basis=80))
    assert list(saved) == [field.name for field in fields(DMP)]
    assert specification_from_dict(DMP, saved) == DMP(fit="forcing", n_basis=80)


def test_the_numbers_of_the_paper_are_the_defaults():
    """Centers even in time, K = 100, critical damping, s(tau) = 0.01; neighbors overlap by 0.3."""
    dmp = DMP(fit="forcing", n_basis=80)
    assert (dmp.K, dmp.D, dmp.n_points) == (100.0, 20.0, 200)
    assert dmp.basis.phase(np.ones(1))[0] == pytest.approx(0.01)
    np.testing.assert_allclose(dmp.basis.centers, 0.01 ** np.linspace(0.0, 1.0, 80))
    at_centers = np.exp(dmp.basis.exponents(np.linspace(0.0, 1.0, 80)))
    np.testing.assert_allclose(np.diagonal(at_centers, -1), 0.3)


def _gone_through(formulation, u):
    """Share of a change of the goal that is seen in the path after the share u of the time."""
    demo = kineme.load_lasa(["GShape"])[0]
    primitive = DMP(formulation).learn([demo])[0]
    change = np.array([7.0, -3.0])
    goals = primitive.goals + np.outer([0.0, 1.0], change)
    plain, changed = primitive.rollout(goal=goals, n_samples=1001).positions
    return float(((changed - plain) / change)[round(1000 * u), 0])


def test_the_decoupled_goal_acts_late_and_arrives():
    """Of a change of the goal 20 % are seen at 40 % of the time, against 56 % in Eq. (4); at the end 98 %."""
    assert _gone_through("decoupled", 0.4) == pytest.approx(0.20, abs=0.01)
    assert _gone_through("bio-inspired", 0.4) == pytest.approx(0.56, abs=0.01)
    assert _gone_through("decoupled", 1.0) == pytest.approx(0.98, abs=0.005)
    assert _gone_through("bio-inspired", 1.0) == pytest.approx(0.97, abs=0.005)


@pytest.mark.parametrize(("share", "ratio"), [(0.04, 1.0), (0.07, 2.0)])
def test_a_movement_that_ends_within_a_twentieth_of_its_extent_keeps_its_size(share, ratio):
    u = np.linspace(0.0, 1.0, 100)
    x = np.column_stack((np.sin(np.pi * u) + share * u, np.zeros(100)))
    primitive = DMP("amplitude-scaled").learn([x])[0]
    made = primitive.rollout(goal=primitive.starts[0] + 2.0 * (primitive.goals[0] - primitive.starts[0]))
    np.testing.assert_allclose(made.ratio, ratio, rtol=1e-6)


def test_almost_closed_is_warned_of_within_a_hundredth():
    primitives = DMP("original").learn([_almost_closed(0.02)])
    assert np.isfinite(primitives.weights).all()
    with pytest.warns(DegenerateMovementWarning):
        _ = DMP("original").learn([_almost_closed(0.005)]).weights
    with pytest.raises(DegenerateMovementError):
        _ = DMP("original").learn([_almost_closed(0.0)]).weights


def _almost_closed(share):
    u = np.linspace(0.0, 1.0, 100)
    return np.column_stack((np.sin(np.pi * u) + share * u, u))
