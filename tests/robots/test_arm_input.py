"""What arms are asked and cannot do, and values that cannot be: a KinemeError that says what to do."""

from __future__ import annotations

import sys
import warnings

import numpy as np
import pytest
from click.testing import CliRunner

import kineme
from arm_samples import stroke
from kineme import Demonstrations
from kineme.cli import main
from kineme.dmp.generation.generate import learn_one
from kineme.errors import DataError, KinemeError, SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.robots import ArmController, InfeasibleError, InverseKinematics, load, move
from kineme.robots.planning.generate_at import generate_at

pytest.importorskip("pinocchio", reason="the extra robot is not installed")

WRONG = (
    np.nan, np.inf, -1, 10**30, 1e-320, True, "x", b"x", 1j, object(), [], {}, [np.nan], [[1, 2], [3]], ["a"], [None],
    np.zeros((3, 2)), np.zeros(0), np.array([1, 2], dtype=object), np.datetime64("2020-01-01"), [1e308, -1e308],
)  # fmt: skip
OF_MOVE = ("robot", "space", "orientation", "follow", "plane", "place", "timing", "rate", "start", "steps", "force")


def refused_or_done(call):
    """Either a result or a KinemeError, and no warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return call()
        except KinemeError:
            return None


@pytest.fixture(scope="module")
def panda():
    return load("panda")


@pytest.mark.parametrize("name", OF_MOVE)
def test_wrong_options_of_a_movement(panda, name):
    joints = kineme.Trajectory(times=np.linspace(0, 3, 50), positions=np.tile(panda.rest, (50, 1)))
    movement = joints if name in ("rate", "force", "steps", "start") else stroke(panda, n=20)
    for wrong in WRONG:
        refused_or_done(lambda wrong=wrong: move(movement, **({"robot": panda} | {name: wrong})))


def test_wrong_movements(panda):
    for wrong in (*WRONG, None, np.zeros((30, 3)), np.zeros((30, 5)), np.full((30, 3), 1e300), kineme.DMP()):
        refused_or_done(lambda wrong=wrong: move(wrong, panda))


@pytest.mark.parametrize("name", ["robot", "tip", "rest", "max_velocity", "max_acceleration"])
def test_wrong_options_of_an_arm(name):
    for wrong in WRONG:
        refused_or_done(lambda wrong=wrong: load(**({"robot": "ur5e"} | {name: wrong})))


@pytest.mark.parametrize("name", ["start", "orientation", "follow", "goal", "position", "tempo", "obstacles"])
def test_wrong_values_live(panda, name):
    control = kineme.DMP().learn([stroke(panda)]).controller(0.01)
    for wrong in (*WRONG, [1e9] * 3, [1e300] * 3, [0.0] * 7):
        if name in ("start", "orientation", "follow"):
            refused_or_done(lambda wrong=wrong: ArmController(panda, control, **{name: wrong}))
            continue
        arm = ArmController(panda, control)
        for _ in range(3):
            state = arm.step(**{name: wrong})
        assert np.isfinite(state.joints).all()
        assert np.all(np.abs(state.velocities) <= panda.velocity * (1 + 1e-9))


def test_a_start_outside_the_limits_is_named(panda):
    away = panda.rest + np.array([0, 0, 0, 3.0, 0, 0, 0])
    with pytest.raises(KinemeError, match=r"panda_joint4 to start within \[-3.07"):
        move(stroke(panda), panda, start=away)


def test_another_number_of_joints_or_dimensions_is_said(panda):
    with pytest.raises(TrajectoryError, match=r"of the 7 joints of panda, got 6 columns; choose .*=discrete"):
        move(np.zeros((40, 6)) + np.linspace(0, 1, 40)[:, None], panda, space="joints")
    rows = np.zeros((40, 6)) + np.linspace(0, 1, 40)[:, None]
    with pytest.raises(TrajectoryError, match="of 2 or 3 dimensions, got 5"):
        move(rows[:, :5], panda)
    plain = Demonstrations.from_arrays([rows], times=[np.linspace(0, 3, 40)])
    for names, joints in (
        ("x y z rx ry rz", False),
        ("pose_0 pose_1 pose_2 pose_3 pose_4 pose_5", False),
        ("a b c d e f", True),
    ):
        channels = tuple(Channel(name, "position", (name,), None) for name in names.split())
        one = Demonstrations.of_movements(of_channels(plain.movements, channels))
        with pytest.raises(TrajectoryError, match=r"got 6 among .* quaternion") as refused:
            move(one, load("ur5e"))
        with pytest.raises(TrajectoryError, match=r"got 6 among .* quaternion"):
            generate_at(learn_one(one[0], kineme.DMP()))
        assert joints == ("--joints" in str(refused.value))  # a rotation vector would be executed as joints


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "text that is no XML"),
        ("<sdf/>", "whose root is <robot>, got <sdf>"),
        ("<robot name='r'/>", "at least one joint that moves, found none"),
        ('<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">' + "".join(
            f'<!ENTITY {c} "{("&" + b + ";") * 10}">' for b, c in zip("abcdefgh", "bcdefghi", strict=True)
        ) + "]><robot name='&i;'/>", "no XML"),
    ],
)  # fmt: skip
def test_broken_urdf_files_are_refused(tmp_path, text, words):
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    with pytest.raises(DataError, match=words):
        load(path)


def test_a_huge_urdf_is_refused(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_bytes(b"<robot>" + b" " * 20_000_001)
    with pytest.raises(DataError, match="at most 20 MB"):
        load(path)


def test_without_the_extra_its_name_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(DataError, match=r"kineme\[robot\]"):
        load("panda")


def test_without_pink_or_toppra_the_extra_is_said(panda, monkeypatch):
    movement = stroke(panda)
    monkeypatch.setitem(sys.modules, "toppra", None)
    with pytest.raises(DataError, match=r"kineme\[robot\]"):
        move(movement, panda, timing="fastest")
    monkeypatch.setitem(sys.modules, "pink", None)
    with pytest.raises(DataError, match=r"kineme\[robot\]"):
        InverseKinematics(panda)


def test_too_many_samples_are_refused(panda):
    movement = kineme.Trajectory(times=np.linspace(0, 1e6, 50), positions=panda.rest + np.linspace(0, 0.1, 50)[:, None])
    with pytest.raises(SpecificationError, match="at most 1,000,000 samples"):
        move(movement, panda)


SHELL = {
    "does not reach (0.900": ("--at", "0.9,0.5,0.9"),
    "no link 'hand'": ("--tip", "hand"),
    "expected start as": ("--from", "0,0"),
    "to start within": ("--from", "9,0,0,-2,0,2,0"),
    "--slow-down": ("--at", "0.45,-0.2,0.3", "--duration", "0.2"),
    "expected one of panda": ("--robot", "pandas"),
}


@pytest.mark.parametrize("words", SHELL)
def test_the_shell_says_the_same(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    u = np.linspace(0, 1, 60)
    s = 10 * u**3 - 15 * u**4 + 6 * u**5
    columns = np.column_stack((2 * u, 0.2 * s, 0.1 * s, 0.05 * np.sin(2 * np.pi * s)))
    np.savetxt("wave.csv", columns, delimiter=",", header="time,x,y,z", comments="")
    result = CliRunner().invoke(main, ["move", "wave.csv", "--robot", "panda", *SHELL[words], "-o", "joints.csv"])
    assert result.exit_code in (1, 2)
    assert words in result.output
    assert "Traceback" not in result.output
    assert not (tmp_path / "joints.csv").exists()


def test_an_infeasible_movement_carries_its_checks(panda):
    with pytest.raises(InfeasibleError) as caught:
        move(stroke(panda, 0.2), panda)
    assert caught.value.preflight is not None
    assert caught.value.preflight.failed
