"""Two arms of which one or both were shown several times: they give as their demonstrations differ."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import DMP, couple, join
from kineme.dmp import Primitives
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import TrajectoryError
from kineme.styles import average


@pytest.fixture(scope="module")
def shapes():
    return kineme.load_lasa(["Line", "Angle"])


def paths(pair, n_samples=401):
    return [one.rollout(n_samples=n_samples).positions for one in pair]


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("which", ["both", "left", "right"])
def test_the_difference_is_kept_and_starts_and_goals_with_their_velocities(shapes, formulation, which):
    learned = DMP(formulation).learn(shapes)
    arms = [learned[:1], learned[7:8]]
    if which in {"both", "left"}:
        arms[0] = average(learned[:7])
    if which in {"both", "right"}:
        arms[1] = average(learned[7:])
    pair = couple(*arms, during=(0.3, 0.7), offset=[3.0, np.nan])
    means = [getattr(one, "primitive", one) for one in arms]
    before, after = paths([Primitives.from_rollout(one.rollout()) for one in means]), paths(pair)
    np.testing.assert_allclose((after[1] - after[0])[:, 120:281, 0], 3.0, atol=1e-3)
    extent = max(np.ptp(one, axis=1).max() for one in before)
    for old, new in zip(means, pair, strict=True):
        one, other = old.rollout(duration=new.durations), new.rollout()
        np.testing.assert_array_equal(other.positions[:, 0], one.positions[:, 0])
        np.testing.assert_allclose(other.positions[:, -1], one.positions[:, -1], atol=1e-6 * extent)
        np.testing.assert_allclose(other.velocities[:, -1], one.velocities[:, -1], atol=1e-5 * extent)


def test_the_arm_that_was_shown_alike_lets_the_other_give(shapes):
    learned = DMP().learn(shapes)
    varied, one = average(learned[7:]), learned[:1]
    middle = one.rollout(n_samples=3).positions[0, 1]
    alike = Primitives.concatenate([one, Primitives.from_rollout(one.rollout(via=[(0.5, middle + 0.01)]))])
    before = paths([one, varied.primitive])
    given = []
    for left in (average(alike), one):
        after = paths(couple(left, varied, during=(0.3, 0.7), offset=[3.0, 0.0]))
        given.append([np.abs(new - old).max() for new, old in zip(after, before, strict=True)])
    assert given[0][0] < 0.01 * given[0][1]  # what varies gives, what does not stays
    assert given[1][0] > 0.1 * given[1][1]  # shown once, nothing says that it stays


def test_without_spread_it_is_the_primitive(shapes):
    learned = DMP().learn(shapes)
    alone = couple(average(learned[:1]), average(learned[7:8]), during=(0.3, 0.7))
    for one, other in zip(paths(alone), paths(couple(learned[0], learned[7], during=(0.3, 0.7))), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_a_batch_is_its_pairs_one_by_one(shapes):
    learned = DMP("decoupled", n_basis=25).learn(shapes)
    left, rights = average(learned[:7]), learned[7:]
    offsets = np.random.default_rng(0).normal(size=(7, 2))
    offsets[::2, 1] = np.nan
    together = paths(couple(left, rights, during=(0.4, 0.6), offset=offsets))
    for i in (0, 3, 6):
        alone = paths(couple(left, rights[i], during=(0.4, 0.6), offset=offsets[i]))
        for one, other in zip(together, alone, strict=True):
            np.testing.assert_allclose(one[i], other[0], atol=1e-6)


def test_arms_with_different_specifications_go_together(shapes):
    left = average(DMP(n_basis=30).learn(shapes)[:7])
    right = average(DMP("original", n_basis=50, gating="phase", n_points=300).learn(shapes)[7:])
    after = paths(couple(left, right, during=(0.3, 0.7), offset=[3.0, 1.0]))
    np.testing.assert_allclose((after[1] - after[0])[0, 120:281], np.tile([3.0, 1.0], (161, 1)), atol=5e-3)


def test_an_average_is_no_part_of_a_join(shapes):
    known = average(DMP().learn(shapes)[:7])
    with pytest.raises(TrajectoryError, match=r"got AveragePrimitive; pass its primitive"):
        join([known, known.primitive])


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_the_controller_of_what_an_average_does_moves_as_it(shapes, formulation):
    """The covariance is in the path; `average.primitive.controller(via=...)` does not know of it."""
    known = average(DMP(formulation).learn(shapes)[:7])
    point = known.rollout(n_samples=11).positions[0, 4] + [2.0, 3.0]
    path = known.rollout(via=[(0.4, point)], end_velocity=[3.0, 0.0], n_samples=51)
    controller = Primitives.from_rollout(path).controller(path.times[0, 1])
    states = [controller.state.position] + [controller.step().position for _ in range(50)]
    np.testing.assert_allclose(states, path.positions[0], atol=1e-7)
    smooth = known.primitive.rollout(via=[(0.4, point)], end_velocity=[3.0, 0.0], n_samples=51)
    assert np.abs(smooth.positions - path.positions).max() > 0.1
