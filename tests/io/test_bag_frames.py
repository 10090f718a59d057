"""The pose of one frame in another, composed of the transforms of a bag, beside SciPy's rotations."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import kineme
from bag_files import KINDS, SECOND, START, Maker, pose_rows, stamps, write_bag
from kineme.io.reading.recordings import read_recordings

EVERY = pytest.mark.parametrize("kind", KINDS)


def matrices(rows):
    """Poses (n, 7) as (n, 4, 4)."""
    result = np.tile(np.eye(4), (len(rows), 1, 1))
    result[:, :3, :3] = Rotation.from_quat(rows[:, 3:]).as_matrix()
    result[:, :3, 3] = rows[:, :3]
    return result


def tf(m, ns, *transforms, topic="/tf", late=0):
    return topic, ns + late, m.tf(*(m.transform_stamped(ns, *transform) for transform in transforms))


def only(path, frame=None, **options):
    read = read_recordings(path, frame=frame, **options)
    (movement,) = read.demonstrations
    return movement, read.detected[0][0], [problem.reason for problem in read.problems]


def a_robot(m, n=60):
    """World, base and hand move, a camera is fixed on the base: messages, and the moving poses."""
    base, hand, camera = pose_rows(n, 1), pose_rows(n, 2), pose_rows(n, 3)[:1]
    messages = [tf(m, START, ("base", "camera", camera[0]), topic="/tf_static")]
    messages += [
        tf(m, ns, ("world", "base", base[k]), ("/base", "/hand", hand[k]), late=5_000_000)
        for k, ns in enumerate(stamps(n))
    ]
    return messages, base, hand, camera


@EVERY
def test_transforms_are_composed_along_the_tree(tmp_path, kind):
    messages, base, hand, camera = a_robot(Maker(kind))
    path = write_bag(tmp_path, kind, messages)
    expected = {
        "world:hand": matrices(base) @ matrices(hand),
        "hand:world": np.linalg.inv(matrices(base) @ matrices(hand)),
        "camera:hand": np.linalg.inv(matrices(camera)) @ matrices(hand),
        "camera:world": np.linalg.inv(matrices(base) @ matrices(camera)),
        "/world:base": matrices(base),
    }
    for frame, poses in expected.items():
        movement, how, problems = only(path, frame)
        np.testing.assert_allclose(matrices(movement.recorded), poses, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(movement.recorded[:, 3:], axis=1), 1.0, atol=1e-12)
        assert (np.sum(movement.recorded[1:, 3:] * movement.recorded[:-1, 3:], axis=1) > 0).all()
        assert how.layout == f"frames {frame.removeprefix('/')}"
        assert (how.time, how.units_from) == ("header.stamp", "stamps of headers")
        assert problems == []
    np.testing.assert_allclose(movement.times, np.array(stamps(60)) / SECOND, rtol=0, atol=3e-7)


@EVERY
def test_transforms_at_other_rates_are_interpolated_on_the_sphere(tmp_path, kind):
    """Every second transform is enough where the rotation is about one axis at one speed."""
    m = Maker(kind)
    arm, slow = pose_rows(60, 1), pose_rows(60, 2)
    slow[:, :3] = np.linspace(0, 1, 60)[:, None] * [1, 2, 3]
    slow[::4, 3:] *= -1.0  # the same rotations
    messages = []
    for k, ns in enumerate(stamps(60)):
        messages.append(tf(m, ns, ("base", "arm", arm[k])))
        if k % 2 == 1:
            messages.append(tf(m, ns, ("arm", "hand", slow[k])))
            messages.append(tf(m, ns, ("arm", "hand", slow[k]), late=1))  # repeated, as some nodes do
    movement, how, problems = only(write_bag(tmp_path, kind, messages), "base:hand")
    assert how.units_from == "stamps of headers"
    assert problems == ["frames base:hand: 1 stamp of transform base:arm, at which others are not known"]
    np.testing.assert_allclose(matrices(movement.recorded), (matrices(arm) @ matrices(slow))[1:], atol=1e-9)


def test_interpolation_is_that_of_scipy():
    from kineme.io.ros.streams import interpolated

    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.1, 1, 20))
    q = rng.normal(size=(20, 4))
    q[7] = q[6]  # it rests
    q[9] = -q[8]
    at = np.sort(rng.uniform(times[0], times[-1], 300))
    expected = Slerp(times, Rotation.from_quat(q))(at).as_matrix()
    np.testing.assert_allclose(Rotation.from_quat(interpolated(at, times, q)).as_matrix(), expected, atol=1e-9)


def test_a_bag_with_one_transform_needs_no_frames(tmp_path):
    m, rows = Maker("mcap"), pose_rows()
    messages = [tf(m, ns, ("world", "hand", row)) for ns, row in zip(stamps(), rows, strict=True)]
    path = write_bag(tmp_path, "mcap", messages)
    for options in ({}, {"topic": "/tf"}):
        movement, how, _ = only(path, **options)
        np.testing.assert_allclose(movement.recorded, rows, atol=1e-12)
        assert how.layout == "frames world:hand"


def test_frames_and_topics_are_put_side_by_side(tmp_path):
    m = Maker("mcap")
    messages, base, *_ = a_robot(m)
    messages += [("/joints", ns, m.joint_state(ns, ["grip"], [k])) for k, ns in enumerate(stamps(60))]
    path = write_bag(tmp_path, "mcap", sorted(messages, key=lambda message: message[1]))
    movement, how, _ = only(path, ["world:base", "base:hand"], topic="/joints")
    assert how.columns[0] == "world:base.position.x"
    assert how.columns[7] == "base:hand.position.x"
    assert how.columns[14] == "grip"
    np.testing.assert_allclose(movement.recorded[:, :7], base, atol=1e-12)
    np.testing.assert_allclose(movement.recorded[:, 14], range(60), atol=1e-6)
    with pytest.raises(
        kineme.errors.DataError, match=r"got /joints .*, /tf .*; the pose of one frame .* --frame parent:child"
    ):
        read_recordings(path)


def test_frames_that_are_not_there_or_not_connected_are_listed(tmp_path):
    m = Maker("mcap")
    messages, *_ = a_robot(m)
    messages += [tf(m, ns, ("marker", "cup", row)) for ns, row in zip(stamps(), pose_rows(), strict=True)]
    path = write_bag(tmp_path, "mcap", messages)

    def refused(frame, message):
        with pytest.raises(kineme.errors.DataError, match=re.escape(message)):
            read_recordings(path, frame=frame)

    refused("world:hnd", "expected a frame 'hnd' (did you mean hand?), got the frames ['base', 'camera', 'cup', 'hand'")
    refused(
        "world:cup",
        "expected transforms that lead from 'world' to 'cup', got none; 'world' is connected with "
        "['base', 'camera', 'hand'], 'cup' with ['marker']",
    )
    refused("base:camera", "frames base:camera: expected a frame that moves in the other, got transforms that never")
    refused("hand:hand", "expected two frames, got 'hand' twice")
    refused("hand", "expected two frames as parent:child, got 'hand'")
    refused(None, "expected two frames, got the transforms base:camera, base:hand, marker:cup, world:base; say which")


def test_two_clocks_in_transforms(tmp_path):
    """One node's clock is set back: the time of recording is used for all."""
    m, rows = Maker("mcap"), pose_rows()
    messages = []
    for k, (ns, row) in enumerate(zip(stamps(), rows, strict=True)):
        stamped = m.transform_stamped(ns - (3600 * SECOND if k > 20 else 0), "world", "hand", row)
        messages.append(("/tf", ns, m.tf(stamped)))
    movement, how, problems = only(write_bag(tmp_path, "mcap", messages), "world:hand")
    np.testing.assert_allclose(movement.recorded, rows, atol=1e-12)
    np.testing.assert_allclose(movement.times, np.array(stamps()) / SECOND, rtol=0, atol=3e-7)
    assert how.time == "recorded"
    assert "the stamp in the header of message 21 of transform world:hand is earlier" in how.units_from
    assert problems == []


def test_rotations_that_are_none_and_other_parents_are_named(tmp_path):
    m, rows = Maker("mcap"), pose_rows()
    rows[5, 3:] = 0.0
    messages = [tf(m, ns, ("world", "hand", row)) for ns, row in zip(stamps(), rows, strict=True)]
    messages.append(tf(m, START + 1, ("cup", "hand", rows[0]), late=SECOND))
    movement, _, problems = only(write_bag(tmp_path, "mcap", messages), "world:hand")
    np.testing.assert_allclose(movement.recorded, np.delete(rows, 5, axis=0), atol=1e-12)
    assert problems == [
        "transform world:hand: expected rotations of norm 1, got 0 in 1 transform",
        "frame 'hand': 1 transform from another parent, 'cup'",
    ]
    rows[:, 3:] = 0.0
    messages = [tf(m, ns, ("world", "hand", row)) for ns, row in zip(stamps(), rows, strict=True)]
    with pytest.raises(
        kineme.errors.DataError, match=r"transform world:hand: expected rotations of norm 1, got 0 in 50"
    ):
        read_recordings(write_bag(tmp_path, "mcap", messages, "none"), frame="world:hand")


def test_transforms_that_share_no_time_are_named(tmp_path):
    m, rows = Maker("mcap"), pose_rows()
    messages = [tf(m, ns, ("a", "b", row)) for ns, row in zip(stamps(), rows, strict=True)]
    messages += [tf(m, ns + 9 * SECOND, ("b", "c", row)) for ns, row in zip(stamps(), rows, strict=True)]
    with pytest.raises(
        kineme.errors.DataError, match=r"frames a:c: expected transforms that are known at the same time"
    ):
        read_recordings(write_bag(tmp_path, "mcap", messages), frame="a:c")


def test_a_bag_without_transforms_is_named(tmp_path):
    path = write_bag(tmp_path, "mcap", [("/chat", START, Maker("mcap").string("x"))])
    with pytest.raises(kineme.errors.DataError, match=r"expected a topic of transforms, such as /tf, got none"):
        read_recordings(path, frame="a:b")


def test_frames_of_two_robots_are_told_apart_by_their_topics(tmp_path):
    m, rows = Maker("mcap"), {"/left": pose_rows(50, 1), "/right": pose_rows(50, 2)}
    tool = pose_rows(1, 3)
    messages = [tf(m, START, ("hand", "tool", tool[0]), topic=f"{robot}/tf_static") for robot in rows]
    for k, ns in enumerate(stamps()):
        messages += [tf(m, ns, ("base", "hand", rows[robot][k]), topic=f"{robot}/tf") for robot in rows]
    path = write_bag(tmp_path, "mcap", messages)
    for robot, poses in rows.items():
        movement, _, problems = only(path, "base:tool", topic=f"{robot}/tf")
        np.testing.assert_allclose(matrices(movement.recorded), matrices(poses) @ matrices(tool), atol=1e-12)
        assert problems == []
