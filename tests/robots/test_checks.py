"""Each check beside a value that is known: limits, torques of a pendulum, gaps between links, an orientation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from arm_samples import simple_arm
from kineme.robots import InfeasibleError, JointTrajectory, load, move, preflight
from kineme.robots.execution.joint_trajectory import approach
from kineme.robots.execution.preflight import along
from kineme.robots.kinematics.descent import TaskPath

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

GRAVITY = 9.81
LEVER, MASS, MOMENT = 0.2, 1.0, 0.01  # of each link of the simple arm


def checked(robot, positions, velocities=None, accelerations=None):
    """Checks of samples a hundredth of a second apart, by name and joint."""
    q = np.atleast_2d(positions) * np.ones((3, 1))
    v, a = (np.zeros_like(q) if values is None else values * np.ones((3, 1)) for values in (velocities, accelerations))
    q = q + np.array([[-0.01], [0.0], [0.01]]) * v
    report = preflight(robot, JointTrajectory(robot.joints, 0.01 * np.arange(3.0), q, v, a, {}))
    return {(check.what, check.where): check for check in report.checks}


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize(("beyond", "passes"), [(-1e-3, True), (1e-3, False)])
def test_a_joint_beyond_its_limit_fails(tmp_path, side, beyond, passes):
    robot = simple_arm(tmp_path)
    limit, sign = (robot.lower[0], robot.upper[0])[side], (-1, 1)[side]
    found = checked(robot, [limit + sign * beyond, 1.5])[("position", "j1")]
    assert found.passed is passes
    assert found.worst == pytest.approx(limit + sign * beyond)
    assert found.limit == limit


@pytest.mark.parametrize(("beyond", "passes"), [(0.999, True), (1.001, False)])
def test_velocities_and_accelerations_beyond_their_limits_fail(tmp_path, beyond, passes):
    robot = simple_arm(tmp_path)
    moving = checked(robot, [0.0, 1.5], velocities=[0.0, 2.0 * beyond])[("velocity", "j2")]
    pushed = checked(robot, [0.0, 1.5], accelerations=[5.0 * beyond, 0.0])[("acceleration", "j1")]
    for found in (moving, pushed):
        assert found.passed is passes
        assert found.worst / found.limit == pytest.approx(beyond)


def test_torques_are_those_of_a_pendulum_on_a_carousel(tmp_path):
    """``tau = (m l^2 + J) q'' + m l^2 w^2 sin(q) cos(q) - m g l cos(q)`` about the horizontal axis."""
    robot = simple_arm(tmp_path)
    for q, w, a in ((0.0, 0.0, 0.0), (0.7, 1.9, 0.0), (-0.7, 1.9, 0.0), (0.4, 0.0, 4.0), (1.2, -1.5, -3.0)):
        found = checked(robot, [0.3, q], velocities=[w, 0.0], accelerations=[0.0, a])[("torque", "j2")]
        inertia = MASS * LEVER**2
        expected = (inertia + MOMENT) * a + inertia * w**2 * np.sin(q) * np.cos(q) - MASS * GRAVITY * LEVER * np.cos(q)
        assert found.worst == pytest.approx(abs(expected), rel=1e-3, abs=1e-6)


def test_a_torque_says_how_much_slower_the_movement_has_to_be(tmp_path):
    weak = simple_arm(tmp_path, effort=2.0)
    holding, moving = -MASS * GRAVITY * LEVER, (MASS * LEVER**2 + MOMENT) * -4.0
    found = checked(weak, [0.0, 0.0], accelerations=[0.0, -4.0])[("torque", "j2")]
    assert not found.passed
    assert abs(holding + moving / found.slower**2) == pytest.approx(2.0, rel=1e-6)
    assert checked(simple_arm(tmp_path, effort=1.9), [0.0, 0.0])[("torque", "j2")].slower == np.inf


@pytest.mark.parametrize(("gap", "touches"), [(-0.01, True), (0.003, True), (0.008, False)])
def test_links_closer_than_five_millimeters_touch(tmp_path, gap, touches):
    """Balls of 10 cm, half a meter from the same point: ``2 * 0.5 sin(q / 2) = 0.2 + gap``."""
    report = checked(simple_arm(tmp_path), [0.0, 2 * np.arcsin(0.2 + gap)])
    contacts = [check for (what, _), check in report.items() if what == "self-collision"]
    assert contacts[0].passed is not touches


def _contacts(robot, posture):
    return next(check for (what, _), check in checked(robot, posture).items() if what == "self-collision")


def test_links_that_are_close_by_design_touch_only_where_they_do(tmp_path):
    """At rest 3 mm lie between the balls of one arm; of the other up to 3 mm in all postures, near one axis."""
    simple_arm(tmp_path)
    path, at_rest = tmp_path / "arm.urdf", 2 * np.arcsin(0.203)
    robot = load(path, rest=[0.0, at_rest])
    assert _contacts(robot, [0.0, at_rest]).passed
    assert not _contacts(robot, [0.0, 2 * np.arcsin(0.199)]).passed
    text = path.read_text().replace("0 1 0", "0 0 1").replace("0.5 0 0", "0.02 0 0.1985", 1)
    path.write_text(text.replace("0.5 0 0", "0.02 0 0"))
    assert _contacts(load(path), [0.1, 0.1]).passed


def gantry(folder):
    """Three joints that slide and three that turn half a radian to each side."""
    links = '<link name="l0"/>'
    for i, axis in enumerate(("1 0 0", "0 1 0", "0 0 1", "0 0 1", "0 1 0", "1 0 0"), 1):
        kind, most = ("prismatic", 1.0) if i <= 3 else ("revolute", 0.5)
        links += (
            f'<link name="l{i}"/><joint name="j{i}" type="{kind}"><parent link="l{i - 1}"/><child link="l{i}"/>'
            f'<axis xyz="{axis}"/><limit lower="{-most}" upper="{most}" velocity="1" effort="10"/></joint>'
        )
    path = folder / "gantry.urdf"
    path.write_text(f'<robot name="gantry">{links}</robot>')
    return load(path)


def test_an_orientation_that_is_not_reached_is_refused_unless_it_is_free(tmp_path):
    robot = gantry(tmp_path)
    u = np.linspace(0, 1, 100)[:, None]
    line = (10 * u**3 - 15 * u**4 + 6 * u**5) * [0.1, 0.2, 0.1]
    about_z = Rotation.from_rotvec([0, 0, 1.5]).as_quat(scalar_first=True)
    with pytest.raises(
        InfeasibleError, match=r"turned away of tip at .* s: 57\.\d, limit 1 deg. No speed helps: choose"
    ):
        move(line, robot, space="tip", orientation=about_z, timing="slowed")
    for follow in ("axis", "free"):
        made = move(line, robot, space="tip", orientation=about_z, timing="slowed", follow=follow)
        assert made.preflight.passed
    about_x = Rotation.from_rotvec([1.5, 0, 0]).as_quat(scalar_first=True)
    with pytest.raises(InfeasibleError, match="turned away"):
        move(line, robot, space="tip", orientation=about_x, timing="slowed", follow="axis")


def test_ends_in_motion_fail(tmp_path):
    robot = simple_arm(tmp_path)
    for speed, passes in ((0.0, True), (1e-6, False)):
        report = checked(robot, [0.0, 1.5], velocities=[0.0, speed])
        assert [one.passed for (what, _), one in report.items() if what == "standing at the ends"] == [passes]


def test_a_limit_that_is_passed_between_two_samples_only_fails(tmp_path):
    robot = simple_arm(tmp_path)
    q, v = np.array([[0.0, 1.99]] * 4), np.array([[0.0, 0.0], [0.0, 0.5], [0.0, -0.6], [0.0, 0.0]])
    report = preflight(robot, JointTrajectory(robot.joints, 0.2 * np.arange(4.0), q, v, 0 * v, {}))
    failed = {check.what: check for check in report.failed}
    assert "position" not in failed
    assert failed["position between samples"].where == "j2"
    assert 0.2 < failed["position between samples"].time < 0.4
    assert 0.4 < failed["acceleration between samples"].time < 0.6
    for side in (-1, 1):
        for beyond, passes in ((5e-7, True), (1e-5, False)):
            q = np.array([[0.0, 2.0 + beyond - 0.05 * 0.2 / 4]] * 2)  # a parabola from 0.05 rad/s to as much back
            v, a = np.array([[0.0, 0.05], [0.0, -0.05]]), np.full((2, 2), [0.0, -0.5])
            bent = JointTrajectory(robot.joints, np.array([0.0, 0.2]), side * q, side * v, side * a, {})
            between = {check.what: check for check in preflight(robot, bent).checks}["position between samples"]
            assert between.worst == pytest.approx(side * (2.0 + beyond), abs=1e-12)
            assert (between.limit, between.passed) == (2.0 * side, passes)


@pytest.mark.parametrize("speeds", [(0.0, 0.4), (0.4, 0.0)])
def test_no_joint_jumps_that_accelerates_evenly_over_a_gap(tmp_path, speeds):
    """Over half a second its mean velocity is that of both ends, which leads 0.1 rad on, whichever end is faster."""
    robot = simple_arm(tmp_path)
    v = np.column_stack((speeds, (0.0, 0.0)))
    q = np.array([[0.0, 1.0], [0.1, 1.0]])
    a = np.full((2, 2), [np.diff(speeds)[0] / 0.5, 0.0])
    report = preflight(robot, JointTrajectory(robot.joints, np.array([0.0, 0.5]), q, v, a, {}))
    (jump,) = (check for check in report.checks if check.what == "jump")
    assert jump.worst == pytest.approx(0.0, abs=1e-12)
    there = q + np.array([[0.0, 0.0], [0.06, 0.0]])
    report = preflight(robot, JointTrajectory(robot.joints, np.array([0.0, 0.5]), there, v, a, {}))
    assert "jump" in {check.what for check in report.failed}


@pytest.mark.parametrize(("off", "passes"), [(0.9e-3, True), (1.1e-3, False)])
def test_a_tip_beside_its_path_fails(tmp_path, off, passes):
    robot = simple_arm(tmp_path)
    still, times = np.tile([0.0, 1.5], (3, 1)), np.arange(3.0)
    trajectory = JointTrajectory(robot.joints, times, still, 0 * still, 0 * still, {})
    tips = along(robot, trajectory)
    path = TaskPath(times[1:], tips.tip_positions[1:] + np.array([0.0, off, 0.0]), tips.tip_rotations[1:])
    found = {check.what: check for check in preflight(robot, trajectory, path).checks}["tracking"]
    assert found.passed is passes
    assert found.worst == pytest.approx(1e3 * off)


def test_an_approach_takes_half_of_what_the_joints_can(tmp_path):
    robot = simple_arm(tmp_path)
    for end in ([1.9, 1.0], [0.01, 0.0], [-0.4, 0.3]):
        made = approach(robot, np.zeros(2), np.array(end), 1000.0)
        assert np.abs(made.velocities).max() <= 0.5 * 2.0 * (1 + 1e-9)
        assert np.abs(made.accelerations).max() <= 0.5 * 5.0 * (1 + 1e-9)
        np.testing.assert_allclose(
            np.gradient(made.positions, made.times, axis=0)[1:-1], made.velocities[1:-1], atol=1e-4
        )
        np.testing.assert_allclose(made.positions[[0, -1]], [[0, 0], end], atol=1e-12)
    for rate, lasts in ((1000.0, 0.003), (100.0, 0.03), (1.0, 0.5)):  # where it stands already: four samples
        assert approach(robot, np.zeros(2), np.full(2, 1e-7), rate).duration == pytest.approx(lasts)
