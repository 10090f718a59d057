"""``kineme generate`` of whatever a recording holds: two hands, joints beside an orientation, grippers."""

import commands
import numpy as np
import pytest

import kineme
from kineme.dmp.discrete.dmp import DMP
from kineme.dmp.generation.figure import draw_movement, path_columns
from kineme.dmp.generation.generate import MovementOptions, generate, largest_deviation, learn_one
from kineme.io.writing.write_movement import write_movement
from kineme.orientation import exp, log, product
from soaking import combined, slow

U = np.linspace(0, 1, 80)
S = U**3 * (10 - 15 * U + 6 * U**2)
JOINTS = [f"joint{k + 1}" for k in range(6)]
HANDS = [f"{hand}.{part}" for hand in ("left", "right") for part in ("x", "y", "z", "qw", "qx", "qy", "qz")]
TURNED = ["tool.qx", "tool.qy", "tool.qz", "tool.qw"]
HEADS = {
    "hands": HANDS,
    "joints": [*JOINTS, "gripper"],
    "joints and orientation": [*TURNED, *JOINTS, "gripper", "button"],
}
GOALS = {
    "hands": [0.6, 0.3, 0.1, 0, 0, 0, 1, -0.3, 0.3, 0.2, 0, 0.6, 0, 0.8],
    "joints": [0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
    "joints and orientation": [0, 0, 1, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
}
each = pytest.mark.parametrize("case", HEADS)


def run(*arguments, **options):
    return commands.run("generate", *arguments, **options)


def q(k):
    return product(exp(np.outer(S, [0.3 * k, 1, 2.0 * k])), [0.0, 1.0, 0.0, 0.0])


def columns(case):
    joints = [np.sin((k + 1) * S) / 2 for k in range(6)]
    if case == "hands":
        hand = [np.column_stack([0.4 * k * S, S**2, np.sin(3 * S), q(k)]) for k in (1, -1)]
        return np.column_stack(hand)
    if case == "joints":
        return np.column_stack([*joints, (U > 0.2) & (U < 0.7)])
    return np.column_stack([-q(1)[:, [1, 2, 3, 0]], *joints, U > 0.4, 3.0 * (U < 0.5)])


@pytest.fixture
def recording(tmp_path):
    def write(case):
        table = np.column_stack([2 * U, columns(case)])
        heads = ",".join(["t", *HEADS[case]])
        np.savetxt(tmp_path / "recording.csv", table, delimiter=",", header=heads, comments="")
        return tmp_path / "recording.csv"

    return write


def text(numbers):
    return ",".join(map(str, numbers))


@each
def test_it_moves_as_shown_in_the_columns_that_were_recorded(case, recording, tmp_path):
    path = recording(case)
    done = run(path, "--rate", 500, "-o", tmp_path / "new.csv")
    assert (done.returncode, done.stderr) == (0, "")
    made, was = kineme.read_recording(tmp_path / "new.csv"), kineme.read_recording(path)
    assert made.channels == was.channels
    for k, name in enumerate(HEADS[case]):
        if name in ("gripper", "button"):
            assert set(made.recorded[:, k]) == set(was.recorded[:, k])
            steps = [one.times[1:][np.diff(one.recorded[:, k]) != 0] for one in (made, was)]
            np.testing.assert_allclose(*steps, atol=0.003)
        else:
            replayed = np.interp(was.times, made.times, made.recorded[:, k])
            np.testing.assert_allclose(replayed, was.recorded[:, k], atol=1e-3, err_msg=name)


FORMATS = combined(HEADS, [".csv", ".npz", ".json"], together=1)


@pytest.mark.parametrize(("case", "ending"), [FORMATS[0], *(slow(*row) for row in FORMATS[1:])])
def test_a_goal_is_met_in_every_format_at_another_tempo(case, ending, recording, tmp_path):
    path, out = recording(case), tmp_path / f"new{ending}"
    done = run(
        path, "--goal", text(GOALS[case]), "--duration", 3, "--settle", 1e-4, "-o", out, "--plot", tmp_path / "p.png"
    )
    assert (done.returncode, done.stderr) == (0, "")
    made, was = kineme.read_recording(out), kineme.read_recording(path)
    assert made.channels == was.channels
    last = []
    for one in made.channels:
        at = [HEADS[case].index(name) for name in one.columns]
        if one.kind == "orientation":
            np.testing.assert_allclose(np.linalg.norm(made.recorded[:, at], axis=1), 1)
            assert (np.abs(np.diff(made.recorded[:, at], axis=0)) < 0.2).all()
            np.testing.assert_allclose(made.recorded[0, at], was.recorded[0, at], atol=1e-6)  # with its sign
        if one.kind != "discrete":
            end = made.recorded[-1, at]
            goal = np.array(GOALS[case])[len(last) : len(last) + len(at)]
            last += list(end if one.kind != "orientation" else end * np.sign(end @ goal))
    np.testing.assert_allclose(last, GOALS[case], atol=1e-3)


@each
def test_a_saved_movement_forgets_nothing(case, recording, tmp_path):
    path = recording(case)
    options = "--goal", text(GOALS[case]), "--duration", 1.5
    first = run(path, *options, "--save", tmp_path / "it.kineme")
    again = run(tmp_path / "it.kineme", *options)
    assert first.returncode == again.returncode == 0, first.stderr + again.stderr
    assert first.stdout.startswith(text(["time", *HEADS[case], "v_"])[:-1])
    assert again.stdout == first.stdout


@each
def test_velocities_belong_to_the_columns_that_name_them(case, recording, tmp_path):
    assert run(recording(case), "--rate", 1000, "-o", tmp_path / "new.csv").returncode == 0
    made = np.genfromtxt(tmp_path / "new.csv", delimiter=",", names=True, deletechars="")
    step = np.diff(made["time"])
    for name in [name for name in HEADS[case] if ".q" not in name and name not in ("gripper", "button")]:
        middle = (made[f"v_{name}"][1:] + made[f"v_{name}"][:-1]) / 2
        np.testing.assert_allclose(np.diff(made[name]) / step, middle, atol=2e-3)
    for stem in {name[:-1] for name in HEADS[case] if ".q" in name}:
        turned = np.column_stack([made[f"{stem}{part}"] for part in "wxyz"])
        omega = log(product(turned[1:], turned[:-1] * [1, -1, -1, -1])) / step[:, None]
        for k, axis in enumerate("xyz"):
            rate = made[f"v_{stem}.r{axis}"]
            np.testing.assert_allclose(omega[:, k], (rate[1:] + rate[:-1]) / 2, atol=2e-3)


def test_wrong_goals_are_said_in_the_words_of_the_shell(recording):
    path = recording("hands")
    assert "expected 14 numbers for --goal, left.x, left.y, left.z, left.qw" in run(path, "--goal", "1,2").stderr
    wrong = [*GOALS["hands"][:10], 1, 1, 0, 0]
    done = run(path, "--start", text(wrong))
    assert done.returncode == 1
    assert (
        "expected a unit quaternion for right.qw, right.qx, right.qy, right.qz of --start, got norm 1.41" in done.stderr
    )


def test_it_steers_around_obstacles_without_jumps_of_quaternions(recording, tmp_path):
    done = run(
        recording("joints and orientation"),
        "--obstacle",
        "0.2,0.4,0.5,0.4,0.3,0",
        "--settle",
        0.02,
        "-o",
        tmp_path / "new.csv",
    )
    assert done.returncode == 0, done.stderr
    made = kineme.read_recording(tmp_path / "new.csv").recorded
    assert (np.abs(np.diff(made[:, :4], axis=0)) < 0.1).all()
    np.testing.assert_allclose(made[0, :4], columns("joints and orientation")[0, :4], atol=1e-6)
    assert set(made[:, -1]) == {0.0, 3.0}


def learned_from(recording, case, **specification):
    return learn_one(kineme.read_recording(recording(case)), DMP(**specification))


@each
def test_a_replay_is_near_the_recording_and_a_poor_one_says_in_what(case, recording):
    good = largest_deviation(learned_from(recording, case))
    assert good.share < 1e-3
    poor = largest_deviation(learned_from(recording, case, n_basis=3, ridge=10.0))
    assert poor.share > 10 * good.share
    assert poor.of in {"hands": {"positions", "left.q", "right.q"}, "joints": {""}}.get(case, {"angles", "tool.q"})


def test_what_rests_has_no_share_of_its_extent(tmp_path):
    """A hand that turns in place: the extent of its positions is 0."""
    table = np.column_stack([2 * U, np.tile([1.0, 2.0, 3.0], (80, 1)), q(1)])
    heads = "t,x,y,z,qw,qx,qy,qz"
    np.savetxt(tmp_path / "turn.csv", table, delimiter=",", header=heads, comments="")
    learned = learn_one(kineme.read_recording(tmp_path / "turn.csv"), DMP())
    off = largest_deviation(learned)
    assert (off.of, 0 < off.share < 1e-3) == ("", True)
    done = run(tmp_path / "turn.csv", "-o", tmp_path / "new.csv", "--plot", tmp_path / "new.png")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.soak
def test_the_figure_has_a_path_for_each_hand_and_steps_for_a_gripper(recording):
    hands, joints = learned_from(recording, "hands"), learned_from(recording, "joints")
    assert path_columns(hands) == [[0, 1, 2], [7, 8, 9]]
    assert path_columns(joints) == []
    figure = draw_movement(hands, generate(hands, MovementOptions()).columns, None)
    assert [one.get_text().strip() for one in figure.axes[0].texts] == ["left", "right"]
    figure = draw_movement(joints, generate(joints, MovementOptions()).columns, None)
    *_, joint, gripper = figure.axes
    assert {line.get_drawstyle() for line in gripper.lines} == {"steps-post"}
    assert {line.get_drawstyle() for line in joint.lines} == {"default"}


def test_a_rollout_is_written_under_its_names_with_velocities(recording, tmp_path):
    learned = learned_from(recording, "joints and orientation")
    path = write_movement(tmp_path / "rollout.csv", learned.primitive.rollout(rate=100))
    assert run(recording("joints and orientation"), "-o", tmp_path / "new.csv").returncode == 0
    made, expected = (
        np.genfromtxt(one, delimiter=",", names=True, deletechars="") for one in (path, tmp_path / "new.csv")
    )
    assert set(made.dtype.names) == set(expected.dtype.names)
    for name in expected.dtype.names:
        np.testing.assert_allclose(made[name], expected[name], atol=1e-9, err_msg=name)
