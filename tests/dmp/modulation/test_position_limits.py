"""Positions within limits, over every formulation, gating and fit."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import DMP
from kineme.dmp.discrete.specification import FORMULATIONS, GATINGS
from kineme.dmp.spring_damper import FITS
from kineme.errors import SpecificationError
from soaking import combined


@pytest.fixture(scope="module")
def learned():
    return DMP().learn(kineme.load_lasa(["GShape"]))


@pytest.mark.parametrize(("formulation", "gating", "fit"), combined(FORMULATIONS, GATINGS, FITS, together=1))
def test_no_sample_is_outside_and_the_ends_stay(formulation, gating, fit):
    primitives = DMP(formulation, gating=gating, fit=fit, n_basis=30).learn(kineme.load_lasa(["GShape"])[:3])
    box = ([-18.0, -17.0], [30.0, np.inf])
    point = primitives.rollout(n_samples=11).positions[:, 8] - 1.0
    path = primitives.rollout(via=[(0.8, point)], position_limits=box)
    assert primitives.rollout().positions[:, :, 0].min() < -19
    slack = 1e-6 * primitives.extents.max()
    assert (path.positions >= np.array(box[0]) - slack).all()
    assert (path.positions <= np.array(box[1]) + slack).all()
    finer = primitives.rollout(via=[(0.8, point)], position_limits=box, n_samples=11).positions
    np.testing.assert_allclose(finer[:, 8], point, atol=slack)
    np.testing.assert_allclose(path.positions[:, -1], primitives.goals, atol=slack)
    np.testing.assert_allclose(path.velocities[:, 0], primitives.velocities, atol=slack)


def test_the_change_is_the_smoothest_there_is(learned):
    """Not more than the limits ask for: via points at the touched samples alone give the same path."""
    fine = 16 * 199 + 1
    inside = learned[0].rollout(position_limits=(-17.0, np.inf), n_samples=fine).positions[0]
    x = inside[:, 0]
    touched = np.flatnonzero((x[1:-1] <= np.minimum(x[:-2], x[2:])) & np.isclose(x[1:-1], -17.0, atol=1e-4)) + 1
    via = [(k / (fine - 1), [x[k], np.nan]) for k in touched]
    assert len(via) > 0
    np.testing.assert_allclose(learned[0].rollout(via=via, n_samples=fine).positions[0, :, 0], x, atol=1e-3)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_limits_are_kept_between_samples(formulation):
    """Fifty times as many samples as it was asked for are inside, to a millionth."""
    primitives = DMP(formulation).learn(kineme.load_lasa(["GShape"])[:2])
    dense = primitives.rollout(position_limits=([-18.0, -17.0], [30.0, np.inf]), n_samples=10_000).positions
    assert dense[:, :, 0].min() >= -18.0 * (1 + 1e-6)
    assert dense[:, :, 1].min() >= -17.0 * (1 + 1e-6)
    assert dense[:, :, 0].max() <= 30.0 * (1 + 1e-6)


def test_a_path_that_leaves_the_limits_only_between_its_samples_is_kept_inside(learned):
    path = learned[0].rollout(via=[]).positions[0, :, 0]
    dense = learned[0].rollout(via=[], n_samples=10_000).positions[0, :, 0]
    limit = (path.min() + dense.min()) / 2
    assert dense.min() < limit * (1 + 1e-5) < path.min() < 0
    made = learned[0].rollout(position_limits=([limit, -np.inf], np.inf), n_samples=10_000).positions[0, :, 0]
    assert made.min() >= limit * (1 + 1e-6)


def test_a_path_that_passes_a_limit_above_only_between_its_samples_is_kept_inside(learned):
    path = learned[0].rollout(via=[]).positions[0]
    dense = learned[0].rollout(via=[], n_samples=10_000).positions[0]
    k = int(np.argmax(dense.max(axis=0) - path.max(axis=0)))
    limit = (path[:, k].max() + dense[:, k].max()) / 2
    assert path[:, k].max() < limit - 1e-5 < dense[:, k].max() - 1e-5
    high = np.where(np.arange(2) == k, limit, np.inf)
    made = learned[0].rollout(position_limits=(-np.inf, high), n_samples=10_000).positions[0, :, k]
    assert made.max() <= limit + 1e-5


def test_a_stretch_of_more_points_than_can_be_met_stays(learned):
    plain = learned[0].rollout().positions[0]
    via = [((160 / 199, 189 / 199), plain[160:190])]
    free = learned[0].rollout(via=via).positions[0]
    inside = learned[0].rollout(via=via, position_limits=([-30.0, -17.0], [20.0, 40.0])).positions[0]
    assert free[:, 1].min() < -19.0
    assert inside[:, 1].min() > -17.0 - 1e-6
    np.testing.assert_allclose(inside[160:190], free[160:190], atol=1e-4)


def test_a_free_dimension_of_a_via_point_is_not_held(learned):
    plain = learned[0].rollout(n_samples=101).positions[0]
    k = int(np.argmin(plain[:, 0]))
    via = [(k / 100, [np.nan, plain[k, 1] + 2.0])]
    path = learned[0].rollout(via=via, position_limits=([-17.0, -40.0], [30.0, 40.0]), n_samples=101).positions[0]
    assert path[:, 0].min() > -17.0 - 1e-2
    np.testing.assert_allclose(path[k, 1], plain[k, 1] + 2.0, atol=1e-9)


def test_movements_inside_are_as_they_were(learned):
    wide = learned.rollout(position_limits=(-100.0, 100.0)).positions
    np.testing.assert_allclose(wide, learned.rollout(via=[]).positions, atol=1e-12)
    mixed = learned.rollout(position_limits=(-24.0, 100.0)).positions
    for i in (0, 6):
        alone = learned[i].rollout(position_limits=(-24.0, 100.0)).positions[0]
        np.testing.assert_allclose(mixed[i], alone, atol=1e-9)


def test_the_controller_stays_inside(learned):
    controller = learned[0].controller(learned.durations[0] / 199, position_limits=(-17.0, 30.0))
    positions = [controller.step().position for _ in range(199)]
    assert np.min(positions) >= -17.0 - 1e-4


@pytest.mark.parametrize(
    ("limits", "match"),
    [
        ((-15.0, 100.0), r"expected the via points within the position limits, got -20 in dimension 0 of movement 0"),
        ((-22.0, 13.0), r"expected the start within"),
        ((13.0, 100.0), r"expected the (start|goal) within the position limits, got"),
        ((1.0, -1.0), "low below high"),
        (3.0, r"position_limits=\(low, high\)"),
        (([1.0, 2.0, 3.0], 4.0), r"position_limits=\(low, high\)"),
        ((np.nan, 1.0), "low below high"),
    ],
)
def test_limits_that_cannot_be(learned, limits, match):
    with pytest.raises(SpecificationError, match=match):
        learned[0].rollout(via=[(0.3, [-20.0, 0.0])], position_limits=limits)


def test_a_movement_that_cannot_stay_inside():
    few = DMP(n_basis=4).learn(kineme.load_lasa(["GShape"]))
    with pytest.raises(SpecificationError, match=r"can stay between -1 and 15 in dimension \d, movement 0 cannot"):
        few[0].rollout(position_limits=(-1.0, 15.0))
