"""What a controller makes of a trajectory between its samples: limits and path are kept there, or it is refused."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly, CubicSpline

import kineme
from arm_samples import simple_arm, stroke
from kineme.errors import TrajectoryError
from kineme.robots import InfeasibleError, JointTrajectory, load, move, preflight
from kineme.robots.execution.joint_trajectory import (
    Torques,
    as_generated,
    between,
    dense_times,
    extreme,
    fastest,
    sampled,
)
from kineme.robots.execution.joint_trajectory import _by_length as by_length
from kineme.robots.execution.preflight import along
from soaking import SOAK, examples

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

_robot = lru_cache(load)


def fine_times(trajectory, parts):
    """Times of the samples, and of `parts` - 1 instants between each two."""
    t = trajectory.times
    return np.append(np.unique(np.concatenate([t[:-1] + np.diff(t) * k / parts for k in range(parts)])), t[-1])


def sent(robot, times, positions):
    """Samples of one joint after another that stand at each of them."""
    still = np.zeros_like(positions)
    return JointTrajectory(robot.joints, np.asarray(times, dtype=float), positions, still, still, {})


def test_it_is_the_polynomial_of_the_fifth_order():
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.1, 1, 6))
    q, v, a = rng.normal(size=(3, 6, 2))
    given = JointTrajectory(("a", "b"), times - times[0], q, v, a, {"grip": np.arange(6.0)}, ("rad", "m"))
    fine = fine_times(given, 7)
    curve = BPoly.from_derivatives(given.times, np.stack((q, v, a), axis=1))
    positions, velocities, accelerations = curve(fine), curve(fine, 1), curve(fine, 2)
    made = between(given, fine)
    assert made.units == given.units
    np.testing.assert_allclose(made.positions, positions, atol=1e-9)
    np.testing.assert_allclose(made.velocities, velocities, atol=1e-8)
    np.testing.assert_allclose(made.accelerations[:-1], accelerations[:-1], atol=1e-6)
    np.testing.assert_array_equal(made.steps["grip"], np.searchsorted(given.times, fine, "right") - 1)


@given(seed=st.integers(0, 2**32 - 1))
def test_an_extreme_between_samples_is_that_of_five_hundred_instants_in_each_gap(seed):
    rng = np.random.default_rng(seed)
    times = np.cumsum(np.append(0.0, rng.uniform(0.01, 1, rng.integers(1, 8))))
    q, v, a = rng.normal(size=(3, len(times), 2)) * rng.choice([0.1, 1.0, 10.0], (3, 1, 1))
    trajectory = JointTrajectory(("a", "b"), times, q, v, a, {})
    limits, centers = rng.uniform(0.5, 2, 2), rng.normal(size=2)
    followed = between(trajectory, fine_times(trajectory, 500))
    for order, values in enumerate((followed.positions - centers, followed.velocities, followed.accelerations)):
        largest = np.abs(values / limits).max()
        made = extreme(trajectory, order, limits, centers if order == 0 else 0.0)
        assert largest * (1 - 1e-9) <= abs(made.share) <= largest * 1.001


@pytest.mark.parametrize(("share", "passes"), [(1.0005, True), (1.0015, False)])
def test_an_acceleration_that_only_the_middle_of_a_gap_has_is_measured_as_it_is(tmp_path, share, passes):
    """From a stand to a stand in a second the polynomial has the acceleration ``10 / sqrt(3)`` times the distance."""
    robot = simple_arm(tmp_path)
    there = robot.rest.copy()
    there[0] += share * robot.acceleration[0] * np.sqrt(3) / 10
    (check,) = (
        one
        for one in preflight(robot, sent(robot, [0.0, 1.0], np.array([robot.rest, there]))).checks
        if one.what == "acceleration between samples"
    )
    assert check.worst / check.limit == pytest.approx(share, rel=1e-6)
    assert check.slower == pytest.approx(np.sqrt(share), rel=1e-6)
    assert check.passed is passes


@settings(max_examples=examples(2), deadline=None)
@given(
    name=st.sampled_from(["panda", "ur5e", "wam", "so101"]),
    rate=st.sampled_from([1.0, 3.0, 10.0, 25.0, 100.0, 1000.0, 10_000.0]),
    seconds=st.floats(0.05, 8.0),
    timing=st.sampled_from(["generated", "slowed", "fastest"]),
)
def test_at_every_rate_limits_and_path_are_kept_between_samples_or_it_is_refused(name, rate, seconds, timing):
    robot = _robot(name)
    try:
        made = move(stroke(robot, seconds), robot, timing=timing, rate=rate)
    except TrajectoryError:
        return
    times = fine_times(made.trajectory, 4)
    followed = between(made.trajectory, times)
    q, v = followed.positions, followed.velocities
    assert np.all((q >= robot.lower - 2e-6) & (q <= robot.upper + 2e-6))
    assert np.all(np.abs(v) <= 1.001 * robot.velocity)
    assert np.all(np.abs(followed.accelerations) <= 1.002 * robot.acceleration)
    assert np.abs(made.trajectory.velocities[[0, -1]]).max() < 1e-7  # what controllers of ROS take as standing
    q = q[times >= made.begins]
    some = q[:: max(1, len(q) // 300)]
    still = np.zeros_like(some)
    tips = along(robot, JointTrajectory(robot.joints, np.arange(len(some)), some, still, still, {})).tip_positions
    wanted = stroke(robot, n=3000).positions
    away = [np.linalg.norm(wanted - tip, axis=1).min() for tip in tips]
    assert max(away) < 1.5e-3


@pytest.mark.parametrize("step", [0.002, 0.01, 0.049][:: 1 if SOAK else 2])
def test_a_joint_that_jumps_between_two_samples_is_refused(step):
    robot = _robot("panda")
    times = np.arange(0, 0.4, 1e-4)
    joints = np.tile(robot.rest, (len(times), 1))
    joints[times > 0.20503, 0] += step
    jumping = kineme.Trajectory(times=times, positions=joints)
    with pytest.raises(InfeasibleError, match=r"acceleration between samples of panda_joint1"):
        move(jumping, robot, space="joints")


def test_a_joint_that_is_too_fast_between_two_samples_at_which_it_stands_is_seen():
    robot = _robot("panda")
    there = robot.rest.copy()
    there[0] += 0.8 * robot.velocity[0]  # in a second: 1.5 times the limit in the middle
    failed = preflight(robot, sent(robot, [0.0, 1.0], np.array([robot.rest, there]))).failed
    assert {"velocity between samples"} == {check.what for check in failed if check.what.startswith("velocity")}


def test_between_two_postures_that_are_looked_at_no_joint_moves_far_and_a_jump_costs_no_more_than_its_speed():
    robot = _robot("panda")
    there = robot.rest + np.linspace(0.2, 0.8, 7) * robot.velocity
    slow = sent(robot, [0.0, 1.0, 3.0], np.array([robot.rest, there, robot.rest]))
    seen = between(slow, dense_times(robot, slow)).positions
    assert 0.02 < np.abs(np.diff(seen, axis=0)).max() < 0.05 * 1.9  # the speed in the middle is 1.875 times the mean
    jump = sent(robot, [0.0, 1.0], np.array([robot.rest, robot.rest + 1e9]))
    assert len(dense_times(robot, jump)) <= 1 + np.ceil(robot.velocity.max() / 0.05)


def test_a_learned_movement_begins_and_ends_at_a_stand_at_every_rate():
    robot = _robot("panda")
    primitive = kineme.DMP().learn([stroke(robot)])
    for rate in (100.0, 10_000.0 if SOAK else 1000.0):
        t = move(primitive, robot, rate=rate).trajectory
        assert np.abs(t.velocities[[0, -1]]).max() < 1e-7
        accelerations = np.diff(t.velocities, axis=0) / np.diff(t.times)[:, None]
        assert np.all(np.abs(accelerations) <= robot.acceleration)


def test_ramps_take_half_of_the_acceleration_and_half_of_their_time_more(tmp_path):
    robot = simple_arm(tmp_path)
    t, speeds = np.linspace(0, 1, 5), np.array([0.2, 0.05]) * robot.acceleration
    timed = as_generated(robot, CubicSpline(t, np.outer(t, speeds)), 2000.0)
    ramp = 1.5 * 0.2 / 0.5  # s: the steepest slope of 3 x^2 - 2 x^3 is 1.5
    shares = timed.trajectory.accelerations / robot.acceleration
    np.testing.assert_allclose(shares.max(axis=0), [0.5, 0.125], rtol=1e-3)
    np.testing.assert_allclose(shares.min(axis=0), [-0.5, -0.125], rtol=1e-3)
    assert timed.trajectory.duration == pytest.approx(1.0 + ramp)


def test_the_path_by_its_length_is_the_path_however_long_it_is(tmp_path):
    """More than ten times as far as the joints pass in a second."""
    t = np.linspace(0, 4, 800)
    path = CubicSpline(t, np.column_stack((0.8 * np.sin(3 * np.pi * t), 0.4 * np.cos(2.5 * np.pi * t))))
    curve, generated, lengths = by_length(simple_arm(tmp_path), path)
    assert lengths[-1] > 10
    np.testing.assert_allclose(curve(lengths), path(generated), atol=1e-4)


def test_the_fastest_timing_takes_the_whole_of_a_torque_and_no_more(tmp_path):
    pytest.importorskip("toppra")
    robot, t = simple_arm(tmp_path, effort=0.15, mass=0.5), np.linspace(0, 1, 5)
    turning = fastest(robot, CubicSpline(t, np.column_stack((t, np.full(5, -1.7)))))
    sent, torques = sampled(robot, turning, 500.0).trajectory, Torques(robot)
    needed = [torques.of(*one) for one in zip(sent.positions, sent.velocities, sent.accelerations, strict=True)]
    assert np.abs(needed).max() == pytest.approx(0.15, rel=3e-3)
    assert torques.exceeded(np.array([0.0, -0.151]))
    assert not torques.exceeded(np.array([0.149, -0.149]))


def test_the_fastest_timing_of_a_straight_line_says_where_it_is_within_all_limits(tmp_path):
    pytest.importorskip("toppra")
    robot = simple_arm(tmp_path)
    t = np.linspace(0, 1, 5)
    path = CubicSpline(t, np.outer(t, [1.0, 0.5]))
    timed = sampled(robot, fastest(robot, path), 10.0)
    np.testing.assert_allclose(timed.trajectory.positions, path(timed.generated), atol=1e-9)
    for rates, limits in (
        (timed.trajectory.velocities, robot.velocity),
        (timed.trajectory.accelerations, robot.acceleration),
    ):
        assert (np.abs(rates) <= limits * (1 + 1e-9)).all()
    v, a = robot.velocity[0], robot.acceleration[0]
    least = 2 * np.sqrt(1 / a) if a <= v**2 else 1 / v + v / a
    assert least <= timed.trajectory.duration <= 1.02 * least + 3 / 10


def test_links_that_pass_through_one_another_between_two_samples_are_seen(tmp_path):
    robot = simple_arm(tmp_path)
    low, high = robot.rest.copy(), robot.rest.copy()
    low[1], high[1] = -1.4, 1.4
    report = preflight(robot, sent(robot, [0.0, 30.0], np.array([low, high])))
    assert [check.what for check in report.failed] == ["self-collision", "jump"]


def test_a_refusal_for_too_few_samples_says_a_rate_that_works():
    robot = _robot("panda")
    with pytest.raises(InfeasibleError, match=r"Choose a higher rate, as of 20 samples per second") as caught:
        move(stroke(robot, 3.0), robot, rate=2.0)
    assert all(
        check.what.endswith("between samples") or check.what == "jump" for check in caught.value.preflight.failed
    )
    move(stroke(robot, 3.0), robot, rate=20.0)


BACKWARDS = tuple(f"{j}_joint" for j in ("wrist_3", "wrist_2", "wrist_1", "elbow", "shoulder_lift", "shoulder_pan"))


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"times": np.array([0.0, 1.0, 1.0, 2.0])}, "times increase"),
        ({"times": np.array([0.0, 1.0, np.nan, 2.0])}, "finite numbers"),
        ({"velocities": np.full((4, 6), np.inf)}, "finite numbers"),
        ({"accelerations": np.zeros((3, 6))}, r"accelerations of shape \(4, 6\)"),
        ({"positions": np.zeros((4, 7))}, r"positions of shape \(4, 6\)"),
        ({"positions": [[0.0] * 7] * 4}, r"positions of shape \(4, 6\)"),
        ({"times": np.arange(4.0) - 1}, "times increase from 0"),
        ({"joints": BACKWARDS}, "joints of ur5e, shoulder_pan_joint, .*, in this order, got wrist_3_joint, wrist_2"),
        ({"joints": ()}, "wrist_3_joint, in this order, got none"),
        ({"units": ("deg",) * 6}, "units of ur5e, rad, .* got deg, deg"),
        ({"steps": {"gripper": [0.0] * 3}}, r"steps of gripper of shape \(4,\), one for each sample"),
        ({"steps": {"gripper": np.full(4, np.nan)}}, "finite numbers"),
    ],
)
def test_what_is_no_trajectory_of_the_arm_is_not_checked_but_refused(changed, words):
    robot = _robot("ur5e")
    zeros = np.zeros((4, 6))
    arrays = {"times": np.arange(4.0), "positions": zeros, "velocities": zeros, "accelerations": zeros}
    with pytest.raises(TrajectoryError, match=words):
        preflight(robot, JointTrajectory(**({"joints": robot.joints, "steps": {}} | arrays | changed)))
