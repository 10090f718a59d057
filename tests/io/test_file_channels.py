"""What columns are, from the file on: names and kinds are kept, and what is no orientation is refused by name."""

import numpy as np
import pandas as pd
import pytest

import kineme
from kineme.errors import SpecificationError
from kineme.io.inspection.inspect import inspect
from kineme.orientation import PoseDMP, exp, product

HEADS = "frame_index,Sub Frame,t,pose.position.x," + ",".join(f"pose.orientation.{part}" for part in "xyzw")
N = 60


def write(path, spoiled=None, gripper="gripper", quaternion=4.0):
    u = np.linspace(0, 1, N)
    q = product(exp(np.outer(u, [0, 0.2, quaternion])), [0.0, 1.0, 0.0, 0.0])[:, [1, 2, 3, 0]]
    if spoiled is not None:
        q[spoiled] = 0.0
    table = np.column_stack([np.arange(N), np.zeros(N), u, u**2, q, np.mod(2 + 3 * u, np.pi * 2) - np.pi, u > 0.5])
    np.savetxt(path, table, delimiter=",", header=f"{HEADS},panda_joint1,{gripper}", comments="")
    return path


def test_names_and_kinds_are_kept_and_counters_are_left_out(tmp_path):
    for k in range(3):
        write(tmp_path / f"{k}.csv", quaternion=k + 1)
    recordings = kineme.read_recordings(tmp_path)
    demos = recordings.demonstrations
    assert [(channel.name, channel.kind) for channel in demos.channels] == [
        ("pose.position.x", "position"),
        ("pose.orientation", "orientation"),
        ("panda_joint1", "angle"),
        ("gripper", "discrete"),
    ]
    assert demos.dimensions == (
        "pose.position.x", "pose.orientation.rx", "pose.orientation.ry", "pose.orientation.rz", "panda_joint1",
    )  # fmt: skip
    assert recordings.detected[0][0].ignored == ("frame_index", "Sub Frame")
    assert np.abs(np.diff(demos[1].positions[:, 4])).max() < 0.1  # no jump where the joint wraps
    np.testing.assert_allclose(np.linalg.norm(demos.recorded[:, 1:5], axis=1), 1.0)
    assert set(demos.recorded[:, 6]) == {0.0, 1.0}
    recording = kineme.read_recording(tmp_path / "2.csv")
    assert recording.channels == demos.channels
    np.testing.assert_array_equal(recording.recorded, demos[2].recorded)


def test_a_quaternion_of_zero_costs_its_movement_and_names_the_line(tmp_path):
    write(tmp_path / "good.csv")
    write(tmp_path / "bad.csv", spoiled=7)
    recordings = kineme.read_recordings(tmp_path)
    assert [source.path for source in recordings.sources] == ["good.csv"]
    (problem,) = recordings.problems
    assert problem.file == "bad.csv"
    assert "expected unit quaternions in pose.orientation.x" in problem.reason
    assert "got norm 0 at sample 7; nothing was tracked there; leave such samples out" in problem.reason
    with pytest.raises(kineme.errors.DataError, match="found none; the first that is none: bad"):
        kineme.read_recordings(tmp_path / "bad.csv")
    with pytest.raises(kineme.errors.DataError, match="expected unit quaternions"):
        kineme.read_recording(write(tmp_path / "alone.csv", spoiled=7))


def test_a_file_of_other_heads_is_no_company_for_orientations(tmp_path):
    for k in range(2):
        write(tmp_path / f"{k}.csv")
    write(tmp_path / "other.csv", gripper="claw")
    recordings = kineme.read_recordings(tmp_path)
    assert len(recordings) == 2
    assert "the columns ['claw'] where most files have ['gripper']; say --excl" in recordings.problems[0].reason


def written(path, order, gripper, positions="xy"):
    u = np.linspace(0, 1, N)
    q = exp(np.outer(u, [0.2, 0.5, 2.0]))[:, ["wxyz".index(part) for part in order]]
    xy = np.column_stack([u, u**2])[:, ["xy".index(axis) for axis in positions]]
    heads = ",".join(["t", *positions, *(f"q{part} [rad]" for part in order), "gripper"])
    np.savetxt(path, np.column_stack([u, xy, q, gripper(u)]), delimiter=",", header=heads, comments="")


def test_quaternions_in_two_orders_are_read_in_that_of_most_files(tmp_path):
    for k, (order, positions) in enumerate([("wxyz", "xy"), ("xyzw", "xy"), ("xyzw", "yx")]):
        written(tmp_path / f"{k}.csv", order, lambda u: u > 0.5, positions)
    recordings = kineme.read_recordings(tmp_path)
    assert recordings.problems == ()
    demos = recordings.demonstrations
    assert [channel.order for channel in demos.channels if channel.kind == "orientation"] == ["wxyz"]
    for movement in demos[1:]:
        np.testing.assert_allclose(movement.recorded, demos[0].recorded)
    assert sum(n for _, n in recordings.detected) == 3
    assert len(recordings.detected) == 3
    (note,) = [note for note in inspect(recordings).notes if "order" in note]
    assert note == (
        "some files have the columns qx [rad], qy [rad], qz [rad], qw [rad] in this order: they are read as "
        "qw [rad], qx [rad], qy [rad], qz [rad], that of most files"
    )
    assert not any("order" in note for note in inspect(kineme.read_recordings(tmp_path / "1.csv")).notes)


def test_plain_columns_in_two_orders_are_told_apart_by_their_names(tmp_path):
    u = np.linspace(0, 1, N)
    for k, heads in enumerate(("x [m],y [m]", "y [m],x [m]")):
        columns = np.column_stack([u, 5 * u**2])[:, [0, 1] if k == 0 else [1, 0]]
        np.savetxt(
            tmp_path / f"{k}.csv", np.column_stack([u, columns]), delimiter=",", header=f"t,{heads}", comments=""
        )
    recordings = kineme.read_recordings(tmp_path)
    demos = recordings.demonstrations
    np.testing.assert_allclose(demos[0].positions, demos[1].positions)
    assert [(channel.name, channel.unit) for channel in demos.channels] == [("x [m]", "m"), ("y [m]", "m")]


@pytest.mark.parametrize("first", ["continuous", "switched"])
def test_what_a_gripper_is_is_decided_for_all_files_of_a_set(tmp_path, first):
    grippers = [lambda u: 0.04 * u, lambda u: 0.04 * (u > 0.5)]
    for k, gripper in enumerate(grippers if first == "continuous" else grippers[::-1]):
        written(tmp_path / f"{k}.csv", "wxyz", gripper)
    recordings = kineme.read_recordings(tmp_path)
    assert (len(recordings), recordings.problems) == (2, ())
    assert recordings.demonstrations.channels[-1].kind == "position"
    switched = kineme.read_recordings(tmp_path / ("1.csv" if first == "continuous" else "0.csv"))
    assert switched.demonstrations.channels[-1].kind == "discrete"


def test_the_caller_says_what_columns_are(tmp_path):
    path = write(tmp_path / "a.csv", gripper="g")
    assert kineme.read_recordings(path).demonstrations.channels[-1].kind == "position"
    assert kineme.read_recordings(path, kinds={"g": "discrete"}).demonstrations.channels[-1].kind == "discrete"
    with pytest.raises(SpecificationError, match="'h'; read are"):
        kineme.read_recordings(path, kinds={"h": "discrete"})


def test_a_recognizer_takes_poses_as_they_are_read(tmp_path):
    for k in range(4):
        folder = tmp_path / ("turn" if k % 2 else "twist")
        folder.mkdir(exist_ok=True)
        write(folder / f"{k}.csv", quaternion=1.0 + 4 * (k % 2) + 0.1 * k)
    demos = kineme.read_recordings(tmp_path, columns=HEADS.split(",")[4:]).demonstrations
    recognizer = kineme.Recognizer().fit(demos[::2])
    assert recognizer.predict(demos[1::2]).tolist() == demos.labels[1::2].tolist()


def test_angles_of_files_without_names_are_continuous_too(tmp_path):
    t = np.linspace(0, 1, N)
    wrapped = np.mod(2 + 3 * t + np.pi, 2 * np.pi) - np.pi
    for name in ("a", "b", "q1"):
        table = np.column_stack([t, wrapped])
        heads = {"a": "t,yaw", "b": "", "q1": "t,x1"}[name]
        np.savetxt(tmp_path / f"{name}.csv", table, delimiter=",", header=heads, comments="")
    recordings = kineme.read_recordings(tmp_path)
    assert (len(recordings), recordings.demonstrations.channels) == (3, None)
    np.testing.assert_allclose(np.ptp(recordings.demonstrations.positions.reshape(3, N), axis=1), 3)
    assert len(kineme.read_recordings(tmp_path, kinds={"yaw": "position"})) == 3


@pytest.mark.parametrize("before", ["field.", "/pose/", ""])
def test_headers_of_messages_are_no_coordinates(tmp_path, before):
    """As `rostopic echo -p`, PlotJuggler and bagpy write them."""
    u = np.linspace(0, 1, N)
    q = exp(np.outer(u, [0, 0.2, 2.0]))[:, [1, 2, 3, 0]]
    heads = ["%time", *(f"{before}header.{part}" for part in ("seq", "stamp", "stamp.nsecs", "frame_id"))]
    heads += [f"{before}pose.position.x", *(f"{before}pose.orientation.{part}" for part in "xyzw")]
    table = np.column_stack([1.7e18 + 1e9 * u, np.arange(N), 1.7e18 + 1e9 * u, 1e9 * u, np.zeros(N), u**2, q])
    np.savetxt(tmp_path / "a.csv", table, delimiter=",", header=",".join(heads), comments="")
    recordings = kineme.read_recordings(tmp_path)
    assert [channel.kind for channel in recordings.demonstrations.channels] == ["position", "orientation"]
    assert recordings.detected[0][0].ignored == tuple(heads[1:5])
    assert recordings.demonstrations.durations[0] == pytest.approx(1)


def test_columns_of_a_quaternion_that_stand_apart_are_read_alike_from_files_and_frames(tmp_path):
    u = np.linspace(0, 1, 40)
    q = np.column_stack([np.cos(u), np.sin(u) * 0.6, 0 * u, np.sin(u) * 0.8])
    columns = {"t": u, "qw": q[:, 0], "x": u**2, "qx": q[:, 1], "y": 1 - u, "qy": q[:, 2], "qz": q[:, 3]}
    frame = pd.DataFrame(columns)
    frame.to_csv(tmp_path / "apart.csv", index=False)
    for demos in (kineme.read_recordings(tmp_path / "apart.csv").demonstrations, kineme.Demonstrations.of(frame)):
        assert demos.dimensions == ("q.rx", "q.ry", "q.rz", "x", "y")
        np.testing.assert_allclose(demos.recorded, np.column_stack([q, u**2, 1 - u]), atol=1e-12)


def test_a_quaternion_that_is_none_costs_its_sample_alone_where_that_is_asked_for(tmp_path):
    write(tmp_path / "0.csv", spoiled=7)
    write(tmp_path / "1.csv")
    recordings = kineme.read_recordings(tmp_path, skip="sample")
    assert np.diff(recordings.demonstrations.offsets).tolist() == [N - 1, N]
    (problem,) = recordings.problems
    assert problem.file == "0.csv"
    assert "expected unit quaternions" in problem.reason
    assert problem.reason.endswith("this sample left out")


def test_the_rollout_of_poses_has_the_channels_of_the_recording_and_one_of_rotation_vectors_has_none(tmp_path):
    write(tmp_path / "0.csv")
    demos = kineme.read_recordings(tmp_path / "0.csv").demonstrations
    poses = kineme.Demonstrations.of(PoseDMP().learn(demos).rollout())
    assert [(channel.name, channel.kind) for channel in poses.channels] == [
        (channel.name, channel.kind) for channel in demos.channels
    ]
    assert kineme.Demonstrations.of(kineme.DMP().learn(demos).rollout()).channels is None
