"""Via points and end velocity, over every formulation, gating and fit."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme import DMP
from kineme.dmp import Primitives
from kineme.dmp.discrete.operators import decoder, decoder_at, smoothness_factor
from kineme.dmp.discrete.specification import FORMULATIONS, GATINGS
from kineme.errors import ExtrapolationWarning, SpecificationError, TrajectoryError
from soaking import combined, examples

FITS = (("forcing", "local"), ("forcing", "ridge"), ("trajectory", "local"))
EVERY = [
    DMP(name, n_basis=n, n_points=80, fit=fit, regression=regression, gating=gating)
    for name, (fit, regression), gating, n in combined(FORMULATIONS, FITS, GATINGS, (12, 40))
]
NAMES = [f"{one.formulation}-{one.fit}-{one.regression}-{one.gating}-{one.n_basis}" for one in EVERY]


@pytest.fixture(scope="module")
def demos():
    return kineme.load_lasa(["GShape"])


@pytest.fixture(scope="module")
def learned(demos):
    return DMP().learn(demos)


def middle(learned):
    return learned[0].rollout(n_samples=3).positions[0, 1]


@pytest.mark.parametrize("dmp", EVERY, ids=NAMES)
def test_everything_that_is_asked_for_is_met(dmp, demos):
    """Points, one with a free dimension, start, goal, both velocities; to 1e-6 of the extent."""
    primitives = dmp.learn(demos)
    extent = primitives.extents.max()
    start, goal = primitives.starts + 3.0, primitives.goals - 5.0
    velocity, end_velocity, tau = np.array([4.0, 0.0]), np.array([10.0, -20.0]), 3.0
    asked = {"start": start, "goal": goal, "duration": tau, "velocity": velocity, "n_samples": 81}
    plain = primitives.rollout(**asked).positions
    first, second = plain[:, 24] + np.array([4.0, -3.0]), plain[:, 56] + np.array([-5.0, 2.0])
    second[:, 0] = np.nan
    path = primitives.rollout(**asked, via=[(0.7, second), (0.3, first)], end_velocity=end_velocity)
    at_rest = 1e-6 * extent
    np.testing.assert_allclose(path.positions[:, 24], first, rtol=0, atol=at_rest)
    np.testing.assert_allclose(path.positions[:, 56, 1], second[:, 1], rtol=0, atol=at_rest)
    np.testing.assert_allclose(path.positions[:, 0], start, rtol=0, atol=at_rest)
    np.testing.assert_allclose(path.positions[:, -1], goal, rtol=0, atol=at_rest)
    np.testing.assert_allclose(path.velocities[:, 0], np.tile(velocity, (7, 1)), rtol=0, atol=at_rest / tau)
    np.testing.assert_allclose(path.velocities[:, -1], np.tile(end_velocity, (7, 1)), rtol=0, atol=at_rest / tau)


@pytest.mark.parametrize("dmp", EVERY[::4], ids=NAMES[::4])
def test_the_controller_moves_the_same(dmp, demos):
    primitive = dmp.learn(demos)[2]
    point = primitive.rollout(n_samples=11).positions[0, 4] + np.array([4.0, 4.0])
    asked = {"goal": primitive.goals[0] + np.array([5.0, 0.0]), "via": [(0.4, point)], "end_velocity": [30.0, 5.0]}
    movement = primitive.rollout(**asked, n_samples=51)
    controller = primitive.controller(movement.times[0, 1], **asked)
    states = [controller.state] + [controller.step() for _ in range(50)]
    unit = primitive.extents.max()
    for name in ("position", "velocity", "acceleration"):
        expected = getattr(movement, {"position": "positions", "velocity": "velocities"}.get(name, "accelerations"))[0]
        np.testing.assert_allclose([getattr(one, name) for one in states], expected, rtol=1e-8, atol=1e-8 * unit)


def test_the_change_is_the_smoothest_of_all_that_pass(learned):
    """Any other change that meets the same conditions has a larger mean square acceleration."""
    dmp, N = learned.dmp, learned.dmp.n_basis
    plain, via = (
        learned[0].rollout(),
        [(0.35, learned[0].rollout(n_samples=101).positions[0, 35] + np.array([6.0, -4.0]))],
    )
    changed = learned[0].rollout(via=via)
    change = changed.accelerations - plain.accelerations
    at = decoder_at(dmp, (0.35, 1.0))
    observed = np.vstack((at.Phi[0], at.Phi[1, -1:]))
    free = np.linalg.svd(observed)[2][len(observed) :]  # changes of the weights that none of the conditions feels
    for W in np.random.default_rng(0).normal(size=(50, N - len(observed))) @ free:
        other = change[0, :, 0] + 1e-3 * decoder(dmp, dmp.n_points).Phi[2] @ W
        assert np.mean(other**2) > np.mean(change[0, :, 0] ** 2) * (1 - 1e-6)


def rms(path, other):
    return np.sqrt(np.mean(np.sum((path - other) ** 2, axis=1)))


def test_points_of_another_demonstration_lead_to_it():
    """What the covariance is chosen for: three points halve the distance between two demonstrations and more."""
    plain, guided = [], []
    for name in kineme.datasets.LASA_30[::3]:
        learned = DMP().learn(kineme.load_lasa([name]))
        paths, one = learned.rollout(n_samples=201).positions, learned[1]
        asked = {"start": one.starts, "goal": one.goals, "velocity": one.velocities, "duration": one.durations}
        via = [(share, paths[1, int(200 * share)]) for share in (0.25, 0.5, 0.75)]
        for errors, points in ((plain, None), (guided, via)):
            path = learned[0].rollout(**asked, via=points, n_samples=201).positions[0]
            errors.append(rms(path, paths[1]) / learned.extents[1].max())
    assert np.mean(guided) < 0.45 * np.mean(plain)


class TestAverages:
    def test_points_are_met_and_demonstrations_say_how(self):
        """Left out one by one, demonstrations are better guessed from two of their points than by smoothness alone."""
        ours, smooth = [], []
        for name in kineme.datasets.LASA_30[::4]:
            learned = DMP().learn(kineme.load_lasa([name]))
            paths = learned.rollout(n_samples=91).positions
            for i in range(0, 7, 3):
                known = kineme.styles.average(learned[np.arange(7) != i])
                one = learned[i]
                via = [(1 / 3, paths[i, 30]), (2 / 3, paths[i, 60])]
                options = {"start": one.starts, "goal": one.goals, "velocity": one.velocities, "n_samples": 91}
                options |= {"duration": one.durations, "via": via}
                path = known.rollout(**options)
                np.testing.assert_allclose(
                    path.positions[0, [30, 60]], paths[i, [30, 60]], atol=1e-6 * one.extents.max()
                )
                for errors, rolled in ((ours, path), (smooth, known.primitive.rollout(**options))):
                    errors.append(rms(rolled.positions[0], paths[i]) / one.extents.max())
        assert np.mean(ours) < 0.92 * np.mean(smooth)

    @pytest.mark.parametrize("formulation", FORMULATIONS)
    def test_everything_is_met_in_a_batch(self, formulation, demos):
        known = kineme.styles.average(DMP(formulation).learn(demos))
        goals = known.primitive.goals + np.random.default_rng(0).normal(size=(20, 2)) * 5
        points = known.rollout(goal=goals, n_samples=11).positions[:, 4] + np.array([3.0, -3.0])
        points[::2, 0] = np.nan
        path = known.rollout(goal=goals, via=[(0.4, points)], end_velocity=[5.0, 5.0], n_samples=11)
        given = np.isfinite(points)
        np.testing.assert_allclose(path.positions[:, 4][given], points[given], atol=1e-6 * 40)
        np.testing.assert_allclose(path.positions[:, -1], goals, atol=1e-6 * 40)
        np.testing.assert_allclose(path.velocities[:, -1], np.full((20, 2), 5.0), atol=1e-6 * 40)

    def test_without_spread_it_is_the_primitive(self, learned):
        alone = kineme.styles.average(learned[:1])
        via = [(0.5, middle(learned))]
        np.testing.assert_allclose(
            alone.rollout(via=via).positions, alone.primitive.rollout(via=via).positions, atol=1e-9
        )


def test_batches_go_together_as_one_by_one(learned):
    rng = np.random.default_rng(3)
    goals = learned.goals[0] + rng.normal(size=(30, 2))
    points = learned[0].rollout(goal=goals, n_samples=11).positions[:, 3] + rng.normal(size=(30, 2))
    points[rng.random((30, 2)) < 0.3] = np.nan
    points[np.isnan(points).all(axis=1)] = 1.0
    via = [(0.3, points), (0.8, [np.nan, 2.0])]
    together = learned[0].rollout(goal=goals, via=via).positions
    for i in (0, 7, 29):
        alone = learned[0].rollout(goal=goals[i], via=[(0.3, points[i]), (0.8, [np.nan, 2.0])]).positions[0]
        np.testing.assert_allclose(together[i], alone, atol=1e-9)
    chosen = learned[0].rollout(goal=goals, via=via)[[7, 0]]
    np.testing.assert_allclose(chosen.positions, together[[7, 0]], atol=1e-12)


def test_one_movement_goes_through_many_points(learned):
    points = middle(learned) + np.random.default_rng(0).normal(size=(50, 2))
    path = learned[0].rollout(via=[(0.5, points)], n_samples=21)
    assert path.positions.shape == (50, 21, 2)
    np.testing.assert_allclose(path.positions[:, 10], points, atol=1e-6)


class TestStretches:
    def test_a_stretch_is_followed(self, learned):
        """A quarter of the movement, drawn elsewhere: 0.1 % of the extent from every point."""
        u = np.linspace(0.4, 0.65, 26)
        there = learned[0].rollout(n_samples=1001).positions[0, (1000 * u).round().astype(int)]
        asked = there + 5.0 * np.sin(np.pi * (u - 0.4) / 0.25)[:, None]
        path = learned[0].rollout(via=[((0.4, 0.65), asked)], n_samples=1001)
        met = path.positions[0, (1000 * u).round().astype(int)]
        assert np.abs(met - asked).max() < 1e-3 * learned.extents[0].max()
        np.testing.assert_allclose(path.positions[0, -1], learned.goals[0], atol=1e-6)

    def test_few_points_are_met_exactly(self, learned):
        asked = middle(learned) + np.array([[1.0, 2.0], [3.0, 1.0], [2.0, 5.0]])
        path = learned[0].rollout(via=[((0.4, 0.6), asked), (0.8, learned.goals[0])], n_samples=11)
        np.testing.assert_allclose(path.positions[0, [4, 5, 6]], asked, atol=1e-6 * 35)
        np.testing.assert_allclose(path.positions[0, 8], learned.goals[0], atol=1e-6 * 35)

    @settings(max_examples=examples(8, 25), deadline=None)
    @given(
        st.sampled_from(range(0, len(EVERY), 2)),
        st.integers(5, 150),
        st.floats(0.1, 0.7),
        st.floats(0.03, 0.2),
        st.integers(0, 10**6),
    )
    def test_a_noisy_one_does_not_swing(self, demos, which, n_points, begin, length, seed):
        """Met as closely as possible, these swung by up to 700 times the movement's extent."""
        primitive = EVERY[which].learn(demos[:1])
        plain = primitive.rollout(n_samples=2001).positions[0]
        places = np.round(2000 * np.linspace(begin, begin + length, n_points)).astype(int)
        noise = 0.02 * np.random.default_rng(seed).normal(size=(n_points, 2)) * primitive.extents[0]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ExtrapolationWarning)
            path = primitive.rollout(via=[((begin, begin + length), plain[places] + noise)], n_samples=2001)
        assert np.abs(path.positions[0] - plain).max() < np.linalg.norm(primitive.extents[0])
        np.testing.assert_allclose(path.positions[0, -1], primitive.goals[0], atol=1e-6 * 35)

    def test_a_smooth_one_of_many_points_does_not_swing_either(self, learned):
        u = np.linspace(0.1, 0.9, 200)
        plain, places = learned[0].rollout(n_samples=2001).positions[0], np.round(2000 * u).astype(int)
        asked = plain[places] + 8.0 * np.sin(np.pi * (u - 0.1) / 0.8)[:, None]
        path = learned[0].rollout(via=[((0.1, 0.9), asked)], n_samples=2001).positions[0]
        assert np.abs(path[places] - asked).max() < 1e-3 * 50
        assert np.abs(path - plain).max() < 1.01 * 8.0

    def test_an_average_does_not_swing_either(self, demos):
        known = kineme.styles.average(DMP().learn(demos))
        plain = known.rollout(n_samples=1001).positions[0]
        noisy = plain[400:600:4] + np.random.default_rng(0).normal(size=(50, 2))
        with pytest.warns(ExtrapolationWarning, match="from its via stretch"):
            path = known.rollout(via=[((0.4, 0.596), noisy)], n_samples=1001).positions[0]
        assert np.abs(path - plain).max() < 25.0  # half of its extent; met as closely as possible, 500 times it

    def test_how_far_one_is_led_away_is_said(self, learned):
        """The number that is said is that of the path."""
        plain = learned[0].rollout(n_samples=1001).positions[0]
        noisy = plain[400:600:4] + np.random.default_rng(0).normal(size=(50, 2))
        with pytest.warns(ExtrapolationWarning, match=r"smooth its points.*condition\(t, position, std\)") as said:
            path = learned[0].rollout(via=[((0.4, 0.596), noisy)], n_samples=1001).positions[0]
        assert len(said) == 1
        led = float(re.search(r"led away from its path by ([\d.]+), where", str(said[0].message))[1])
        assert led == pytest.approx(np.abs(path - plain).max(), rel=0.1)
        assert led < 3.0

    def test_one_that_bends_too_much_is_said(self, learned):
        asked = middle(learned) + np.random.default_rng(0).normal(size=(200, 2))
        with pytest.warns(ExtrapolationWarning, match=r"movement 0 stays .* from its via stretch"):
            learned[0].rollout(via=[((0.4, 0.6), asked)])


def test_a_modulated_movement_is_a_primitive_of_its_own(learned, tmp_path):
    path = learned[0].rollout(goal=[5.0, 5.0], via=[(0.5, [-20.0, 10.0])], end_velocity=[3.0, 4.0], duration=2.0)
    own = Primitives.from_rollout(path)
    assert type(own) is Primitives
    for again in (own, Primitives.load(own.save(tmp_path / "own.npz"))):
        np.testing.assert_allclose(again.rollout().positions, path.positions, atol=1e-10)
        assert again.labels.tolist() == ["GShape"]
    further = own.rollout(goal=[8.0, 5.0], n_samples=11)
    assert np.abs(further.positions[0, -1] - [8.0, 5.0]).max() < 0.5


def test_nothing_asked_for_changes_nothing(learned):
    plain = learned.rollout()
    assert plain.change is None
    own = Primitives.from_rollout(plain)
    np.testing.assert_allclose(own.rollout().positions, plain.positions, atol=1e-12)


class TestRefusals:
    @pytest.mark.parametrize(
        ("via", "match"),
        [
            ((0.4, [1.0, 2.0]), r"got one pair; put it in a list: via=\[\(0.4"),
            (3.0, r"expected via=\[\(time, point\)"),
            ("0.4", r"expected via=\[\(time, point\)"),
            ([0.4, 0.5, 0.6], r"got 0.4 as via\[0\]"),
            ([(0.0, [1.0, 2.0])], r"via\[0\].*above 0 and below 1.*got 0.0; start, goal"),
            ([(1.0, [1.0, 2.0])], "above 0 and below 1"),
            ([(float("nan"), [1.0, 2.0])], "above 0 and below 1"),
            ([((0.6, 0.4), [[1.0, 2.0], [1.0, 2.0]])], r"got \(0.6, 0.4\)"),
            ([((0.6, 0.7, 0.8), [[1.0, 2.0], [1.0, 2.0]])], "a begin and a later end"),
            ([(0.4, [1.0, 2.0]), (0.4, [1.0, 2.1])], r"one place at 0.4 .*\[1.0, 2.0\] and \[1.0, 2.1\]"),
        ],
    )
    def test_what_is_no_via(self, learned, via, match):
        with pytest.raises(SpecificationError, match=match):
            learned[0].rollout(via=via)

    @pytest.mark.parametrize(
        ("via", "match"),
        [
            ([(0.4, [1.0, 2.0, 3.0])], r"via\[0\].*shape \(2,\) or \(n, 2\), got shape \(3,\)"),
            ([((0.4, 0.5), [1.0, 2.0])], r"shape \(m, 2\) or \(n, m, 2\), got shape \(2,\)"),
            ([(0.4, [np.nan, np.nan])], "NaN only for dimensions that are free"),
            ([(0.4, [np.inf, 1.0])], "expected numbers up to"),
            (
                [(0.4, np.ones((3, 2))), (0.5, np.ones((4, 2)))],
                r"via\[0\]: expected points of one movement or of 4, got 3",
            ),
            ([(0.4, np.ones((3, 2)))], "got 7 movements, 3 via"),
            ([(0.4, "here")], r"via\[0\]"),
        ],
    )
    def test_what_is_no_point(self, learned, via, match):
        with pytest.raises(TrajectoryError, match=match):
            learned.rollout(via=via)

    def test_equal_points_and_complementary_ones_at_one_time_are_one(self, learned):
        whole = learned[0].rollout(via=[(0.4, [1.0, 2.0])]).positions
        twice = learned[0].rollout(via=[(0.4, [1.0, np.nan]), (0.4, [np.nan, 2.0]), (0.4, [1.0, 2.0])]).positions
        np.testing.assert_allclose(twice, whole, atol=1e-9)

    def test_more_points_than_basis_functions(self, demos):
        few = DMP(n_basis=5).learn(demos)[:1]
        with pytest.raises(SpecificationError, match="can be met independently"):
            few.rollout(via=[(t, [0.0, 0.0]) for t in (0.2, 0.3, 0.5, 0.6)])

    def test_a_point_far_from_what_was_demonstrated_is_said(self, learned):
        points = learned.rollout(n_samples=3).positions[:, 1] + 10.0
        learned.rollout(via=[(0.5, points)])  # near enough: a warning would be an error
        points[3] += 1e3
        with pytest.warns(
            ExtrapolationWarning, match=r"1 of 7 movements .* at 0.5 of the duration is 1\.\d+e\+03 from"
        ):
            learned.rollout(via=[(0.5, points)])

    @pytest.mark.parametrize(
        "asked",
        [
            {"via": [(1e-4, [-25.0, -5.0])]},
            {"via": [(0.4, [-25.0, -5.0]), (0.4 + 1e-7, [-25.0, -4.0])]},
            {"end_velocity": [1e3, 0.0]},
        ],
        ids=["near the start", "near each other", "velocity"],
    )
    def test_a_change_that_leads_far_away_is_said(self, learned, asked):
        with pytest.warns(ExtrapolationWarning, match=r"1 of 1 movements are led .*: movement 0, \S+ large, by \d"):
            learned[0].rollout(**asked)

    def test_a_controller_takes_points_of_one_movement(self, learned):
        with pytest.raises(SpecificationError, match="one primitive to control, got 3"):
            learned[0].controller(0.01, via=[(0.5, np.zeros((3, 2)))])


def test_responses_between_even_times_are_those_at_even_times():
    for dmp in EVERY[::12]:
        there, between = decoder(dmp, 399), decoder_at(dmp, tuple(np.array([0, 1, 57, 398]) / 398))
        for expected, actual in zip(there, between, strict=True):
            np.testing.assert_allclose(actual, expected[:, [0, 1, 57, 398]], rtol=1e-9, atol=1e-12)
    assert smoothness_factor(EVERY[0]).shape == (12, 12)
