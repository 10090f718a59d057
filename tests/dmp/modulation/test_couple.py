"""Two arms that keep the difference of their places over a stretch of one phase."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import DMP, couple
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import ExtrapolationWarning, SpecificationError, TrajectoryError


@pytest.fixture(scope="module")
def shapes():
    return kineme.load_lasa(["Line", "Angle"])


def paths(pair, n_samples=401):
    return [one.rollout(n_samples=n_samples).positions for one in pair]


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("gating", ["none", "phase"])
def test_the_difference_is_kept_and_starts_and_goals_with_their_velocities(shapes, formulation, gating):
    learned = DMP(formulation, gating=gating).learn(shapes)
    arms = learned[:7], learned[7:]
    pair = couple(*arms, during=(0.3, 0.7))
    before, after = paths([kineme.dmp.Primitives.from_rollout(one.rollout()) for one in arms]), paths(pair)
    extent = max(np.ptp(one, axis=1).max() for one in before)
    difference = (after[1] - after[0])[:, 120:281]
    assert np.ptp(difference, axis=1).max() < 2e-5 * extent
    np.testing.assert_allclose(difference.mean(axis=1), (before[1] - before[0])[:, 120:281].mean(axis=1), atol=0.5)
    for old, new in zip(arms, pair, strict=True):
        one, other = old.rollout(duration=new.durations), new.rollout()
        np.testing.assert_array_equal(other.positions[:, 0], one.positions[:, 0])
        np.testing.assert_allclose(other.positions[:, -1], one.positions[:, -1], atol=1e-6 * extent)
        np.testing.assert_allclose(other.velocities[:, -1], one.velocities[:, -1], atol=1e-5 * extent)


def test_an_offset_is_met_where_it_is_not_free(shapes):
    learned = DMP().learn(shapes)
    left, right = paths(couple(learned[0], learned[7], (0.4, 0.6), offset=[5.0, np.nan]))
    np.testing.assert_allclose((right - left)[0, 160:241, 0], 5.0, atol=2e-3)
    assert np.ptp((right - left)[0, 160:241, 1]) > 0.1


def test_both_give(shapes):
    """Equal arms share the correction in equal parts; any other share would bend both together more."""
    learned = DMP().learn(shapes)
    arms = learned[0], learned[7]
    pair = couple(*arms, during=(0.3, 0.7))
    longer = max(one.durations[0] for one in arms)
    before = [one.rollout(duration=longer, n_samples=401).positions for one in arms]
    given = [new - old for new, old in zip(paths(pair), before, strict=True)]
    np.testing.assert_allclose(given[0], -given[1], atol=1e-6 * np.abs(given[0]).max())
    assert np.abs(given[0]).max() > 0.1


def test_arms_with_different_specifications_and_durations_go_together(shapes):
    left, right = DMP(n_basis=30).learn(shapes)[0], DMP("original", n_basis=60, gating="phase").learn(shapes)[8]
    pair = couple(left, right, (0.2, 0.8), offset=[30.0, 0.0])
    assert pair[0].durations[0] == pair[1].durations[0] == max(left.durations[0], right.durations[0])
    difference = np.subtract(*paths(pair)[::-1])[0, 80:321]
    np.testing.assert_allclose(difference, np.tile([30.0, 0.0], (241, 1)), atol=0.02)


def test_controllers_at_one_phase_move_so(shapes):
    learned = DMP().learn(shapes)
    pair = couple(learned[0], learned[7], during=(0.3, 0.7), offset=[10.0, 0.0])
    duration = pair[0].durations[0]
    controllers = [one.controller(duration / 200) for one in pair]
    expected = paths(pair, 201)
    for k in range(1, 201):
        places = [one.step().position for one in controllers]
        for place, path in zip(places, expected, strict=True):
            np.testing.assert_allclose(place, path[0, k], atol=1e-6)
        if 60 <= k <= 140:
            np.testing.assert_allclose(places[1] - places[0], [10.0, 0.0], atol=5e-3)


def test_a_batch_is_its_pairs_one_by_one(shapes):
    learned = DMP().learn(shapes)
    many, one = learned[:7], learned[7]
    offsets = np.column_stack((np.arange(7.0), np.full(7, np.nan)))
    together = paths(couple(many, one, (0.3, 0.6), offsets))
    for i in range(7):
        for all_of_them, alone in zip(together, paths(couple(many[i], one, (0.3, 0.6), offsets[i])), strict=True):
            np.testing.assert_allclose(all_of_them[i], alone[0], atol=1e-8 * np.abs(alone).max())


def test_what_was_asked_of_a_rollout_at_its_ends_stays(shapes):
    learned = DMP().learn(shapes)
    left = learned[0].rollout(goal=[5.0, 5.0], end_velocity=[3.0, 0.0], duration=9.0)
    pair = couple(left, learned[7], during=(0.3, 0.7))
    moved = pair[0].rollout()
    np.testing.assert_allclose(moved.positions[0, -1], [5.0, 5.0], atol=1e-6)
    np.testing.assert_allclose(moved.velocities[0, -1], [3.0, 0.0], atol=1e-5)


class TestRefusals:
    @pytest.mark.parametrize("during", [(0.5, 0.5), (0.0, 0.5), (0.5, 1.0), (0.7, 0.3), 0.5, "ab", (0.1, np.nan)])
    def test_a_stretch_within_the_movement(self, shapes, during):
        learned = DMP().learn(shapes)
        with pytest.raises(SpecificationError, match="expected during"):
            couple(learned[0], learned[7], during)

    @pytest.mark.parametrize("offset", [[1.0], "near", [np.inf, 0.0], np.zeros((3, 2))])
    def test_an_offset_of_the_movements(self, shapes, offset):
        learned = DMP().learn(shapes)
        with pytest.raises(TrajectoryError, match="offset"):
            couple(learned[0], learned[7], (0.3, 0.7), offset)

    def test_two_movements_of_equal_dimensions(self, shapes):
        learned = DMP().learn(shapes)
        with pytest.raises(TrajectoryError, match="expected Primitives or Rollout as part 1, got ndarray"):
            couple(learned[0], np.zeros((10, 2)), (0.3, 0.7))

    def test_few_basis_functions_say_what_they_cannot(self, shapes):
        learned = DMP(n_basis=6).learn(shapes)
        with pytest.warns(ExtrapolationWarning, match="the difference of movements 0 is"):
            couple(learned[0], learned[7], (0.1, 0.9), offset=[40.0, 40.0])

    def test_half_a_percent_that_is_missing_is_said(self, shapes):
        learned = DMP(n_basis=6).learn(shapes)
        with pytest.warns(ExtrapolationWarning, match=r"movements 0 is 0\.24\d* off, 0\.56 % of their extent"):
            couple(learned[0], learned[7], (0.3, 0.7))
        enough = DMP(n_basis=8).learn(shapes)
        couple(enough[0], enough[7], (0.3, 0.7))  # warnings are errors
