"""Topics of bags of ROS 1 and ROS 2: which are read, as which columns, with which stamps."""

import numpy as np
import pytest

import kineme
from bag_files import KINDS, SECOND, START, Maker, pose_rows, stamps, write_bag
from kineme.io.limits import VARIABLE
from kineme.io.reading.recordings import read_recording, read_recordings

POSE = tuple(f"position.{axis}" for axis in "xyz") + tuple(f"orientation.{axis}" for axis in "xyzw")
EVERY = pytest.mark.parametrize("kind", KINDS)


def seconds(ns):
    return np.array([stamp // SECOND for stamp in ns]) + np.array([stamp % SECOND for stamp in ns]) / SECOND


def only(path, **options):
    """The only movement of a bag, how it was read, and the problems."""
    read = read_recordings(path, **options)
    (movement,) = read.demonstrations
    return movement, read.detected[0][0], [problem.reason for problem in read.problems]


@pytest.mark.parametrize("compress", [False, True])
@EVERY
def test_the_only_topic_that_can_be_read_is_read(tmp_path, kind, compress):
    m, rows = Maker(kind), pose_rows()
    messages = [("/tool", ns + 7_000_000, m.pose_stamped(ns, row)) for ns, row in zip(stamps(), rows, strict=True)]
    messages += [("/chat", START, m.string("hello")), ("/empty", "sensor_msgs/msg/JointState", None)]
    path = write_bag(tmp_path, kind, messages, compress=compress)
    movement, how, problems = only(path)
    np.testing.assert_array_equal(movement.recorded, rows)
    np.testing.assert_allclose(movement.times, seconds(stamps()), rtol=0, atol=3e-7)
    assert how.columns == POSE
    assert how.layout == "topic /tool of geometry_msgs/msg/PoseStamped"
    assert (how.time, how.units, how.units_from, how.ignored) == (
        "header.stamp",
        "s",
        "stamps of headers",
        (),
    )
    assert problems == []
    assert read_recordings(path).sources[0].path == path.name


@pytest.mark.parametrize("ending", ["db3", "mcap"])
def test_a_database_or_an_mcap_alone_is_read_too(tmp_path, ending):
    kind = "mcap" if ending == "mcap" else "sqlite3"
    m = Maker(kind)
    messages = [("/joints", ns, m.joint_state(ns, ["a", "b"], [k, k * k])) for k, ns in enumerate(stamps(9))]
    (path,) = write_bag(tmp_path, kind, messages).glob(f"*.{ending}")
    assert read_recording(path).recorded.tolist() == [[k, k * k] for k in range(9)]
    assert only(path)[1].columns == ("a", "b")


def of_every_type(m):
    """Type -> (message of the k-th sample, columns, numbers of that sample)."""
    row = pose_rows()
    pose = {k: m.pose(row[k]) for k in range(len(row))}
    six = [f"{part}.{axis}" for part in ("linear", "angular") for axis in "xyz"]
    cov = np.zeros(36)
    poses = [f"poses.{i}.{head}" for i in range(2) for head in POSE]
    stamped = {
        "PoseArray": (lambda h, k: {"header": h, "poses": [pose[k], pose[k + 1]]}, poses, [*row[3], *row[4]]),
        "TwistStamped": (lambda h, k: {"header": h, "twist": m.twist(row[k][:6])}, six, row[3][:6]),
        "PointStamped": (
            lambda h, k: {"header": h, "point": m.vector(row[k], "geometry_msgs/msg/Point")}, POSE[:3], row[3][:3],
        ),
        "Vector3Stamped": (
            lambda h, k: {"header": h, "vector": m.vector(row[k])}, ("vector.x", "vector.y", "vector.z"), row[3][:3],
        ),
    }  # fmt: skip
    messages = {
        f"geometry_msgs/msg/{name}": (
            lambda ns, k, name=name, fields=fields: m.make(f"geometry_msgs/msg/{name}", **fields(m.header(ns), k)),
            columns,
            numbers,
        )
        for name, (fields, columns, numbers) in stamped.items()
    }
    messages["geometry_msgs/msg/Pose"] = lambda ns, k: pose[k], POSE, row[3]
    messages["geometry_msgs/msg/Twist"] = lambda ns, k: m.twist(row[k][:6]), six, row[3][:6]
    messages["geometry_msgs/msg/TransformStamped"] = (
        lambda ns, k: m.transform_stamped(ns, "world", "hand", row[k]), POSE, row[3],
    )  # fmt: skip
    messages["std_msgs/msg/Float64MultiArray"] = (
        lambda ns, k: m.numbers(row[k][:3]), ("data.0", "data.1", "data.2"), row[3][:3],
    )  # fmt: skip
    messages["nav_msgs/msg/Odometry"] = (
        lambda ns, k: m.make(
            "nav_msgs/msg/Odometry",
            header=m.header(ns),
            child_frame_id="base",
            pose=m.make("geometry_msgs/msg/PoseWithCovariance", pose=pose[k], covariance=cov),
            twist=m.make("geometry_msgs/msg/TwistWithCovariance", twist=m.twist(np.ones(6)), covariance=cov),
        ),
        POSE,
        row[3],
    )
    return messages


@pytest.mark.parametrize("name", of_every_type(Maker("mcap")))
@EVERY
def test_messages_of_every_type_become_rows(tmp_path, kind, name):
    message, columns, numbers = of_every_type(Maker(kind))[name]
    at = stamps(12)
    path = write_bag(tmp_path, kind, [("/it", ns + 5, message(ns, k)) for k, ns in enumerate(at)])
    movement, how, _ = only(path)
    assert how.columns == tuple(columns)
    np.testing.assert_array_equal(movement.recorded[3], numbers)
    has_header = name.endswith(("Stamped", "PoseArray", "Odometry"))
    assert (how.time == "header.stamp") == has_header
    if not has_header:
        assert how.units_from == "time of recording: /it has no stamps in headers"


@EVERY
def test_several_topics_are_put_side_by_side_at_the_stamps_of_the_first(tmp_path, kind):
    m = Maker(kind)
    first, second = stamps(40, 100.0), stamps(30, 50.0, START - SECOND // 100)
    messages = [("/arm", ns, m.joint_state(ns, ["a"], [k])) for k, ns in enumerate(first)]
    messages += [("/grip", ns, m.joint_state(ns, ["g"], [(ns - START) / SECOND])) for ns in second]
    path = write_bag(tmp_path, kind, sorted(messages, key=lambda message: message[1]))
    movement, how, problems = only(path, topic=["/arm", "grip"])
    assert how.columns == ("a", "g")
    np.testing.assert_allclose(movement.recorded[:, 0], range(40))
    np.testing.assert_allclose(movement.recorded[:, 1], np.arange(40) / 100, atol=1e-9)
    assert problems == []
    movement, how, problems = only(path, topic=["/grip", "/arm"])
    assert how.columns == ("g", "a")
    assert problems == ["10 samples of /grip before /arm begins or after it ends"]
    with pytest.raises(
        kineme.errors.DataError, match=r"got /arm \(sensor_msgs/msg/JointState, 40 messages\), /grip .*--topic /a"
    ):
        read_recordings(path)
    with pytest.raises(kineme.errors.DataError, match=r"topic '/gripp' \(did you mean /grip\?\)"):
        read_recordings(path, topic="/gripp")


def test_angles_of_another_topic_turn_through_their_border_and_grippers_switch(tmp_path):
    m, messages = Maker("mcap"), []
    for ns in stamps(40, 50.0):
        messages.append(("/arm", ns, m.joint_state(ns, ["a"], [(ns - START) / SECOND])))
    for ns in stamps(30, 33.0):
        t = (ns - START) / SECOND
        wrapped = (2 + 3 * t + np.pi) % (2 * np.pi) - np.pi
        messages.append(("/wheels", ns, m.joint_state(ns, ["wheel_joint", "other"], [wrapped, wrapped])))
        messages.append(("/hand", ns, m.joint_state(ns, ["gripper"], [float(t > 0.5)])))
    path = write_bag(tmp_path, "mcap", sorted(messages, key=lambda message: message[1]))
    read = read_recordings(path, topic=["/arm", "/wheels", "/hand"], kinds={"other": "position"})
    (movement,) = read.demonstrations
    t, wheel, other, gripper = movement.recorded.T
    np.testing.assert_allclose(wheel, 2 + 3 * t, atol=1e-6)
    assert np.abs(other[1:] - other[:-1]).max() > 2  # which does not wrap, as was said
    assert {*gripper.tolist()} == {0.0, 1.0}


def test_equal_columns_of_two_topics_carry_the_names_of_their_topics(tmp_path):
    m, rows, other = Maker("mcap"), pose_rows(), pose_rows(seed=1)
    messages = []
    for ns, a, b in zip(stamps(), rows, other, strict=True):
        messages += [("/left", ns, m.pose_stamped(ns, a)), ("/right", ns, m.pose_stamped(ns, b))]
    movement, how, _ = only(write_bag(tmp_path, "mcap", messages), topic=("/left", "/right"))
    assert how.columns == (*(f"/left.{head}" for head in POSE), *(f"/right.{head}" for head in POSE))
    np.testing.assert_allclose(movement.recorded, np.hstack((rows, other)), atol=1e-12)


def test_joints_in_another_order_and_of_other_nodes(tmp_path):
    m = Maker("mcap")
    messages = []
    for k, ns in enumerate(stamps(20)):
        names, row = (["a", "b"], [k, 2 * k]) if k % 2 else (["b", "a"], [2 * k, k])
        messages.append(("/joints", ns, m.joint_state(ns, names, row)))
        if k % 2:
            messages.append(("/joints", ns + 1, m.joint_state(ns + 1, ["finger_index_0"], [5.0])))
        if k == 3:
            messages.append(("/joints", ns + 2, m.joint_state(ns + 2, ["a", "c"], [0, 0])))
            messages.append(("/joints", ns + 3, m.joint_state(ns + 3, [], [])))
    movement, how, problems = only(write_bag(tmp_path, "mcap", messages))
    assert how.columns == ("b", "a", "finger_index_0")
    inside = movement.recorded
    np.testing.assert_array_equal(inside[:, 0], 2 * inside[:, 1])
    assert problems == [
        "topic /joints: 1 message without positions",
        "topic /joints: 1 message with other columns ['a', 'c'], which share 'a'",
        "2 samples of /joints (b, a) before /joints (finger_index_0) begins or after it ends",
    ]


def test_columns_of_stamps_and_joints_are_chosen_by_name(tmp_path):
    m = Maker("mcap")
    names = ["time", "label", "index_0", "id"]  # names that mean something in a table of text
    messages = [("/joints", ns + 9000, m.joint_state(ns, names, [k] * 4)) for k, ns in enumerate(stamps(9))]
    path = write_bag(tmp_path, "mcap", messages)
    assert only(path)[1].columns == tuple(names)
    _, how, _ = only(path, columns=["id", "time"], time="recorded")
    assert (how.columns, how.time, how.units_from) == (("id", "time"), "recorded", "as asked for")
    assert how.ignored == ("label", "index_0")
    with pytest.raises(kineme.errors.DataError, match="expected a column 'x', got the columns"):
        read_recordings(path, columns="x")
    with pytest.raises(kineme.errors.DataError, match="expected movements that are told apart by messages"):
        read_recordings(path, label="label")


@EVERY
@pytest.mark.parametrize(
    ("shift", "said"),
    [
        ({20: -SECOND}, "the stamp in the header of message 20 of /tool is earlier than that before"),
        ({20: -SECOND // 100}, "the stamp in the header of message 20 of /tool repeats the one before"),
        (None, "the stamps in the headers of /tool are 0"),
    ],
)
def test_stamps_of_headers_that_do_not_increase_are_not_the_time(tmp_path, kind, shift, said):
    m, messages = Maker(kind), []
    for k, (ns, row) in enumerate(zip(stamps(), pose_rows(), strict=True)):
        stamp = 0 if shift is None else ns + shift.get(k, 0)
        messages.append(("/tool", ns + 3_000_000, m.pose_stamped(stamp, row)))
    movement, how, _ = only(write_bag(tmp_path, kind, messages))
    assert (how.time, how.units_from) == ("recorded", f"time of recording: {said}")
    np.testing.assert_allclose(movement.times, seconds(stamps()) + 0.003, rtol=0, atol=3e-7)


@EVERY
def test_each_planned_trajectory_is_a_movement(tmp_path, kind):
    m, messages = Maker(kind), []
    for k, n in enumerate((10, 12, 2)):
        times = [i * SECOND // 10 for i in range(n)]
        messages.append(("/plan", START + k, m.joint_trajectory("ab", times, [[i, i * k] for i in range(n)])))
    messages.append(("/plan", START + 5, m.joint_trajectory("c", [0], [[1]])))
    messages.append(("/plan", START + 6, m.joint_trajectory("ab", [0], [[1]])))
    read = read_recordings(write_bag(tmp_path, kind, messages))
    assert [(source.place, len(x)) for source, x in zip(read.sources, read.demonstrations, strict=True)] == [
        ("0", 10),
        ("1", 12),
    ]
    how = read.detected[0][0]
    assert (how.columns, how.time, how.movement) == (("a", "b"), "time_from_start", ("message",))
    np.testing.assert_allclose(read.demonstrations[1].times, np.arange(12) / 10)
    assert [problem.reason for problem in read.problems] == [
        "movement 2: expected at least 4 samples, got 2",
        "topic /plan: message 4: expected a position for each of 2 joints, got 1",
        "topic /plan: 1 message with other columns ['c']",
    ]


@pytest.mark.parametrize("stamped", [True, False])
def test_each_path_is_a_movement(tmp_path, stamped):
    m, rows = Maker("mcap"), pose_rows(12)
    messages = [("/path", START + k, m.path(stamps(12) if stamped else [0] * 12, rows)) for k in range(2)]
    read = read_recordings(write_bag(tmp_path, "mcap", messages))
    assert len(read) == 2
    np.testing.assert_array_equal(read.demonstrations[1].recorded, rows)
    how = read.detected[0][0]
    assert how.time == ("header.stamp" if stamped else None)
    duration = 11 / 100 if stamped else 1.0
    np.testing.assert_allclose(read.demonstrations.durations, duration, atol=1e-6)


def test_orientations_that_were_never_set_are_left_out(tmp_path):
    m, rows = Maker("mcap"), pose_rows()
    rows[:, 3:] = 0.0
    path = write_bag(
        tmp_path, "mcap", [("/p", ns, m.pose_stamped(ns, r)) for ns, r in zip(stamps(), rows, strict=True)]
    )
    movement, how, problems = only(path)
    assert how.columns == POSE[:3]
    np.testing.assert_array_equal(movement.recorded, rows[:, :3])
    assert problems == [f"topic /p: {', '.join(POSE[3:])}, which are 0 in every message"]


def test_a_quaternion_that_is_none_costs_the_movement_or_its_sample(tmp_path):
    m, rows = Maker("mcap"), pose_rows()
    rows[[7, 9], 3:] = 0.0
    path = write_bag(
        tmp_path, "mcap", [("/p", ns, m.pose_stamped(ns, r)) for ns, r in zip(stamps(), rows, strict=True)]
    )
    said = r"topic /p: expected orientations of norm 1, got the norm 0 in message 7; 1 more like this"
    with pytest.raises(kineme.errors.DataError, match=rf"{said}; to keep the others, say skip='sample'"):
        read_recordings(path)
    movement, _, problems = only(path, skip="sample")
    np.testing.assert_array_equal(movement.recorded, np.delete(rows, [7, 9], axis=0))
    assert problems == [said]
    for columns in (["position"], ["position.x", "position.y", "position.z"], ["pos*"]):
        movement, _, problems = only(path, columns=columns)
        np.testing.assert_array_equal(movement.recorded, rows[:, :3])
        assert problems == []
    for columns in (["position", "orientation"], ["position.x", "orientation.w"], [0, 1]):
        with pytest.raises(kineme.errors.DataError, match=said):
            read_recordings(path, columns=columns)


def test_a_topic_of_another_type_is_named(tmp_path):
    m = Maker("mcap")
    path = write_bag(tmp_path, "mcap", [("/chat", START + k, m.string("x")) for k in range(5)])
    with pytest.raises(
        kineme.errors.DataError, match=r"a topic of movements, got /chat \(std_msgs/msg/String, 5 messages\)"
    ):
        read_recordings(path)
    with pytest.raises(
        kineme.errors.DataError, match=r"/chat: expected numbers in messages of std_msgs/msg/String, got none"
    ):
        read_recordings(path, topic="/chat")


def test_an_empty_topic_is_named(tmp_path):
    path = write_bag(tmp_path, "mcap", [("/joints", "sensor_msgs/msg/JointState", None)])
    with pytest.raises(
        kineme.errors.DataError, match=r"topic /joints: expected samples of .*JointState, got no messages"
    ):
        read_recordings(path, topic="/joints")
    with pytest.raises(kineme.errors.DataError, match=r"got /joints \(sensor_msgs/msg/JointState, 0 messages\)"):
        read_recordings(path)


def test_the_limit_is_on_the_numbers_that_are_kept(tmp_path, monkeypatch):
    m = Maker("mcap")
    messages = [("/big", START, m.string("x" * 10**6))]
    messages += [("/joints", ns, m.joint_state(ns, ["a"], [k])) for k, ns in enumerate(stamps(9))]
    path = write_bag(tmp_path, "mcap", messages)
    monkeypatch.setenv(VARIABLE, "100000")
    assert len(read_recordings(path)) == 1
    many = [("/joints", START + k, m.joint_state(START + k, list("abc"), [k] * 3)) for k in range(2**14)]
    with pytest.raises(
        kineme.errors.DataError, match=f"a topic that takes at most 100,000 bytes of memory.*{VARIABLE}"
    ):
        read_recordings(write_bag(tmp_path, "mcap", many, "many"))


def test_without_rosbags_the_error_names_the_extra(tmp_path, monkeypatch):
    import sys

    path = write_bag(tmp_path, "mcap", [("/chat", START, Maker("mcap").string("x"))])
    monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
    with pytest.raises(kineme.errors.DataError, match=r"expected the package rosbags .*; pip install 'kineme\[ros\]'"):
        read_recordings(path)
