"""An arm in MuJoCo: it follows, grips, carries and lets go; it is pushed, watched and stopped within its limits."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from arm_samples import simulated, standing, stroke, tip_in
from kineme import Trajectory
from kineme.errors import SpecificationError
from kineme.robots import InfeasibleError, Simulation, load, move
from kineme.robots.execution.preflight import preflight
from kineme.robots.simulation import brake

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")


@cache
def panda():
    return load("panda")


def place(simulation, name="cup"):
    state = simulation.state()
    return np.array([state[f"{name}_{axis}"] for axis in "xyz"])


def way(simulation, *points, seconds=1.0, **steps):
    """A movement from where the arm stands through points, at rest in each; `steps` as it leaves each of them."""
    begin = place(simulation, "tip")
    u = np.linspace(0, 1, 51)[1:, None]
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    path = [begin[None]]
    for point in points:
        path.append(path[-1][-1] + s * (np.asarray(point) - path[-1][-1]))
    positions = np.concatenate(path)
    times = np.linspace(0, seconds * len(points), len(positions))
    channels = {name: np.repeat(values, [*[50] * len(points), 1]) for name, values in steps.items()}
    return move(Trajectory(times=times, positions=positions), simulation.robot, start=simulation.joints, steps=channels,
                timing="slowed")  # fmt: skip


@pytest.mark.parametrize("name", ["panda", "ur5e", "so101"])
def test_the_simulated_arm_is_that_of_its_urdf(name):
    """MuJoCo reads the same file by itself: tip, and torques at rest and in motion, agree."""
    robot = load(name)
    arm = simulated(mujoco, robot)
    data, random = mujoco.MjData(arm), np.random.default_rng(3)
    for _ in range(3):
        q = robot.lower + random.uniform(0.2, 0.8, robot.n_joints) * (robot.upper - robot.lower)
        simulation = Simulation(robot, start=q)
        data.qpos[:], data.qvel[:] = q, random.normal(size=robot.n_joints)
        mujoco.mj_forward(arm, data)
        np.testing.assert_allclose(place(simulation, "tip"), tip_in(mujoco, arm, data, robot)[0], atol=1e-6)
        simulation._data.qvel[:] = data.qvel
        mujoco.mj_forward(simulation._model, simulation._data)
        np.testing.assert_allclose(
            simulation._data.qfrc_bias, data.qfrc_bias, atol=0.02
        )  # it gives links without mass a gram


def test_the_tip_follows_within_half_a_millimeter():
    simulation = Simulation(panda())
    movement = move(stroke(panda()), panda(), timing="slowed")
    run = simulation.run(movement)
    assert run.stopped is None
    assert run.tip_error < 5e-4
    assert 0.05 < run.effort < 1
    wanted = [np.interp(run.times, movement.path.times - movement.begins, x) for x in movement.path.positions.T]
    assert np.linalg.norm(run.tips - np.transpose(wanted), axis=1)[run.times >= 0].max() < 1e-3
    np.testing.assert_allclose(run.tips[-1], movement.path.positions[-1], atol=1e-4)
    np.testing.assert_allclose(simulation.joints, movement.trajectory.positions[-1], atol=1e-12)
    assert simulation.time == pytest.approx(movement.trajectory.duration + 0.2, abs=0.005)


def test_a_cup_is_gripped_carried_and_left_where_it_is():
    cup, there = np.array([0.45, 0.1, 0.3]), np.array([0.4, -0.2, 0.4])
    simulation = Simulation(panda(), {"cup": cup, "jar": (0.45, 0.2, 0.3)})
    run = simulation.run(way(simulation, np.add(cup, (0.0, 0.0, 0.01)), there, gripper=[0.0, 1.0, 1.0]))
    assert simulation.held == "cup"
    assert simulation.state()["gripper"] == 1.0
    np.testing.assert_allclose(run.objects["cup"][0], cup, atol=1e-9)
    offset = place(simulation) - place(simulation, "tip")
    assert np.linalg.norm(offset) == pytest.approx(0.01, abs=0.002)
    sag = standing(panda(), run.sent[-1]).tip_positions[0, 2] - run.tips[-1, 2]
    assert 5e-5 < sag < 2e-3  # the cup weighs
    assert run.tip_error < 2e-3
    np.testing.assert_allclose(place(simulation, "jar"), (0.45, 0.2, 0.3), atol=1e-12)
    simulation.run(way(simulation, there, cup, gripper=[1.0, 0.0, 0.0]))
    assert simulation.held is None
    np.testing.assert_allclose(place(simulation), there + offset, atol=2e-3)
    assert np.linalg.norm(place(simulation, "tip") - place(simulation)) > 0.2


def test_a_gripper_that_closes_out_of_reach_holds_nothing():
    simulation = Simulation(panda(), {"cup": (0.45, 0.1, 0.3)}, reach=0.02, opening=(100.0, 20.0), gripper="claw")
    assert simulation.state()["claw"] == 100.0
    simulation.run(way(simulation, (0.45, 0.1, 0.33), claw=[90.0, 30.0]))
    assert simulation.held is None
    assert simulation.state()["claw"] == 20.0
    np.testing.assert_allclose(place(simulation), (0.45, 0.1, 0.3), atol=1e-12)


def test_a_push_leads_the_tip_away_and_it_comes_back():
    simulation = Simulation(panda())
    movement = way(simulation, (0.45, 0.1, 0.3), seconds=2.0)
    simulation.push((0.0, 40.0, 0.0), at=movement.begins + 1.0, duration=0.3)
    run = simulation.run(movement)
    during = (run.times > 1.0) & (run.times < 1.5)
    assert 0.01 < run.tip_error < 0.2
    assert np.abs(run.tips[~during][:, 1] - Simulation(panda()).run(movement).tips[~during][:, 1]).max() < 0.01
    np.testing.assert_allclose(run.tips[-1], (0.45, 0.1, 0.3), atol=1e-3)


def test_a_hard_push_is_met_with_the_effort_there_is_and_joints_stay_between_their_stops():
    robot, simulation = panda(), Simulation(panda())
    movement = way(simulation, (0.45, 0.1, 0.3), seconds=2.0)
    simulation.push((0.0, 300.0, 0.0), at=movement.trajectory.duration - 0.1, duration=0.3)
    run = simulation.run(movement)
    assert run.effort == pytest.approx(1.0)
    assert ((run.joints > robot.lower - 0.1) & (run.joints < robot.upper + 0.1)).all()
    assert run.tip_error > 0.3
    simulation = Simulation(panda())
    simulation.push((0.0, 50.0, 0.0), at=movement.trajectory.duration - 0.1, duration=0.5)
    run = simulation.run(movement)  # it lasts until the arm is there
    assert np.linalg.norm(run.tips[-1] - (0.45, 0.1, 0.3)) < 0.02
    assert run.times[-1] > movement.trajectory.duration - movement.begins + 0.4


@pytest.mark.parametrize("name", ["panda", "ur5e", "so101"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.97])
def test_a_brake_keeps_the_limits_and_the_path(name, share):
    robot = load(name)
    movement = move(stroke(robot, 0.8), robot, timing="fastest")
    trajectory = movement.trajectory
    at = movement.begins + share * (trajectory.duration - movement.begins)
    ending = brake(robot, trajectory, at)
    report = preflight(robot, ending)
    assert {check.what for check in report.failed} <= {"standing at the ends"}  # it begins in motion
    assert np.abs(ending.velocities[-1]).max() < 1e-9
    assert at + ending.duration < trajectory.duration + 0.5
    path = standing(robot, trajectory.positions).tip_positions
    stops = standing(robot, ending.positions[::20]).tip_positions
    assert np.linalg.norm(path[:, None] - stops, axis=2).min(axis=0).max() < 0.01


def test_watch_stops_the_arm_on_its_path():
    simulation = Simulation(panda(), noise=0.001, seed=4)
    movement = move(stroke(panda()), panda(), timing="slowed")
    looks = []

    def watch(t, tip):
        looks.append((t, *tip))
        return t > 1.0

    run = simulation.run(movement, watch)
    times = np.array(looks)[:, 0]
    np.testing.assert_allclose(np.diff(times), 0.01, atol=1e-9)
    assert times[0] == pytest.approx(-movement.begins)
    assert run.stopped == times[-1] == pytest.approx(1.01, abs=0.011)
    assert run.times[-1] < 1.6
    assert np.ptp(run.tips[-10:], axis=0).max() < 1e-4
    assert np.linalg.norm(movement.path.positions - run.tips[-1], axis=1).min() < 0.006
    noise = np.array(looks)[:, 1:] - run.tips[: len(looks)]
    assert 0.0008 < noise.std() < 0.0012
    again = simulation.run(way(simulation, (0.4, 0.0, 0.4)))  # it goes on from there
    np.testing.assert_allclose(again.tips[-1], (0.4, 0.0, 0.4), atol=4e-3)


def test_the_arm_stands_before_an_error_of_watch_is_heard():
    simulation = Simulation(panda())

    def watch(t, tip):
        if t > 0.5:
            raise RuntimeError("no camera")
        return False

    with pytest.raises(RuntimeError, match="no camera"):
        simulation.run(move(stroke(panda()), panda(), timing="slowed"), watch)
    assert np.abs(simulation._data.qvel).max() < 1e-3


def test_objects_are_moved_and_taken_away_during_a_run():
    simulation = Simulation(panda(), {"cup": (0.45, 0.1, 0.3), "jar": (0.3, 0.3, 0.3)})
    simulation.place("cup", (0.5, 0.0, 0.2), at=0.5)
    simulation.remove("jar", at=1.0)
    run = simulation.run(way(simulation, (0.45, 0.1, 0.4)))
    since = run.times - run.times[0]
    np.testing.assert_allclose(run.objects["cup"][since < 0.49], [(0.45, 0.1, 0.3)] * 49, atol=1e-9)
    np.testing.assert_allclose(run.objects["cup"][-1], (0.5, 0.0, 0.2), atol=1e-9)
    assert np.isfinite(run.objects["jar"][since < 0.99]).all()
    assert math.isnan(simulation.state()["jar_x"])
    simulation.place("jar", (0.1, 0.4, 0.3))
    np.testing.assert_allclose(place(simulation, "jar"), (0.1, 0.4, 0.3))


def test_what_is_taken_out_of_the_hand_stays_out():
    cup = np.array([0.45, 0.1, 0.3])
    simulation = Simulation(panda(), {"cup": cup})
    simulation.run(way(simulation, cup, gripper=[0.0, 1.0]))
    assert simulation.held == "cup"
    simulation.place("cup", (0.3, 0.3, 0.3), at=0.2)
    simulation.run(way(simulation, (0.4, 0.0, 0.4)))
    assert simulation.held is None
    np.testing.assert_allclose(place(simulation), (0.3, 0.3, 0.3), atol=1e-9)


def test_flags_and_noise():
    with_flags = {"lid": 1.0, "near": lambda state: state["cup_x"] < 0.5}
    simulation = Simulation(panda(), {"cup": (0.4, 0.0, 0.1)}, flags=with_flags, noise=0.01, seed=1)
    assert simulation.state()["lid"] == simulation.state()["near"] == 1.0
    measured = np.array([place(simulation) for _ in range(200)])
    assert 0.008 < (measured - (0.4, 0.0, 0.1)).std() < 0.012
    again = Simulation(panda(), {"cup": (0.4, 0.0, 0.1)}, noise=0.01, seed=1)
    first = Simulation(panda(), {"cup": (0.4, 0.0, 0.1)}, noise=0.01, seed=1)
    assert again.state() == first.state()


@pytest.mark.parametrize("name", ["<x a='\"'/>&", "tip", "object 0", "..", "名\n\x00"])
def test_names_of_objects_are_data(name):
    if name == "tip":
        with pytest.raises(SpecificationError, match="different names"):
            Simulation(panda(), {name: (0.4, 0.0, 0.1)})
        return
    simulation = Simulation(panda(), {name: (0.4, 0.0, 0.1), "cup": (9.0, 0.0, 0.0)})
    np.testing.assert_allclose(place(simulation, name), (0.4, 0.0, 0.1))


def test_what_cannot_be_simulated_is_refused():
    with pytest.raises(SpecificationError, match="wam has none"):
        Simulation(load("wam"))
    with pytest.raises(SpecificationError, match="3 finite numbers, x, y, z"):
        Simulation(panda(), {"cup": (0.4, np.nan, 0.1)})
    with pytest.raises(SpecificationError, match="start as 7 finite numbers"):
        Simulation(panda(), start=[0.0])
    simulation = Simulation(panda())
    assert set(simulation.state()) == {"tip_x", "tip_y", "tip_z", "gripper"}
    with pytest.raises(SpecificationError, match=r"objects \(none\), got 'cup'"):
        simulation.remove("cup")
    with pytest.raises(SpecificationError, match="at"):
        simulation.push((0, 0, 1), at=-1.0)
    movement = move(stroke(panda()), panda(), timing="slowed")
    with pytest.raises(SpecificationError, match="expected a movement of panda_joint1"):
        simulation.run(move(stroke(load("ur5e")), load("ur5e"), timing="slowed"))
    with pytest.raises(SpecificationError, match=r"expected a movement of robots\.move"):
        simulation.run(movement.trajectory)
    too_fast = move(stroke(panda(), 0.2), panda(), force=True)
    with pytest.raises(InfeasibleError, match=r"passed its checks, [\w ]+ of panda_joint\d failed"):
        simulation.run(too_fast)
    assert simulation.time == 0
    simulation.run(movement)
    with pytest.raises(SpecificationError, match="begins where the arm stands"):
        simulation.run(movement)
