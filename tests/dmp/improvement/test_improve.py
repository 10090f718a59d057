"""Policy improvement: what stays, what gets better, how soon, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import DMP, improve
from kineme.dmp.discrete.operators import decoder
from kineme.dmp.improve import METHODS, Search, exploration_factor
from kineme.errors import SpecificationError

U = np.linspace(0.0, 1.0, 100)
MIDDLE = 0.5


def reach(dmp):
    """From (0, 0) to (1, 0.5), curved."""
    return dmp.learn([np.column_stack((U + 0.1 * np.sin(2 * np.pi * U), 0.5 * U**2))])


def far_from(point):
    """Distance from a point at half the time."""

    def cost(rollout):
        return np.linalg.norm(rollout.positions[:, rollout.n_samples // 2] - point, axis=1)

    return cost


@pytest.mark.parametrize("method", METHODS)
def test_start_and_goal_stay_and_the_point_is_met(dmp, method):
    primitive = reach(dmp)
    before = primitive.rollout(n_samples=201)
    point = before.positions[0, 100] + [0.1, 0.3]
    found = improve(primitive, far_from(point), method=method, target=0.01, n_samples=201)
    after = found.primitive.rollout(n_samples=201)
    assert np.linalg.norm(after.positions[0, 100] - point) <= 0.01 < found.costs[0, 0]
    for there in (0, -1):
        np.testing.assert_allclose(after.positions[0, there], before.positions[0, there], atol=1e-8)
        np.testing.assert_allclose(after.velocities[0, there], before.velocities[0, there], atol=1e-6)
    np.testing.assert_array_equal(found.primitive.goals, primitive.goals)
    assert found.cost == found.costs.min() == pytest.approx(np.linalg.norm(after.positions[0, 100] - point))
    assert found.stopped.startswith("a cost of")


def test_a_via_point_is_reached_within_so_many_rollouts():
    """Fifteen points at 30 % of the extent from the path: within 300 rollouts each to 1 % of the extent."""
    primitive = kineme.DMP().learn(kineme.load_lasa(["CShape"]))[0]
    extent, x = primitive.extents.max(), primitive.rollout().positions[0, 100]
    used = {}
    for method in METHODS:
        used[method] = []
        for seed in range(15):
            angle = 2.4 * seed
            cost = far_from(x + 0.3 * extent * np.array([np.cos(angle), np.sin(angle)]))
            found = improve(primitive, cost, method=method, seed=seed, target=0.01 * extent)
            assert found.cost <= 0.01 * extent
            used[method].append(found.costs.size)
        assert max(used[method]) <= 300
        assert np.median(used[method]) <= 160


def test_equal_seeds_give_equal_results_and_others_do_not():
    primitive, cost = reach(DMP()), far_from([0.5, 0.5])
    one, same, other = (improve(primitive, cost, updates=5, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.costs, same.costs)
    np.testing.assert_array_equal(one.primitive.scaled_weights, same.primitive.scaled_weights)
    assert not np.array_equal(one.costs, other.costs)
    again = improve(primitive, cost, updates=5, seed=np.random.default_rng(3))
    np.testing.assert_array_equal(again.costs, one.costs)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_unit_does_not_matter(unit):
    small = DMP().learn([unit * reach(DMP()).rollout().positions[0]])
    one = improve(reach(DMP()), far_from([0.5, 0.5]), updates=5)
    other = improve(small, far_from(unit * np.array([0.5, 0.5])), updates=5)
    np.testing.assert_allclose(other.costs / unit, one.costs, rtol=1e-3)


def test_history_and_the_first_variant_of_each_batch():
    primitive = reach(DMP())
    batches = []

    def cost(rollout):
        batches.append(rollout.positions)
        return far_from([0.5, 0.5])(rollout)

    found = improve(primitive, cost, rollouts=8, updates=6)
    assert found.costs.shape == (6, 8)
    assert len(found.exploration) == len(found.best) == 6
    assert (np.diff(found.best) <= 0).all()
    np.testing.assert_allclose(batches[0][0], primitive.rollout().positions[0], atol=1e-12)
    assert found.exploration[0] == pytest.approx(0.1)
    assert np.ptp(batches[0], axis=0).max() < 6 * 0.1 * 1.2
    assert found.stopped == "6 updates"
    tiny = improve(primitive, cost, updates=80, method="pi-bb", smallest=0.05)
    assert len(tiny.costs) < 20
    assert "less than 0.05" in tiny.stopped


def test_another_goal_is_passed_on():
    primitive = reach(DMP())
    ends = []

    def cost(rollout):
        ends.append(rollout.positions[:, -1])
        return far_from([0.5, 0.5])(rollout)

    improve(primitive, cost, updates=2, goal=[2.0, 1.0], start=[0.1, 0.1], duration=3.0, n_samples=50)
    np.testing.assert_allclose(np.ptp(np.concatenate(ends), axis=0), 0.0, atol=1e-8)
    assert np.linalg.norm(ends[0][0] - [2.0, 1.0]) < 0.1


def test_exploration_is_smooth_in_acceleration_and_vanishes_at_the_end():
    dmp = DMP()
    response = decoder(dmp, dmp.n_points)
    F = exploration_factor(dmp)
    path, acceleration = (F @ response.Phi[k].T for k in (0, 2))
    deviation = np.linalg.norm(path, axis=0)
    assert deviation.max() == pytest.approx(1.0)
    assert deviation[0] == 0.0
    assert deviation[-1] < 1e-9
    assert np.abs(F @ response.Phi[1, -1]).max() < 1e-8
    rough = np.random.default_rng(0).normal(size=(50, dmp.n_basis)) @ response.Phi[2].T
    smoothness = [np.linalg.norm(np.diff(a, n=2, axis=1)) / np.linalg.norm(a) for a in (acceleration, rough)]
    assert smoothness[0] < 0.2 * smoothness[1]


def test_the_covariance_follows_what_helps():
    """A cost that rises fast along some axes and slowly along others: the exploration takes the inverse shape."""
    scale = 10.0 ** np.linspace(0, 1.5, 6)
    search, rng = Search.start(6), np.random.default_rng(0)
    search = Search(search.center + 1.0, 0.5, search.covariance, search.path, search.size_path)
    for _ in range(150):
        z = search.draw(13, rng)
        search = METHODS["cma-es"](search, z, np.sum((scale * z) ** 2, axis=1))
    assert np.sum((scale * search.center) ** 2) < 1e-6  # from 1,600
    spread = np.sqrt(np.diag(search.covariance))
    assert spread[0] / spread[-1] > 8


def test_what_cannot_be_is_refused():
    primitive = reach(DMP())
    n = 20

    def wrong(message, cost, **options):
        with pytest.raises(SpecificationError, match=message):
            improve(primitive, cost, **options)

    wrong(
        r"expected finite costs, got nan for movement 3 of update 0", lambda r: np.where(np.arange(n) == 3, np.nan, 1.0)
    )
    wrong(r"expected finite costs, got inf", lambda r: np.full(n, np.inf))
    wrong(
        r"return 20 numbers, one for each movement of the rollout, got shape \(20, 200\); reduce",
        lambda r: r.positions[..., 0],
    )
    wrong(r"got shape \(\)", lambda r: 1.0)
    wrong(r"expected rollouts to be a whole number of at least 5, got 4", far_from([0, 0]), rollouts=4)
    wrong(r"expected method to be one of", far_from([0, 0]), method="reps")
    wrong(r"expected exploration", far_from([0, 0]), exploration=0.0)
    with pytest.raises(SpecificationError, match=r"expected one primitive to improve, got 2"):
        improve(DMP().learn([U, U**2]), far_from([0]))
    with pytest.raises(kineme.errors.KinemeError, match=r"20 numbers, the cost of each movement"):
        improve(primitive, lambda r: ["x"] * n)
    with pytest.raises(kineme.errors.TrajectoryError, match=r"expected kineme.dmp.Primitives, got ndarray"):
        improve(np.zeros(5), far_from([0]))
    with pytest.raises(SpecificationError, match=r"at least 4 basis functions"):
        improve(reach(DMP(n_basis=3)), far_from([0, 0]))


def test_a_progress_bar_if_asked_for(capsys):
    improve(reach(DMP()), far_from([0.5, 0.5]), updates=2)
    assert capsys.readouterr().err == ""
    improve(reach(DMP()), far_from([0.5, 0.5]), updates=2, progress=True)
    assert "improving" in capsys.readouterr().err


@pytest.mark.parametrize("formulation", ["bio-inspired", "original"])
def test_the_primitive_has_the_start_goal_and_duration_that_were_tried(formulation, make_movement):
    t, x = make_movement(1, 2)
    primitive = DMP(formulation).learn(kineme.Trajectory(t, x))
    given = {"start": x[0] + 0.1, "goal": x[-1] + [0.3, 0.2], "duration": 3.0}

    def cost(rollout):
        far = np.linalg.norm(rollout.positions[:, -1] - given["goal"], axis=1)
        return far + 1e-3 * np.abs(rollout.accelerations).mean(axis=(1, 2))

    found = improve(primitive, cost, updates=3, rollouts=6, **given)
    assert found.costs[0, 0] == pytest.approx(cost(primitive.rollout(**given))[0])
    np.testing.assert_allclose(cost(found.primitive.rollout()), found.cost)
    np.testing.assert_array_equal(found.primitive.goals[0], given["goal"])
    assert found.primitive.durations.tolist() == [3.0]
