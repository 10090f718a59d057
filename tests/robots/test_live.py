"""An arm under live control: what it is told, what it may do, and an arm in MuJoCo that follows."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import kineme
from arm_samples import simulated, standing, stroke, tip_in
from kineme.control import ObstacleAvoidance, Status
from kineme.errors import SpecificationError, TrajectoryError
from kineme.orientation import PoseDMP
from kineme.robots import ArmController, load, move
from kineme.robots.execution.preflight import along

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

DT = 0.01


def primitive(robot, seconds=3.0):
    return kineme.DMP().learn([stroke(robot, seconds)])


def run(arm, n, **told):
    """All states, with the joints and velocities of all steps."""
    states = [arm.step(**told) for _ in range(n)]
    return states, np.array([s.joints for s in states]), np.array([s.velocities for s in states])


def check_within_limits(robot, joints, velocities):
    assert np.all((joints >= robot.lower - 1e-9) & (joints <= robot.upper + 1e-9))
    assert np.all(np.abs(velocities) <= robot.velocity * (1 + 1e-6))


@pytest.mark.parametrize("name", ["panda", "ur5e", "wam"])
def test_undisturbed_it_follows_the_rollout(name):
    robot = load(name)
    moving = primitive(robot)
    arm = ArmController(robot, moving.controller(DT))
    states, joints, velocities = run(arm, 300)
    check_within_limits(robot, joints, velocities)
    assert max(state.distance for state in states) < 1e-4
    np.testing.assert_allclose(standing(robot, joints[-1]).tip_positions[0], moving.goals[0], atol=2e-3)


def test_a_goal_that_moves_is_followed_within_the_limits():
    robot = load("panda")
    arm = ArmController(robot, primitive(robot).controller(DT, goal_filter=0.2))
    goal = arm.controller.state.goal + np.array([0.05, -0.1, 0.05])
    _, before, first = run(arm, 150)
    states, after, second = run(arm, 900, goal=goal)
    check_within_limits(robot, np.vstack((before, after)), np.vstack((first, second)))
    np.testing.assert_allclose(standing(robot, after[-1]).tip_positions[0], goal, atol=1e-3)
    assert states[-1].movement.status & Status.SETTLED


def test_the_tip_steers_around_an_obstacle():
    robot = load("panda")
    moving = primitive(robot)
    point = moving.rollout().positions[0, 100] + [0.0, 0.0, 0.01]

    def nearest(**told):
        arm = ArmController(robot, moving.controller(DT, avoidance=ObstacleAvoidance()))
        _, joints, velocities = run(arm, 300, **told)
        check_within_limits(robot, joints, velocities)
        return np.linalg.norm(standing(robot, joints).tip_positions - point, axis=1).min()

    assert nearest(obstacles=[point]) > 2 * nearest()


def test_a_movement_that_is_too_fast_waits_for_the_arm():
    robot = load("ur5e", max_velocity=0.3)
    moving = primitive(robot, 0.5)

    def farthest(**options):
        arm = ArmController(robot, moving.controller(0.005, **options))
        states, joints, velocities = run(arm, 1600)
        check_within_limits(robot, joints, velocities)
        return max(state.distance for state in states), states[-1]

    waiting, last = farthest(feedback="phase", phase_stopping=2e4)
    ahead, _ = farthest()
    assert waiting < ahead / 4
    assert last.distance < 1e-3


def test_poses_turn_the_tip():
    robot = load("wam")
    there = stroke(robot)
    arm = ArmController(robot, primitive(robot).controller(DT))
    q = np.array([0.0, 1.0, 0.0, 0.0])
    poses = np.column_stack((there.positions, np.tile(q, (len(there.times), 1))))
    turned = PoseDMP().learn([poses]).controller(DT, duration=3.0)
    states, joints, velocities = run(ArmController(robot, turned), 300)
    check_within_limits(robot, joints, velocities)
    assert max(state.distance for state in states) < 1e-3
    assert arm.step().distance < 1e-3


def test_a_start_out_of_reach_and_other_columns_are_refused():
    robot = load("panda")
    there = stroke(robot)
    moving = primitive(robot)
    with pytest.raises(TrajectoryError, match=r"does not reach the start of the movement, .* its tip stays \d"):
        ArmController(robot, moving.controller(DT, start=there.positions[0] + 2.0))
    flat = kineme.DMP().learn([there.positions[:, :2]])
    with pytest.raises(TrajectoryError, match="expected a controller of three positions, or of poses"):
        ArmController(robot, flat.controller(DT))
    with pytest.raises(SpecificationError, match="expected start as 7 finite numbers"):
        ArmController(robot, moving.controller(DT), start=np.zeros(6))
    with pytest.raises(SpecificationError, match="panda_joint1 to start within"):
        ArmController(robot, moving.controller(DT), start=robot.rest + 5.0)
    with pytest.raises(SpecificationError, match="expected no dt"):
        ArmController(robot, moving.controller(DT)).step(dt=0.1)


@pytest.mark.parametrize(
    ("heads", "refused"),
    [
        ([f"panda_joint{k}" for k in range(1, 8)], "got the angles panda_joint1, .*space='joints'"),
        (["x", "y", "yaw"], "got the angles yaw"),
        (["z", "y", "x"], "x, y, z .* in this order, .* got z, y, x"),
        (["x [ft]", "y [ft]", "z [ft]"], r"x, y, z \[m\] .* got x \[ft\], y \[ft\], z \[ft\]; learn .* in meters"),
        (["qx", "qy", "qz", "qw", "z", "y", "x"], "in this order, .* got z, y, x, qx"),
        (None, "a position and a unit quaternion, got a norm of 2"),
        (["x", "y", "z"], None),
        (["tip_x [m]", "tip_y [m]", "tip_z [m]"], None),
        (["qx", "qy", "qz", "qw", "x", "y", "z"], None),
    ],
)
def test_what_is_no_tip_in_meters_in_order_is_refused(heads, refused, tmp_path):
    """Columns were read as x, y, z and w, x, y, z whatever they are: joints went to their stops."""
    robot = load("panda")
    place = np.linspace([0.4, -0.1, 0.4], [0.4, 0.1, 0.45], 30)
    turned = np.tile([1.0, 0.0, 0.0, 0.0], (30, 1))  # x, y, z, w: points down
    posed = heads is not None and "qx" in heads
    columns = np.hstack((turned, place) if posed else (place, turned))[:, : len(heads or range(7))]
    learned = [kineme.Trajectory(np.linspace(0, 3, 30), columns * ([1.0] * 3 + [2.0] * 4))] if heads is None else None
    if heads is not None:
        rows = np.column_stack((np.linspace(0, 3, 30), columns))
        np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=",".join(("time", *heads)), comments="")
        learned = kineme.read_recordings(tmp_path / "a.csv").demonstrations
    controller = (PoseDMP() if posed else kineme.DMP()).learn(learned).controller(DT)
    if refused is None:
        _, joints, _ = run(ArmController(robot, controller), 300)
        np.testing.assert_allclose(standing(robot, joints[-1]).tip_positions[0], place[-1], atol=2e-3)
    else:
        with pytest.raises(TrajectoryError, match=refused):
            ArmController(robot, controller)


def test_a_simulated_panda_follows_the_slowed_trajectory():
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    robot = load("panda")
    made = move(stroke(robot, 0.8), robot, timing="slowed", rate=1000.0)
    assert made.factor > 1
    arm = simulated(mujoco, robot)
    arm.opt.timestep = 0.001
    arm.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(arm)
    stiffness = np.array([600.0, 600.0, 600.0, 600.0, 250.0, 150.0, 50.0])  # as those of the maker's controller
    damping = np.array([50.0, 50.0, 50.0, 20.0, 20.0, 20.0, 10.0])
    t = made.trajectory
    data.qpos[:] = t.positions[0]
    wanted = along(robot, t).tip_positions
    off = np.empty(len(t))
    for k in range(len(t)):
        mujoco.mj_forward(arm, data)
        off[k] = np.linalg.norm(tip_in(mujoco, arm, data, robot)[0] - wanted[k])
        push = stiffness * (t.positions[k] - data.qpos) + damping * (t.velocities[k] - data.qvel)
        data.qfrc_applied[:] = np.clip(push + data.qfrc_bias, -robot.effort, robot.effort)
        mujoco.mj_step(arm, data)
    assert off.max() < 0.01


def test_an_arm_is_not_pickled_but_says_that_each_process_makes_it():
    robot = load("panda")
    with pytest.raises(SpecificationError, match="expected a robot and a controller to be pickled"):
        pickle.dumps(ArmController(robot, primitive(robot).controller(DT)))
