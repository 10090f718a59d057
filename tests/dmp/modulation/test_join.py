"""Movements one after another, and one turning into another."""

from __future__ import annotations

import numpy as np
import pytest

import kineme
from kineme import DMP, blend, join
from kineme.dmp import Primitives
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import SpecificationError, TrajectoryError


@pytest.fixture(scope="module")
def parts():
    return [DMP().learn(kineme.load_lasa([name]))[1] for name in ("GShape", "Sine", "Worm")]


def at(primitive, u):
    """Position at normalized times, from many samples."""
    path = primitive.rollout(n_samples=4001).positions[0]
    return np.column_stack([np.interp(u, np.linspace(0, 1, 4001), x) for x in path.T])


def deviations(joined, parts, begins):
    """From the parts, each moved to where it begins in the joined movement, as shares of the extent of the whole."""
    movement = joined.rollout(n_samples=3001)
    times, path = movement.times[0], movement.positions[0]
    extent = np.ptp(path, axis=0).max()
    for part, begin in zip(parts, begins, strict=True):
        inside = (times >= begin) & (times <= begin + part.durations[0])
        expected = at(part, (times[inside] - begin) / part.durations[0])
        yield np.linalg.norm(path[inside] - expected, axis=1).max() / extent


def chained(parts):
    """Each part moved to where the one before it ends."""
    made, start = [], parts[0].starts
    for one in parts:
        made.append(Primitives.from_rollout(one.rollout(start, one.goals + start - one.starts)))
        start = made[-1].rollout().positions[:, -1]
    return made


def test_it_is_the_parts_one_after_another(parts):
    """0.4 % of the extent from each, all along, the joints included."""
    joined = join(parts, shift=True)
    durations = np.array([one.durations[0] for one in parts])
    assert joined.durations[0] == pytest.approx(durations.sum())
    assert max(deviations(joined, chained(parts), np.cumsum([0.0, *durations[:-1]]))) < 0.004


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("fit", ["trajectory", "forcing"])
def test_start_goal_and_their_velocities_are_those_of_the_parts(formulation, fit):
    one, other = (DMP(formulation, fit=fit).learn(kineme.load_lasa([name]))[0] for name in ("CShape", "NShape"))
    joined, chain = join([one, other], shift=True), chained([one, other])
    first, last, whole = chain[0].rollout(), chain[1].rollout(), joined.rollout()
    unit = 1e-8 * np.abs(whole.positions).max()
    np.testing.assert_allclose(whole.positions[0, 0], first.positions[0, 0], atol=unit)
    np.testing.assert_allclose(whole.positions[0, -1], last.positions[0, -1], atol=unit)
    np.testing.assert_allclose(whole.velocities[0, 0], first.velocities[0, 0], atol=unit)
    np.testing.assert_allclose(whole.velocities[0, -1], last.velocities[0, -1], atol=unit)


@pytest.mark.parametrize("overlap", [0.0, 0.3])
def test_velocity_and_acceleration_are_continuous(parts, overlap):
    """Their largest step falls in proportion to the time between samples; of a jump it would stay."""
    joined = join(parts, overlap=overlap)
    steps = []
    for n in (4001, 8001):
        movement = joined.rollout(n_samples=n)
        steps.append([np.abs(np.diff(x[0], axis=0)).max() for x in (movement.velocities, movement.accelerations)])
    assert np.all(np.array(steps[1]) < 0.55 * np.array(steps[0]))


def test_accelerations_are_no_larger_than_those_of_the_parts(parts):
    largest = max(np.abs(one.rollout().accelerations).max() for one in chained(parts))
    assert np.abs(join(parts, shift=True).rollout().accelerations).max() < 1.1 * largest


def test_goals_stay_unless_they_are_shifted(parts):
    moved = [
        Primitives.from_rollout(one.rollout(one.starts + 20.0 * i, one.goals + 20.0 * i)) for i, one in enumerate(parts)
    ]
    last = moved[-1].rollout().positions[0, -1]
    kept, shifted = join(moved).rollout(), join(moved, shift=True).rollout()
    np.testing.assert_allclose(kept.positions[0, -1], last, atol=1.5)
    assert np.linalg.norm(shifted.positions[0, -1] - last) > 20


def test_an_overlap_is_shorter_and_cuts_the_corner(parts):
    joined, cut = join(parts, shift=True), join(parts, shift=True, overlap=0.4)
    assert cut.durations[0] == pytest.approx(joined.durations[0] - 0.8)
    slowest = [
        np.linalg.norm(one.rollout(n_samples=2001).velocities[0, 200:-200], axis=1).min() for one in (joined, cut)
    ]
    assert slowest[1] > 1.2 * slowest[0]


def test_the_result_is_a_primitive_like_others(parts, tmp_path):
    joined = join([parts[0].rollout(via=[(0.5, at(parts[0], [0.5])[0] + 3.0)]), parts[1]])
    again = Primitives.load(joined.save(tmp_path / "joined.npz"))
    movement = again.rollout(duration=2.0, n_samples=101)
    controller = again.controller(0.02, duration=2.0)
    for k in range(1, 101):
        state = controller.step()
        np.testing.assert_allclose(state.position, movement.positions[0, k], atol=1e-7)
    known = [again.rollout().positions[0], parts[2].rollout().positions[0]]
    assert kineme.Recognizer().fit(known, ["both", "worm"]).predict(joined.rollout().positions)[0] == "both"


def test_a_batch_is_its_members_one_by_one():
    many, one = DMP().learn(kineme.load_lasa(["Angle"])[:4]), DMP().learn(kineme.load_lasa(["Line"]))[0]
    together = join([many, one], overlap=0.1)
    assert len(together) == len(many)
    for i in range(len(many)):  # together they have as many basis functions as the one with most needs
        alone = join([many[i], one], overlap=0.1).rollout(n_samples=300).positions[0]
        extent = np.ptp(alone, axis=0).max()
        np.testing.assert_allclose(together[i].rollout(n_samples=300).positions[0], alone, rtol=0, atol=0.003 * extent)
    mixed = blend(many, one, (0.2, 0.8))
    alone = blend(many[3], one, (0.2, 0.8))
    np.testing.assert_allclose(mixed[3].rollout().positions, alone.rollout().positions, atol=1e-7)


class TestBlend:
    def test_it_is_the_one_before_and_the_other_after(self, parts):
        first, second = parts[0], parts[1]
        mixed = blend(first, second, (0.4, 0.6))
        u = np.linspace(0, 1, 1001)
        path = mixed.rollout(n_samples=4001)
        pace = np.interp(u, [0, 0.4, 0.6, 1], [first.durations[0]] * 2 + [second.durations[0]] * 2)
        times = np.concatenate(([0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]) / 1000)))
        ours = np.column_stack([np.interp(times, path.times[0], x) for x in path.positions[0].T])
        extent = np.ptp(ours, axis=0).max()
        assert np.abs(ours[:380] - at(first, u[:380])).max() < 0.01 * extent
        assert np.abs(ours[620:] - at(second, u[620:])).max() < 0.01 * extent
        assert mixed.durations[0] == pytest.approx(times[-1], rel=1e-3)

    def test_the_tempo_changes_from_one_to_the_other(self):
        """Of the rise from 0 to 1 the integral is the rest from the middle of the stretch on."""
        path = np.column_stack((np.linspace(0, 1, 50), np.linspace(0, 2, 50)))
        slow, quick = (DMP().learn([kineme.Trajectory(np.linspace(0, end, 50), path)]) for end in (4.0, 1.0))
        mixed = blend(slow, quick, (0.2, 0.6))
        np.testing.assert_allclose(mixed.durations, 4.0 * 0.4 + 1.0 * 0.6, rtol=1e-6)

    def test_of_a_movement_with_itself_it_is_the_movement(self, parts):
        same = blend(parts[0], parts[0], (0.3, 0.5)).rollout(n_samples=200).positions
        np.testing.assert_allclose(same, parts[0].rollout(n_samples=200).positions, atol=0.05)

    @pytest.mark.parametrize("stretch", [(0.5, 0.5), (0.6, 0.4), (-0.1, 0.5), (0.5, 1.1), 0.5, "ab", (0.1, 0.2, 0.3)])
    def test_a_stretch_within_the_movement(self, parts, stretch):
        with pytest.raises(SpecificationError, match="expected stretch"):
            blend(parts[0], parts[1], stretch)


class TestRefusals:
    def test_what_is_no_list_of_movements(self, parts):
        for wrong in ([], parts[0]):
            with pytest.raises(TrajectoryError, match=r"expected several movements, as \[reach, pour\]"):
                join(wrong)
        with pytest.raises(TrajectoryError, match="expected Primitives or Rollout as part 1, got ndarray"):
            join([parts[0], np.zeros((10, 2))])

    def test_dimensions_and_numbers_go_together(self, parts):
        flat = DMP().learn([np.linspace(0, 1, 50) ** 2])
        with pytest.raises(TrajectoryError, match="part 1: expected 2 dimensions as in part 0, got 1"):
            join([parts[0], flat])
        many = Primitives.concatenate([parts[0]] * 3)
        with pytest.raises(TrajectoryError, match="part 0: expected one movement or 3, got 2"):
            join([many[:2], many])

    @pytest.mark.parametrize("overlap", [-0.1, 50.0, np.nan])
    def test_overlaps(self, parts, overlap):
        with pytest.raises(SpecificationError, match="overlap"):
            join(parts, overlap=overlap)
