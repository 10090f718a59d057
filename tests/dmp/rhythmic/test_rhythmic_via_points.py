"""Rhythms through points at phases of their cycle, in a batch and step by step; what a rhythm has not is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme import RhythmicDMP
from kineme.dmp.rhythmic.operators import limit_cycle
from kineme.errors import ExtrapolationWarning, SpecificationError, TrajectoryError
from soaking import examples

SPECIFICATIONS = [RhythmicDMP(fit=fit, n_basis=n) for fit in ("trajectory", "forcing") for n in (15, 30)]
each = pytest.mark.parametrize("dmp", SPECIFICATIONS, ids=lambda dmp: f"{dmp.fit}-{dmp.n_basis}")
seeds = st.integers(0, 10**6)


def waves(n=3, seed=0):
    rng, demos = np.random.default_rng(seed), []
    for _ in range(n):
        t = np.linspace(0, 5.0, 400)
        phase = 2 * np.pi * t[:, None] / rng.uniform(1.2, 1.8) + rng.uniform(0, 6, 2)
        x = rng.normal(size=2) + np.cos(phase) * [1.0, 0.6] + 0.2 * np.sin(2 * phase)
        demos.append(kineme.Trajectory(t, x))
    return demos


def at_phases(movement, phases):
    """Positions (n, k, d) on the cycle at phases [rad], from a rollout of one period of 360 samples."""
    return movement.positions[:, np.round(np.asarray(phases) * 180 / np.pi).astype(int)]


@each
@settings(max_examples=examples(3, 8), deadline=None)
@given(seed=seeds)
def test_points_are_met_and_baseline_and_period_stay(dmp, seed):
    rng = np.random.default_rng(seed)
    primitives = dmp.learn(waves(seed=seed))
    asked = {"baseline": rng.normal(size=(3, 2)), "amplitude": rng.uniform(0.5, 2.0, 3), "period": 2.0}
    plain = primitives.rollout(**asked, n_samples=361)
    phases = np.sort(rng.choice(12, 3, replace=False)) * np.pi / 6
    points = at_phases(plain, phases) + 0.2 * rng.normal(size=(3, 3, 2))
    points[0, 1, 0] = np.nan
    path = primitives.rollout(**asked, via=list(zip(phases, points.transpose(1, 0, 2), strict=True)), n_samples=361)
    known = ~np.isnan(points)
    np.testing.assert_allclose(at_phases(path, phases)[known], points[known], rtol=0, atol=1e-8)
    np.testing.assert_allclose(path.positions[:, :360].mean(axis=1), plain.positions[:, :360].mean(axis=1), atol=1e-8)
    np.testing.assert_allclose(path.positions[:, 0], path.positions[:, -1], atol=1e-9)
    np.testing.assert_allclose(path.velocities[:, 0], path.velocities[:, -1], atol=1e-7)
    np.testing.assert_array_equal(path.times, plain.times)


@each
@settings(max_examples=examples(2, 5), deadline=None)
@given(seed=seeds)
def test_the_controller_moves_the_same_and_scales_it_as_a_whole(dmp, seed):
    rng = np.random.default_rng(seed)
    one = dmp.learn(waves(1, seed))
    point = one.rollout(n_samples=5).positions[0, 1] + 0.3 * rng.normal(size=2)
    asked = {"via": [(np.pi / 2, point)], "amplitude": 1.4, "phase": 1.0}
    path = one.rollout(2.0, **asked, n_samples=101)
    controller = one.controller(path.times[0, 1], **asked)
    states = [controller.state] + [controller.step() for _ in range(100)]
    for name in ("position", "velocity"):
        expected = getattr(path, {"position": "positions", "velocity": "velocities"}[name])[0]
        np.testing.assert_allclose([getattr(state, name) for state in states], expected, rtol=1e-8, atol=1e-7)
    assert controller.state.amplitude == pytest.approx(1.4)
    again = one.controller(path.times[0, 1], **asked)
    again.step(amplitude=2.8)
    for _ in range(600):
        state = again.step()
    far = np.array([again.step().position for _ in range(50)]) - one.baselines[0]
    near = path.positions[0, :50] - one.baselines[0]
    assert np.ptp(far, axis=0) == pytest.approx(2.0 * np.ptp(near, axis=0), rel=1e-2)
    assert state.amplitude == pytest.approx(2.8)


def test_the_change_is_the_smoothest_that_keeps_the_mean():
    one = RhythmicDMP().learn(waves(1))
    plain = one.rollout(n_samples=361)
    path = one.rollout(via=[(1.0, plain.positions[0, 57] + [0.3, 0.0])], n_samples=361)
    least = np.mean((path.accelerations - plain.accelerations)[0, :360, 0] ** 2)
    response = limit_cycle(one.dmp)
    twice = np.where(np.arange(response.shape[1]) == 0, 1.0, 2.0)
    there = (response * twice * np.exp(1j * np.arange(response.shape[1]))).real.sum(axis=1)  # at phase 1
    observed = np.vstack((there, response[:, 0].real))
    free = np.linalg.svd(observed)[2][2:]
    for W in np.random.default_rng(0).normal(size=(30, len(free))) @ free:
        other = replace(path, change=path.change + 0.1 * np.stack((W, 0 * W))[None])
        assert np.mean((other.accelerations - plain.accelerations)[0, :360, 0] ** 2) > least * (1 - 1e-6)


def test_a_batch_goes_as_its_members_and_one_goes_through_many():
    rng = np.random.default_rng(1)
    primitives = RhythmicDMP().learn(waves(4))
    points = primitives.rollout(n_samples=361).positions[:, 100] + 0.2 * rng.normal(size=(4, 2))
    points[::2, 1] = np.nan
    via = [(np.deg2rad(100), points)]
    together = primitives.rollout(3.0, via=via, start=primitives.baselines)
    for i in range(4):
        alone = primitives[i].rollout(3.0, via=[(np.deg2rad(100), points[i])], start=primitives.baselines[i])
        np.testing.assert_allclose(together.positions[i], alone.positions[0], atol=1e-10)
        np.testing.assert_allclose(together[[i]].positions[0], alone.positions[0], atol=1e-10)
    near = primitives[1].rollout(n_samples=361).positions[0, 100] + 0.2 * rng.normal(size=(5, 2))
    many = primitives[1].rollout(via=[(np.deg2rad(100), near)], n_samples=361)
    np.testing.assert_allclose(many.positions[:, 100], near, atol=1e-8)


def test_a_stretch_is_followed_and_a_noisy_one_does_not_swing():
    one = RhythmicDMP().learn(waves(1))
    plain, degrees = one.rollout(n_samples=361).positions[0], np.arange(60, 121, 3)
    bump = 0.1 * np.sin(np.pi * (degrees - 60) / 60)[:, None]
    stretch = (np.deg2rad(60), np.deg2rad(120))
    path = one.rollout(via=[(stretch, plain[degrees] + bump)], n_samples=361).positions[0]
    assert np.abs(path[degrees] - plain[degrees] - bump).max() < 2e-3
    noisy = plain[degrees] + 0.1 * np.random.default_rng(0).normal(size=(21, 2))
    with pytest.warns(ExtrapolationWarning, match="from its via stretch"):
        path = one.rollout(via=[(stretch, noisy)], n_samples=361).positions[0]
    assert np.abs(path - plain).max() < 1.0


@pytest.mark.parametrize("limits", [{"velocity": [3.0, 2.0]}, {"acceleration": 9.0}])
def test_the_least_period_touches_a_limit(limits):
    primitives = RhythmicDMP().learn(waves())
    least = primitives.rollout(start=primitives.baselines).least_period(**limits)
    quick = primitives.rollout(start=primitives.baselines, period=least, n_samples=10_000)
    ((name, limit),) = limits.items()
    rates = {"velocity": quick.velocities, "acceleration": quick.accelerations}[name]
    np.testing.assert_allclose((np.abs(rates) / limit).max(axis=(1, 2)), 1.0, rtol=1e-5)
    with pytest.raises(SpecificationError, match="depends on the duration"):
        primitives.rollout(velocity=[1.0, 0.0]).least_period(**limits)


class TestRefusals:
    @pytest.mark.parametrize(
        ("via", "error", "match"),
        [
            ([(-0.1, [0.0, 0.0])], SpecificationError, "from 0 to below 2 pi, got -0.1"),
            ([(6.3, [0.0, 0.0])], SpecificationError, "from 0 to below 2 pi"),
            ((1.0, [0.0, 0.0]), SpecificationError, "one pair; put it in a list"),
            ([(1.0, [0.0, 0.0]), (1.0, [0.0, 0.1])], SpecificationError, "one place at phase 1,"),
            ([(1.0, [0.0])], TrajectoryError, r"shape \(2,\)"),
            ([(k / 10, [0.0, 0.0]) for k in range(40)], SpecificationError, "can be met independently"),
        ],
    )
    def test_what_is_no_via(self, via, error, match):
        with pytest.raises(error, match=match):
            RhythmicDMP().learn(waves(1)).rollout(via=via)

    def test_a_point_at_phase_0_is_one(self):
        one = RhythmicDMP().learn(waves(1))
        point = one.rollout(n_samples=2).positions[0, 0] + 0.1
        np.testing.assert_allclose(one.rollout(via=[(0.0, point)], n_samples=2).positions[0, 0], point, atol=1e-9)

    def test_a_point_far_from_the_cycle_is_said(self):
        one = RhythmicDMP().learn(waves(1))
        with pytest.warns(ExtrapolationWarning, match=r"the one at phase 2 is .* from the path of movement 0"):
            one.rollout(via=[(2.0, one.baselines[0] + 10.0)])

    def test_an_amplitude_of_0_has_no_cycle(self):
        one = RhythmicDMP().learn(waves(1))
        with pytest.raises(SpecificationError, match="an amplitude other than 0"):
            one.rollout(amplitude=0.0, via=[(1.0, one.baselines[0])])

    @pytest.mark.parametrize(
        ("asked", "match"),
        [
            ({"goal": [0.0, 0.0]}, "give baseline="),
            ({"duration": 2.0}, "give period="),
            ({"end_velocity": [0.0, 0.0]}, "a rhythm has no end"),
            ({"goal_velocity": [0.0, 0.0]}, "controller.step"),
            ({"position_limits": (0.0, 1.0)}, "not kept within limits"),
            ({"settle": 0.1}, "never settles"),
        ],
    )
    def test_what_a_rhythm_does_not_have_is_said(self, asked, match):
        one = RhythmicDMP().learn(waves(1))
        with pytest.raises(SpecificationError, match=match):
            one.rollout(**asked)
        if "goal" not in asked:
            with pytest.raises(SpecificationError, match=match):
                one.controller(0.01, **asked)
        one.rollout(**dict.fromkeys(asked))

    def test_what_nobody_has_is_a_type_error(self):
        with pytest.raises(TypeError, match=r"rollout\(\) got an unexpected keyword argument 'gaol'"):
            RhythmicDMP().learn(waves(1)).rollout(gaol=[0.0, 0.0])
