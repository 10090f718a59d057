"""Generation in batch: invariances of Section 2, derivatives, broadcasting, settling, wrong options."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme.dmp.discrete.specification import FORMULATIONS

FORMULATION = pytest.mark.parametrize("formulation", sorted(FORMULATIONS))


def strokes(seed=0, n=3, d=2, amplitude=1.0):
    """Smooth movements from 0 to a goal of about `amplitude`, at rest at both ends."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0, 1, 120)
    rise = u**3 * (10 - 15 * u + 6 * u**2)
    goals = amplitude * rng.uniform(0.5, 1.5, (n, 1, d))
    bumps = rng.normal(size=(n, 4, d))
    waves = np.sin(np.pi * np.arange(1, 5) * u[:, None]) * (u * (1 - u))[:, None]
    return rise[:, None] * goals + waves @ bumps


def learn(formulation, seed=0, **more):
    return kineme.DMP(formulation, n_basis=30, regression="ridge").learn(strokes(seed, **more))


@FORMULATION
@given(shift=st.floats(-1e3, 1e3), seed=st.integers(0, 99))
@settings(max_examples=10)
def test_moving_start_and_goal_together_moves_the_path(formulation, shift, seed):
    primitives = learn(formulation, seed)
    moved = primitives.rollout(start=primitives.starts + shift, goal=primitives.goals + shift).positions
    np.testing.assert_allclose(moved - shift, primitives.rollout().positions, atol=1e-9)


@FORMULATION
@given(tempo=st.floats(0.1, 10), seed=st.integers(0, 99))
@settings(max_examples=10)
def test_the_path_does_not_depend_on_the_duration(formulation, tempo, seed):
    primitives = learn(formulation, seed)
    slow = primitives.rollout(duration=primitives.durations * tempo)
    fast = primitives.rollout()
    np.testing.assert_allclose(slow.positions, fast.positions, atol=1e-10)
    np.testing.assert_allclose(slow.velocities * tempo, fast.velocities, atol=1e-9)
    np.testing.assert_allclose(slow.accelerations * tempo**2, fast.accelerations, atol=1e-7)


@FORMULATION
@given(seed=st.integers(0, 99))
@settings(max_examples=10)
def test_start_and_goal_are_met(formulation, seed):
    primitives = learn(formulation, seed)
    goals = primitives.goals + np.random.default_rng(seed).normal(size=(3, 2))
    path = primitives.rollout(start=[0.2, -0.1], goal=goals, settle=1e-3)
    np.testing.assert_allclose(path.positions[:, 0], [[0.2, -0.1]] * 3, atol=1e-12)
    assert np.abs(path.positions[:, -1] - goals).max() <= 1e-3


@FORMULATION
def test_velocities_and_accelerations_are_derivatives_of_second_order(formulation):
    """Central differences of the positions approach them as h squared."""
    primitives = learn(formulation)
    errors = []
    for n_samples in (401, 801, 1601):
        path = primitives.rollout(goal=[2.0, 1.0], n_samples=n_samples)
        h = path.times[0, 1]
        x, v, a = path.positions, path.velocities, path.accelerations
        first = (x[:, 2:] - x[:, :-2]) / (2 * h)
        second = (x[:, 2:] - 2 * x[:, 1:-1] + x[:, :-2]) / h**2
        errors.append([np.abs(first - v[:, 1:-1]).max(), np.abs(second - a[:, 1:-1]).max()])
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (np.abs(orders - 2) < 0.2).all(), orders


@FORMULATION
def test_one_primitive_goes_to_many_goals_as_one_by_one(formulation):
    primitives = learn(formulation)
    goals = np.random.default_rng(1).normal(size=(50, 2))
    together = primitives[1].rollout(goal=goals)
    for i in (0, 17, 49):
        np.testing.assert_allclose(together.positions[i], primitives[1].rollout(goal=goals[i]).positions[0], atol=1e-12)


def test_generated_trajectories_keep_labels_and_names():
    demos = kineme.Demonstrations.from_arrays(list(strokes()), ["a", "b", "c"], names=["1", "2", "3"])
    primitives = kineme.DMP().learn(demos)
    assert primitives.rollout().trajectories[2].label == "c"
    assert primitives[1].rollout(goal=np.zeros((4, 2)) + 1).trajectories.names == ("2",) * 4


def test_rate_gives_samples_at_most_that_far_apart():
    path = learn("bio-inspired").rollout(duration=2.0, rate=100)
    np.testing.assert_allclose(np.diff(path.times[0]), 0.01)
    assert path.positions.shape == (3, 201, 2)


def test_initial_velocity_is_met():
    path = learn("bio-inspired").rollout(velocity=[3.0, -4.0], duration=0.5)
    np.testing.assert_allclose(path.velocities[:, 0], [[3.0, -4.0]] * 3, atol=1e-12)


def test_replay_of_a_noisy_movement_starts_at_its_first_sample():
    x = strokes() + 0.01 * np.random.default_rng(0).normal(size=(3, 120, 2))
    np.testing.assert_allclose(kineme.DMP().learn(x).rollout().positions[:, 0], x[:, 0], atol=1e-12)


class TestIssuesOfTheOriginalFormulation:
    """Section 2.1's three issues, there in Eq. (1) and gone in Eq. (4)."""

    def test_equal_start_and_goal_give_no_movement(self):
        primitives = learn("original")
        path = primitives.rollout(start=[1.0, 1.0], goal=[1.0, 1.0], velocity=[0.0, 0.0]).positions
        np.testing.assert_allclose(path, 1.0, atol=1e-12)

    @pytest.mark.parametrize("formulation", sorted(set(FORMULATIONS) - {"original", "amplitude-scaled"}))
    def test_the_additive_ones_move_all_the_same(self, formulation):
        path = learn(formulation).rollout(start=[1.0, 1.0], goal=[1.0, 1.0], velocity=[0.0, 0.0]).positions
        assert np.ptp(path, axis=1).max() > 0.1

    def test_a_goal_close_to_the_start_explodes(self):
        """Learned 1 mm from the start, asked for 10 cm: accelerations grow a hundredfold."""
        x = strokes(seed=4)
        x[:, :, 0] += np.linspace(0, 1, 120) ** 2 * (0.001 - x[:, -1:, 0])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", kineme.errors.DegenerateMovementWarning)
            growth = {}
            for formulation in FORMULATIONS:
                primitives = kineme.DMP(formulation).learn(x)
                goals = primitives.goals + np.array([0.1, 0.0])
                grown = np.abs(primitives.rollout(goal=goals).accelerations).max()
                growth[formulation] = grown / np.abs(primitives.rollout().accelerations).max()
        assert growth["original"] > 20
        assert growth["bio-inspired"] < 1.5
        assert growth["amplitude-scaled"] < 1.5

    def test_a_goal_across_zero_mirrors_the_movement(self):
        primitives = learn("original")
        start = primitives.starts
        there = primitives.rollout(velocity=[0.0, 0.0]).positions - start[:, None]
        across = primitives.rollout(goal=2 * start - primitives.goals, velocity=[0.0, 0.0]).positions - start[:, None]
        np.testing.assert_allclose(across, -there, atol=1e-9)

    def test_the_bio_inspired_shape_is_not_mirrored(self):
        """Only the way to the goal is: the rest of the path stays."""
        primitives = learn("bio-inspired")
        start, amplitude = primitives.starts[:, None], (primitives.goals - primitives.starts)[:, None]
        there = primitives.rollout().positions - start
        across = primitives.rollout(goal=2 * primitives.starts - primitives.goals).positions - start
        way = (there - across) / (2 * amplitude)
        np.testing.assert_allclose(way, np.broadcast_to(way[:1, :, :1], way.shape), atol=1e-9)


class TestAmplitudeScaled:
    @given(factor=st.floats(0.01, 20), seed=st.integers(0, 99))
    @settings(max_examples=10)
    def test_a_goal_nearer_or_farther_scales_the_whole_path(self, factor, seed):
        primitives = learn("amplitude-scaled", seed)
        at_rest = np.zeros(2)
        there = primitives.rollout(velocity=at_rest).positions - primitives.starts[:, None]
        goals = primitives.starts + factor * (primitives.goals - primitives.starts)
        scaled = primitives.rollout(goal=goals, velocity=at_rest).positions - primitives.starts[:, None]
        np.testing.assert_allclose(scaled, factor * there, atol=1e-9 * max(1, factor))

    def test_no_overshoot_when_the_goal_comes_closer(self):
        """Additive forcing does not shrink with the goal; this one does."""
        over = {}
        for formulation in ("bio-inspired", "amplitude-scaled"):
            primitives = learn(formulation, seed=7)
            goals = primitives.starts + 0.1 * (primitives.goals - primitives.starts)
            path = primitives.rollout(goal=goals).positions - primitives.starts[:, None]
            over[formulation] = np.abs(path).max()
        assert over["amplitude-scaled"] < 0.25 * over["bio-inspired"]

    def test_closed_movements_keep_their_size(self):
        x = strokes()
        x = x - np.linspace(0, 1, 120)[:, None] * x[:, -1:]
        primitives = kineme.DMP("amplitude-scaled").learn(x)
        np.testing.assert_array_equal(primitives.rollout(goal=[5.0, 5.0]).ratio, 1.0)


class TestWrongWishes:
    @pytest.mark.parametrize("duration", [0.0, -1.0, [1.0, 2.0, -3.0]])
    def test_durations_of_zero_or_less(self, duration):
        value = np.ravel(duration)[-1]
        with pytest.raises(kineme.errors.SpecificationError, match=f"duration above 0 seconds, got {value:g}"):
            learn("bio-inspired").rollout(duration=duration)

    @pytest.mark.parametrize("name", ["start", "goal", "velocity"])
    def test_wrong_dimensions(self, name):
        with pytest.raises(
            kineme.errors.TrajectoryError, match=rf"{name} of shape \(2,\) or \(n, 2\), got shape \(3,\)"
        ):
            learn("bio-inspired").rollout(**{name: [1.0, 2.0, 3.0]})

    def test_not_a_number(self):
        with pytest.raises(kineme.errors.TrajectoryError, match=r"finite numbers for goal, got \[nan, 1.0\]"):
            learn("bio-inspired").rollout(goal=[float("nan"), 1.0])

    def test_which_of_many_wishes_is_bad(self):
        goals = np.zeros((1000, 2))
        goals[700, 1] = np.inf
        with pytest.raises(
            kineme.errors.TrajectoryError, match=r"finite numbers for goal, got \[0.0, inf\] for movement 700$"
        ):
            learn("bio-inspired").rollout(goal=goals)
        goals[700, 1] = 1e200
        with pytest.raises(
            kineme.errors.TrajectoryError, match=r"got \[0.0, 1e\+200\] for movement 700; choose another unit"
        ):
            learn("bio-inspired").rollout(goal=goals.tolist())

    def test_numbers_of_movements_that_do_not_go_together(self):
        with pytest.raises(kineme.errors.TrajectoryError, match="got 3 primitives, 4 goal"):
            learn("bio-inspired").rollout(goal=np.ones((4, 2)))

    def test_a_rate_too_low_for_the_dynamics(self):
        with pytest.raises(kineme.errors.SpecificationError, match=r"rate of at least 10 Hz .* got 5 Hz"):
            learn("bio-inspired").rollout(duration=2.0, rate=5)

    def test_rate_and_samples_together(self):
        with pytest.raises(kineme.errors.SpecificationError, match="either rate or n_samples"):
            learn("bio-inspired").rollout(rate=100, n_samples=10)

    def test_a_closed_movement_cannot_go_elsewhere_in_the_original_formulation(self):
        x = strokes()
        x[1, -1] = x[1, 0]
        demos = kineme.Demonstrations.from_arrays(list(x), names=["a", "loop", "c"])
        with pytest.raises(
            kineme.errors.DegenerateMovementError, match=r"trajectory 1 \('loop'\).*dimension 0.*amplitude-scaled"
        ):
            kineme.DMP("original").learn(demos).rollout(goal=[1.0, 1.0])

    def test_a_tolerance_that_is_never_met(self):
        primitives = kineme.DMP("bio-inspired", damping=0.01).learn(strokes())
        with pytest.raises(kineme.errors.SpecificationError, match=r"within 1e-06 of its goal in 10 durations"):
            primitives.rollout(settle=1e-6)


@FORMULATION
@pytest.mark.parametrize("gating", ["none", "phase"])
def test_paths_past_the_end_do_not_depend_on_the_rate(formulation, gating):
    """Even where a sample interval straddles the end, at which an ungated f has a kink."""
    primitives = kineme.DMP(formulation, n_basis=20, gating=gating).learn(strokes())
    movement = primitives.rollout(goal=[2.0, 1.0])
    coarse, fine = (replace(movement, n_samples=n, end=3.0).positions for n in (61, 1201))
    np.testing.assert_allclose(coarse, fine[:, ::20], atol=1e-12)


def test_in_one_dimension_a_number_will_do():
    learned = kineme.DMP(n_basis=15).learn([np.linspace(0, 1, 50) ** 2])
    for name in ("start", "goal", "velocity"):
        as_number, as_row = (learned.rollout(**{name: wish}).positions for wish in (2.0, [2.0]))
        np.testing.assert_array_equal(as_number, as_row)


def test_a_rollout_shows_itself_in_one_line():
    shown = repr(kineme.DMP(n_basis=15).learn([np.linspace(0, 1, 50) ** 2]).rollout(n_samples=30))
    assert shown.startswith("Rollout(1 movements of 30 samples from Primitives(1 movements, 1 dims, DMP(")
    assert "\n" not in shown
