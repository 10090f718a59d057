"""What the paper's robot executes: where its joints bring the tip, and what is said of it."""

import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from kineme.datasets.lasa import load_lasa
from kineme_experiments.paper.arm_letter import letter_table, read_letter, write_letter
from kineme_experiments.paper.arm_recordings import SCALE, executed
from kineme_experiments.paper.columns import CLOSEST
from kineme_experiments.paper.figures import one_c
from kineme_experiments.paper.representations import READINGS
from kineme_experiments.paper.run import arm_tables, read_nearest, read_svm, run_arm

NUMBERS = {
    "learned_rms": 1e-3, "tracking_rms": 1e-8, "tracking_max": 2e-8, "duration": 4.0, "approach": 1.0, "factor": 1.0,
    "velocity_share": 0.25, "velocity_joint": 3, "acceleration_share": 0.5, "acceleration_joint": 0,
}  # fmt: skip


@pytest.fixture(scope="module")
def joints():
    pytest.importorskip("pinocchio", reason="the extra robot is not installed")
    pytest.importorskip("pink", reason="the extra robot is not installed")
    demos = load_lasa(["CShape", "Sshape"])[[0, 8]]
    return demos, *executed(demos)


def test_mujoco_finds_the_tip_on_the_recording(joints):
    """Another program's kinematics of the same arm: the tip draws the recording, four times as large, on one height."""
    mujoco = pytest.importorskip("mujoco")
    from kineme.robots import load

    demos, made, error = joints
    assert error < 5e-5
    arm = load("wam")
    model = mujoco.MjModel.from_xml_string(
        arm.source.read_text(encoding="utf-8")
        .replace("<robot ", '<robot xmlns:m="m" ', 1)
        .replace("</robot>", '<mujoco><compiler discardvisual="false" fusestatic="false"/></mujoco></robot>')
    )
    data = mujoco.MjData(model)
    at = [model.joint(name).qposadr[0] for name in arm.joints]
    for shown, one in zip(demos, made, strict=True):
        tip = []
        for q in one.positions:
            data.qpos[at] = q
            mujoco.mj_kinematics(model, data)
            tip.append(data.body(arm.tip).xpos.copy())
        tip = np.array(tip)
        even = np.linspace(shown.times[0], shown.times[-1], len(tip))
        drawn = np.column_stack([np.interp(even, shown.times, x) for x in shown.positions.T])
        np.testing.assert_allclose(tip[:, :2] - tip[-1, :2], SCALE * (drawn - drawn[-1]), atol=1e-4)
        np.testing.assert_allclose(tip[:, 2], tip[0, 2], atol=5e-5)


def test_joints_keep_times_labels_and_continuity(joints):
    demos, made, _ = joints
    assert made.labels.tolist() == demos.labels.tolist()
    assert made.lengths.tolist() == [150, 150]
    assert [one.times[-1] for one in made] == pytest.approx([one.times[-1] - one.times[0] for one in demos])
    assert max(np.abs(np.diff(one.positions, axis=0)).max() for one in made) < 0.05


def test_the_letter_is_written_as_learned(joints):
    letter = write_letter(one_c(0))
    off = np.linalg.norm(letter.written - letter.wanted, axis=1)
    assert letter.numbers["tracking_max"] >= off.max()
    assert letter.numbers["tracking_max"] < 5e-5
    assert letter.made.preflight.passed
    assert letter.numbers["duration"] == pytest.approx(one_c(0)[0].times[-1], rel=0.1)


def test_without_the_extra_a_sentence_says_which_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    result = run_arm(1, 0, 100)
    assert list(result) == ["missing"]
    (table,) = arm_tables(result, {})
    assert "kineme[robot]" in table.rows[0][1]


def test_what_is_said_of_the_letter_follows_from_its_numbers():
    said = read_letter(NUMBERS)
    assert "off the desired path by less than 0.1% of" in said
    assert "times as long" not in said
    assert "by 50.0% of" in read_letter(NUMBERS | {"tracking_rms": 5e-4})
    assert "1.050 times as long as it was demonstrated, since the arm starts from a stand" in read_letter(
        NUMBERS | {"factor": 1.05}
    )
    assert "since its limits demand it" in read_letter(NUMBERS | {"factor": 1.5, "velocity_share": 1.0})
    assert ("peak share of the velocity limits", "25%, joint 4") in letter_table(NUMBERS).rows


def draws(value):
    keys = {key for some in READINGS.values() for key in some}
    svm = {f"{key}/{name}/median": value[name == "tre"] for key in keys for name in ("rbf", "tre")}
    return [{"nearest": dict.fromkeys(keys, value[0]), "svm": svm}]


def test_what_is_said_of_the_arm_follows_from_its_draws():
    ahead, behind = (read_nearest(draws((a, 0)), draws((b, 0))) for a, b in ((0.9, 0.8), (0.7, 0.8)))
    assert "the arm is ahead of the plane in weights, original (0.900 against 0.800)" in ahead
    assert "the plane is ahead of the arm in weights, original (0.800 against 0.700)" in behind
    assert f"On the arm, {CLOSEST}, TrE is ahead of RBF" in read_svm(draws((0.5, 0.6)))
    assert f"On the arm, {CLOSEST}, RBF is ahead of TrE" in read_svm(draws((0.6, 0.5)))


def test_the_lock_of_the_demonstration_holds_what_moves_the_arm():
    root = Path(__file__).parents[3]
    extra = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    needed = {re.match(r"[\w-]+", requirement)[0] for requirement in extra["robot"]}
    locked = set(
        re.findall(r"^([\w-]+)==", (root / "requirements" / "run.txt").read_text(encoding="utf-8"), re.MULTILINE)
    )
    assert needed <= locked
