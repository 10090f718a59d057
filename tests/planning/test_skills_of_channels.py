"""Skills of joints that begin near half a turn, where an encoder jumps, and of columns in another order."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import DMP, ActionLibrary, Demonstrations
from kineme.dmp.generation.generate import learn_one
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.planning import SkillTools, outside, skill_of
from kineme.planning.preview import nearest_inside, plan_symbol, preview_skill, standing_place
from kineme.planning.skill import move_to, nearest_demonstration
from kineme.robots import load, move
from kineme.robots.kinematics.descent import kinematics
from kineme.robots.planning.generate_at import generate_at

U = np.linspace(0.0, 1.0, 100)
EASED = U**3 * (10 - 15 * U + 6 * U**2)
TURN = 2 * np.pi
PAN = "shoulder_pan_joint"


def wrapped(angles):
    """Angles as an encoder reports them."""
    return (angles + np.pi) % TURN - np.pi


@pytest.fixture(scope="module")
def robot():
    return load("ur5e")


@pytest.fixture(scope="module")
def library(tmp_path_factory, robot):
    """The first joint turns by 23 degrees from 3 degrees before or behind half a turn."""
    rng = np.random.default_rng(3)
    paths = []
    for k in range(6):
        joints = robot.rest + 0.2 * EASED[:, None] + 0.01 * rng.normal(size=6)
        joints[:, 0] = np.pi + (0.05 if k % 2 else -0.05) + (0.3 + 0.04 * k) * EASED + 0.005 * rng.normal()
        paths.append(wrapped(joints))
    channels = tuple(Channel(name, "angle", (name,), "rad") for name in robot.joints)
    plain = Demonstrations.from_arrays(paths, ["pan"] * 6, [3.0 * U] * 6)
    with ActionLibrary(tmp_path_factory.mktemp("turns") / "actions", create=True) as library:
        library.learn(Demonstrations.of_movements(of_channels(plain.movements, channels)))
        yield library


def test_only_what_was_shown_is_inside_in_whichever_turn_it_is_asked(library):
    skill = skill_of(library, "pan")
    assert np.ptp(skill.starts[:, 0]) < 0.2
    assert np.ptp(skill.goals[:, 0]) < 0.5
    for k, (start, goal) in enumerate(zip(skill.starts, skill.goals, strict=True)):
        for turns in (-TURN, 0.0, TURN):
            away = np.eye(6)[0] * turns
            assert outside(skill, start + away, goal + away) == []
            assert nearest_demonstration(skill, start + away, goal + away) == k
            np.testing.assert_allclose(nearest_inside(skill, start + away, goal + away), (start + away, goal + away))
        opposite = np.where(np.arange(6) == 0, 0.0, start)
        assert {excess.what for excess in outside(skill, opposite, opposite + goal - start)} == {"start", "goal"}
        assert [excess.what for excess in outside(skill, start, goal + np.eye(6)[0] * TURN)] == ["goal", "displacement"]


@pytest.mark.parametrize("pan", [np.pi - 0.05, -np.pi + 0.05])
def test_an_arm_moves_in_the_turn_in_which_it_stands(library, robot, pan):
    skill = skill_of(library, "pan")
    joints = np.median(skill.starts, axis=0)
    joints[0] = pan
    own = plan_symbol(library, robot, "pan", joints).trajectory.positions
    assert np.abs(own[:, 0] - pan).max() < 0.6
    goals = {
        f"goal_{name}": float(value) for name, value in zip(robot.joints, np.median(skill.goals, axis=0), strict=True)
    }
    tools = SkillTools(library, robot)
    tools.joints = joints
    for turns in (-TURN, 0.0, TURN):
        for given in ({}, {f"start_{PAN}": pan}, {f"start_{PAN}": float(skill.starts[0, 0])}):
            asked = goals | given
            if f"start_{PAN}" in given:  # start and goal are in one turn
                asked[f"goal_{PAN}"] += TURN * round((given[f"start_{PAN}"] - skill.starts[0, 0]) / TURN)
            else:
                asked[f"goal_{PAN}"] += turns
            moved = tools._preview(skill, asked)
            assert moved.movement is not None, moved.refusal
            assert np.abs(moved.movement.trajectory.positions[:, 0] - pan).max() < 0.6


def test_a_grounding_says_where_it_begins(library):
    ranges = library.ground("pan")["demonstrated"]
    for what, widest in (("start", 0.2), ("goal", 0.5)):
        assert ranges[what]["max"][0] - ranges[what]["min"][0] < widest
    assert abs(abs(ranges["start"]["median"][0]) - np.pi) < 0.06


@pytest.mark.parametrize("ends", [("start",), ("goal",), ("start", "goal")])
@pytest.mark.parametrize("turns", [-TURN, 0.0, TURN])
@pytest.mark.parametrize("reported", [-TURN, 0.0, TURN])
def test_a_monitor_sees_a_push_in_whichever_turn(library, ends, turns, reported):
    skill, away = skill_of(library, "pan"), np.eye(6)[0]
    places = {"start": skill.starts[0] + turns * away, "goal": skill.goals[0] + turns * away}
    monitor = library.monitor("pan", error_rate=0.2, **{name: places[name] for name in ends})
    path = (
        library.primitives(ids=[skill.movements[0]])
        .rollout(skill.starts[0] + reported * away, skill.goals[0] + reported * away, n_samples=100)
        .positions[0]
    )
    monitor.update(3.0 * U, path)
    assert monitor.finish().ended
    largest = monitor.finish().state.largest
    monitor.reset()
    monitor.update(3.0 * U, path + 0.6 * away * np.exp(-(((U - 0.5) / 0.1) ** 2))[:, None])
    assert not monitor.finish().inside
    assert monitor.finish().state.largest > 2 * max(largest, monitor.shown.threshold)


def test_places_are_those_of_their_columns_where_a_quaternion_comes_first(tmp_path):
    channels = (
        Channel("tip", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz"),
        *(Channel(axis, "position", (axis,), "m") for axis in "xyz"),
    )
    quaternions = np.column_stack((np.cos(0.2 * EASED), np.zeros((100, 2)), np.sin(0.2 * EASED)))
    paths = [np.column_stack((quaternions, (k + EASED)[:, None] * [0.1, 0.2, 0.3])) for k in (1, 2)]
    plain = Demonstrations.from_arrays(paths, ["lift"] * 2, [3.0 * U] * 2)
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(Demonstrations.of_movements(of_channels(plain.movements, channels)))
        skill = skill_of(library, "lift")
        start, goal = np.array([0.15, 0.3, 0.45]), np.array([0.27, 0.48, 0.77])
        recorded = move_to(library, skill, start, goal).demonstrations[0].recorded
    np.testing.assert_allclose(recorded[[0, -1], 4:], [start, goal], atol=1e-9)
    np.testing.assert_allclose(np.abs(recorded[[0, -1], :4]), np.abs(quaternions[[0, -1]]), atol=1e-6)


def test_a_tip_goes_to_its_axes_in_whichever_order_a_file_has_them(tmp_path):
    """Every word of the preview is true of the movement that is sent."""
    robot, ends = load("panda"), []
    for order in ([0, 1, 2], [2, 1, 0]):
        axes = ["xyz"[k] for k in order]
        channels = tuple(Channel(axis, "position", (axis,), "m") for axis in axes)
        path = [0.31, 0.0, 0.48] + EASED[:, None] * [0.1, 0.2, -0.1]
        plain = Demonstrations.from_arrays([path[:, order]], ["carry"], [3.0 * U])
        with ActionLibrary(tmp_path / "".join(axes), create=True) as library:
            library.learn(Demonstrations.of_movements(of_channels(plain.movements, channels)))
            skill = skill_of(library, "carry")
            moved = preview_skill(library, skill, robot, robot.rest, skill.starts[0], skill.goals[0], 3.0).movement
            ends.append(moved.path.positions[[0, -1]])
            tip = kinematics(robot, robot.rest[None])[0][0]
            np.testing.assert_allclose(standing_place(library, skill, robot, robot.rest), tip[order])
    np.testing.assert_allclose(ends, [path[[0, -1]]] * 2, atol=1e-6)


def test_a_tip_goes_up_where_columns_x_and_z_do(tmp_path):
    robot = load("panda")
    tip = kinematics(robot, robot.rest[None])[0][0]
    path = tip[[0, 2]] + EASED[:, None] * [0.0, -0.1]
    plain = Demonstrations.from_arrays([path], ["down"], [3.0 * U])
    channels = tuple(Channel(axis, "position", (axis,), "m") for axis in "xz")
    shown = Demonstrations.of_movements(of_channels(plain.movements, channels))
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(shown)
        skill = skill_of(library, "down")
        np.testing.assert_allclose(standing_place(library, skill, robot, robot.rest), tip[[0, 2]])
        planned = plan_symbol(library, robot, "down", robot.rest)
    learned = learn_one(shown, DMP())
    generated = generate_at(learned, goal=[tip[0], 0.3, tip[2] - 0.1])
    assert generated.plane == "xz"
    for moved in (planned, move(shown, robot), move(generated.movement, robot)):
        np.testing.assert_allclose(moved.path.positions[-1, [0, 2]], path[-1], atol=1e-6)
