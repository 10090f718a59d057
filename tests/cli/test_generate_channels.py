"""``kineme generate`` keeps what a recording means, writes over nothing unasked, and says where the fit is bad."""

import commands
import numpy as np
import pytest
from matplotlib.image import imread

import kineme
from kineme.dmp.generation.figure import short_names
from kineme.io.writing.write_movement import write_movement
from kineme.orientation import exp, log, product

HEADS = "t,tool.x,tool.y,tool.z,tool.qx,tool.qy,tool.qz,tool.qw,gripper"
N = 80


def run(*arguments, **options):
    return commands.run("generate", *arguments, **options)


@pytest.fixture
def pose(tmp_path):
    u = np.linspace(0, 1, N)
    s = u**3 * (10 - 15 * u + 6 * u**2)
    q = -product(exp(np.outer(s, [0.3, 1, 2.5])), [0.0, 1.0, 0.0, 0.0])[:, [1, 2, 3, 0]]
    table = np.column_stack([2 * u, s, s**2, 0.5 * np.sin(3 * s), q, u > 0.5])
    np.savetxt(tmp_path / "pose.csv", table, delimiter=",", header=HEADS, comments="")
    return tmp_path / "pose.csv"


@pytest.mark.parametrize("ending", [".csv", ".npz", ".json"])
def test_a_pose_keeps_its_columns_and_is_read_again_as_what_it_was(pose, tmp_path, ending):
    goal = "1,0.5,0.2,0,1,0,0"
    out = tmp_path / f"new{ending}"
    plot = ("--plot", tmp_path / "new.png") if ending == ".csv" else ()
    done = run(pose, "--goal", goal, "--settle", 0.001, "-o", out, *plot)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    made, was = kineme.read_recording(out), kineme.read_recording(pose)
    assert made.channels == was.channels
    np.testing.assert_allclose(np.linalg.norm(made.recorded[:, 3:7], axis=1), 1)
    np.testing.assert_allclose(np.abs(made.recorded[-1, 3:7] @ [0, 1, 0, 0]), 1, atol=1e-4)
    np.testing.assert_allclose(made.recorded[0, 3:7], was.recorded[0, 3:7], atol=1e-6)  # with its sign
    np.testing.assert_allclose(made.recorded[-1, :3], [1, 0.5, 0.2], atol=0.001)


def test_velocities_belong_to_the_columns_that_name_them_where_the_orientation_comes_first(pose, tmp_path):
    """As in Vicon's exports: RX, RY, RZ, RW, TX, TY, TZ."""
    table = np.loadtxt(pose, delimiter=",", skiprows=1)[:, [0, 4, 5, 6, 7, 8, 1, 2, 3]]
    heads = "time,RX,RY,RZ,RW,gripper,TX,TY,TZ"
    np.savetxt(tmp_path / "vicon.csv", table, delimiter=",", header=heads, comments="")
    assert run(tmp_path / "vicon.csv", "--rate", 1000, "-o", tmp_path / "new.csv").returncode == 0
    made = np.genfromtxt(tmp_path / "new.csv", delimiter=",", names=True, deletechars="")
    step = np.diff(made["time"])
    for axis in ("TX", "TY", "TZ"):
        for rate, of in ((f"v_{axis}", axis), (f"a_{axis}", f"v_{axis}")):
            middle = (made[rate][1:] + made[rate][:-1]) / 2
            np.testing.assert_allclose(np.diff(made[of]) / step, middle, atol=2e-3)
    q = np.column_stack([made[f"R{part}"] for part in "WXYZ"])
    turned = log(product(q[1:], q[:-1] * [1, -1, -1, -1])) / step[:, None]
    for k, axis in enumerate(("v_R.rx", "v_R.ry", "v_R.rz")):
        np.testing.assert_allclose(turned[:, k], (made[axis][1:] + made[axis][:-1]) / 2, atol=2e-3)


def test_a_gripper_steps_when_it_did_whatever_the_tempo(pose, tmp_path):
    assert run(pose, "--duration", 5, "-o", tmp_path / "slow.csv").returncode == 0
    slow = kineme.read_recording(tmp_path / "slow.csv")
    gripper = slow.recorded[:, -1]
    assert set(gripper) == {0.0, 1.0}
    np.testing.assert_allclose(slow.times[np.argmax(gripper)], 2.5 * (1 + 1 / (N - 1)), atol=0.02)


def test_a_saved_pose_is_a_pose_again(pose, tmp_path):
    assert run(pose, "--save", tmp_path / "p.kineme", "-o", tmp_path / "a.csv").returncode == 0
    done = run(tmp_path / "p.kineme")
    assert done.returncode == 0, done.stderr
    assert done.stdout == (tmp_path / "a.csv").read_text()


def test_a_goal_of_other_columns_is_refused_with_their_names(pose):
    done = run(pose, "--goal", "1,2")
    assert done.returncode == 1
    assert (
        "expected 7 numbers for --goal, tool.x, tool.y, tool.z, tool.qx, tool.qy, tool.qz, tool.qw, got 2"
        in done.stderr
    )


def test_obstacles_lie_where_the_position_moves(pose, tmp_path):
    middle = "0.5,0.25,0.49"
    done = run(pose, "--obstacle", middle, "--settle", 0.05, "-o", tmp_path / "around.csv")
    assert done.returncode == 0, done.stderr
    assert "expected obstacles in the 3 dimensions" in run(pose, "--obstacle", "1,2").stderr


def test_reading_options_are_those_of_the_other_commands(pose, tmp_path):
    done = run(pose, "--columns", "tool.x,tool.y,gripper", "--kind", "gripper=position", "-o", tmp_path / "xy.csv")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "xy.csv").read_text().startswith("time,tool.x,tool.y,gripper,v_tool.x,v_tool.y,v_gripper")
    done = run("-", "--columns", "tool.x", input=pose.read_text())
    assert done.stdout.startswith("time,tool.x,v_tool.x")


def test_one_of_several_movements_is_chosen(tmp_path):
    times, paths = np.linspace(0, 1, 50), np.cumsum(np.random.default_rng(0).normal(size=(2, 50, 2)), axis=1)
    np.savez(tmp_path / "two.npz", positions=paths, times=times)
    done = run(tmp_path / "two.npz")
    assert done.returncode == 2
    assert "holds 2; choose with --index" in done.stderr
    assert run(tmp_path / "two.npz", "--index", 1).returncode == 0


def test_no_file_is_written_over_unasked_and_the_input_never(pose, tmp_path):
    out = tmp_path / "new.csv"
    out.write_text("precious")
    for option in ("-o", "--save"):
        done = run(pose, option, out)
        assert done.returncode == 2
        assert "new.csv is there; write over it with --force" in done.stderr
    assert out.read_text() == "precious"
    assert run(pose, "-o", out, "--force").returncode == 0
    assert out.read_text() != "precious"
    before = pose.read_bytes()
    (tmp_path / "link.csv").hardlink_to(pose)
    for path in (pose, tmp_path / "link.csv"):
        done = run(pose, "-o", path, "--force")
        assert done.returncode == 2
        assert "expected another file to write than the input" in done.stderr
    assert pose.read_bytes() == before


@pytest.mark.parametrize(
    ("by", "name", "asked", "taken", "said"),
    [
        (40, "goal", -150, 210, True),
        (40, "goal", 210, 210, False),
        (40, "goal", 80, 80, False),
        (90, "goal", -100, 260, True),
        (300, "goal", 110, 470, True),
        (300, "start", -190, 170, True),
    ],
)
def test_a_start_or_goal_may_be_an_angle_as_the_recording_wraps_it(tmp_path, by, name, asked, taken, said):
    t = np.linspace(0, 1.2, 60)
    yaw = (170 + by * t / 1.2 + 180) % 360 - 180
    table = np.column_stack((t, 0.3 * t, 0.1 * t, yaw, t > 0.5))
    np.savetxt(tmp_path / "yaw.csv", table, delimiter=",", header="t,x,y,yaw,gripper", comments="")
    done = run(tmp_path / "yaw.csv", f"--{name}", f"0.36,0.12,{asked}", "--settle", "0.1", "-o", tmp_path / "new.csv")
    note = f"note: --{name} {asked} of yaw is taken as {taken}, in the turn of the recording\n"
    assert (done.returncode, done.stderr) == (0, note * said)
    end = 0 if name == "start" else -1
    assert np.loadtxt(tmp_path / "new.csv", delimiter=",", skiprows=1)[end, 3] == pytest.approx(taken, abs=0.1)


def test_a_bad_fit_is_said(tmp_path):
    times = np.linspace(0, 1, 300)
    wild = np.column_stack([np.sin(60 * times), np.cos(47 * times)])
    path = write_movement(tmp_path / "wild.csv", {"times": times, "positions": wild})
    done = run(path, "--n-basis", 5, "-o", tmp_path / "new.csv")
    assert done.returncode == 0
    assert "warning: the fit is off the recording by up to" in done.stderr
    assert run(path, "--n-basis", 150, "-o", tmp_path / "good.csv").stderr == ""


@pytest.mark.parametrize(("ripple", "bad"), [(0.045, False), (0.055, True)])
def test_a_fit_is_bad_beyond_a_twentieth_of_the_extent(tmp_path, ripple, bad):
    """Few basis functions follow the way and not the ripples on it, which are so high beside an extent of 1."""
    times = np.linspace(0, 1, 300)
    rippled = np.column_stack([times, ripple * np.sin(2 * np.pi * 40 * times)])
    path = write_movement(tmp_path / "rippled.csv", {"times": times, "positions": rippled})
    done = run(path, "--n-basis", 10, "-o", tmp_path / "new.csv")
    assert done.returncode == 0
    assert ("warning: the fit is off" in done.stderr) == bad


def test_short_names_of_columns_tell_them_apart():
    joints = [f"{joint}.pos" for joint in ("shoulder_pan", "shoulder_lift", "elbow_flex")]  # as LeRobot names them
    assert short_names(joints) == ["…ulder_pan.pos", "…lder_lift.pos", "elbow_flex.pos"]
    assert short_names(["field.pose.position.x", "y", "v."]) == ["position.x", "y", "v."]


@pytest.mark.soak
def test_names_of_columns_are_not_cut_off_at_the_edge(tmp_path):
    u = np.linspace(0, 2, N)
    heads = ",".join(["t", *(f"panda_joint{k + 1}" for k in range(7)), "gripper"])
    table = np.column_stack([u, *(0.5 * np.sin(u * (1 + 0.3 * k)) + 0.2 * k for k in range(7)), u > 1])
    np.savetxt(tmp_path / "arm.csv", table, delimiter=",", header=heads, comments="")
    assert run(tmp_path / "arm.csv", "--plot", tmp_path / "a.png", "-o", tmp_path / "new.csv").returncode == 0
    assert imread(tmp_path / "a.png")[:, :3, :3].min() == 1.0  # white
