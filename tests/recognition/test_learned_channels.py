"""What was recorded of the movements that were learned decides what comes: converted, taken as it is, or refused."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme import Demonstrations, Recognizer, Trajectory
from kineme.errors import TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.movements.channels.coordinates import mean_turn
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import PoseDMP, exp, product
from kineme.recognition.classifiers import squares_beside_kernels
from kineme.recognition.early.live_state import LiveStatus
from kineme.similarity.describe import describe

XYZ = tuple(Channel(axis, "position", (axis,)) for axis in "xyz")
Q = Channel("q", "orientation", ("qx", "qy", "qz", "qw"), None, "xyzw")
GRIPPER = Channel("gripper", "discrete", ("gripper",))
POSE = (GRIPPER, *XYZ, Q)
JOINTS = tuple(Channel(f"joint{k}", "angle", (f"joint{k}",), period=2 * np.pi) for k in range(1, 4))


def poses(channels=POSE, seed=0, n=6):
    """Recorded columns of poses of two classes: of the channels, in the order of POSE."""
    random, blocks = np.random.default_rng(seed), []
    for i in range(n):
        u = np.linspace(0, 1, 40 + 3 * i)
        s = u**3 * (10 - 15 * u + 6 * u**2)
        bend = np.sin(np.pi * (1 + i % 2) * u)
        xyz = np.outer(s, [1.0, 0.2, 0.1 * i]) + np.outer(bend, [0.0, 0.5, 0.2]) + 0.01 * random.normal(size=3)
        q = product(exp(np.outer(s, [0, 0.3, 1.0 + i % 2])), exp(random.normal(size=3)))
        blocks.append(np.column_stack([s > 0.5, xyz, q[:, [1, 2, 3, 0]]]))
    times = [np.linspace(0, 2, len(block)) for block in blocks]
    plain = Demonstrations.from_arrays(blocks, ["ab"[i % 2] for i in range(n)], times)
    return Demonstrations.of_movements(of_channels(plain.movements, channels))


def nameless(demos):
    """Poses as arrays: positions, and quaternions (w, x, y, z)."""
    blocks = np.split(demos.recorded[:, [1, 2, 3, 7, 4, 5, 6]], demos.offsets[1:-1])
    return Demonstrations.from_arrays(blocks, demos.labels, [one.times for one in demos])


both = pytest.mark.parametrize("shown", [nameless, lambda demos: demos], ids=["nameless", "named"])


def joints(seed=0, n=6):
    """Joint angles that wrap, as recorded, and their times."""
    u = np.linspace(0, 1, 60)
    s = u**3 * (10 - 15 * u + 6 * u**2)
    paths = []
    for i in range(n):
        bend = np.sin(np.pi * (1 + i % 2) * u)
        path = 3.0 + np.outer(s, [1.0 + 0.1 * i, -0.5, 7.0]) + np.outer(bend, [0.3, 1.0, 0.1])
        paths.append((path + np.pi) % (2 * np.pi) - np.pi)
    return paths, ["ab"[i % 2] for i in range(n)]


def of_joints(paths, labels=None, channels=JOINTS):
    times = [np.linspace(0, 2, len(path)) for path in paths]
    plain = Demonstrations.from_arrays(paths, labels, times)
    return Demonstrations.of_movements(of_channels(plain.movements, channels))


@pytest.fixture(scope="module")
def of_poses():
    return Recognizer().fit(poses())


@pytest.fixture(scope="module")
def of_angles():
    return Recognizer().fit(of_joints(*joints()))


def same(answers, others):
    assert [one.label for one in answers] == [one.label for one in others]
    found, expected = ([(one.p_known, one.confidence) for one in some] for some in (answers, others))
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_it_says_what_it_learned_from_and_remembers(of_poses):
    assert of_poses.channels_ == POSE
    assert pickle.loads(pickle.dumps(of_poses)).channels_ == POSE
    assert of_poses.stream().channels == POSE
    assert Recognizer().fit(kineme.load_lasa()[:14]).channels_ is None


def test_recorded_columns_are_converted_and_coordinates_taken_as_they_are(of_poses):
    asked = poses(seed=1)
    expected = of_poses.recognize(asked)
    raw = [Trajectory(one.times, one.recorded) for one in asked]
    same(of_poses.recognize(raw), expected)
    same([of_poses.recognize(one) for one in raw], expected)
    same(of_poses.recognize([Trajectory(one.times, one.positions) for one in asked]), expected)


@both
def test_generated_poses_are_recognized_whatever_the_order_of_their_quaternions(of_poses, shown):
    asked = poses(seed=1)
    made = PoseDMP().learn(shown(asked)).rollout(n_samples=80)
    assert of_poses.predict(made).tolist() == list("ababab")
    assert [of_poses.recognize(one).label for one in made] == list("ababab")
    assert of_poses.predict(list(made)).tolist() == list("ababab")
    learned = of_poses.comparison_.checked(made)
    np.testing.assert_allclose(learned.positions[-1], asked.positions[-1], atol=0.02)
    again = Recognizer().fit(made)
    assert (again.n_dims_, again.predict(asked).tolist()) == (6, list("ababab"))


@both
def test_positions_in_a_unit_that_is_not_said_are_in_the_one_that_was_learned(shown):
    channels = (GRIPPER, *(one._replace(unit="mm") for one in XYZ), Q)
    demos = poses(channels)
    recognizer = Recognizer().fit(demos)
    assert np.ptp(demos.positions[:, 3:]) > 100
    made = PoseDMP().learn(shown(demos)).rollout(n_samples=80)
    learned = recognizer.comparison_.checked(made)
    np.testing.assert_allclose(learned.positions[-1, 3:], demos.positions[-1, 3:], atol=2)
    meters = poses((GRIPPER, *(one._replace(unit="m") for one in XYZ), Q))
    said = recognizer.comparison_.checked(meters).positions  # converted, and so is the lever of the orientations
    np.testing.assert_allclose(said, 1000 * meters.positions, rtol=1e-12, atol=1e-9)


def test_angles_are_unwrapped(of_angles):
    paths, labels = joints(seed=1)
    assert max(np.abs(np.diff(path, axis=0)).max() for path in paths) > 6
    raw = [Trajectory(np.linspace(0, 2, 60), path) for path in paths]
    same(of_angles.recognize(raw), of_angles.recognize(of_joints(paths)))
    assert of_angles.predict(raw).tolist() == labels


def test_columns_of_other_names_are_refused_and_taken_without_names(of_angles, of_poses):
    named = tuple(one._replace(name=f"arm_{k}", columns=(f"arm_{k}",)) for k, one in zip("abc", JOINTS, strict=True))
    paths, labels = joints()
    asked = of_joints(paths, channels=named)
    for ask in (of_angles.predict, of_angles.recognize, lambda movements: of_angles.spot(movements[0])):
        with pytest.raises(
            TrajectoryError, match=r"columns \['joint1', 'joint2', 'joint3'\], .* got \['arm_a', 'arm_b'"
        ):
            ask(asked)
    assert of_angles.predict([one.positions for one in asked]).tolist() == labels
    channels = (GRIPPER, *(one._replace(name=f"foot_{one.name}", columns=(f"foot_{one.name}",)) for one in XYZ), Q)
    right = tuple(one._replace(name=one.name.replace("foot", "hand")) for one in channels)
    right = tuple(one if one.kind != "position" else one._replace(columns=(one.name,)) for one in right)
    assert of_poses.predict(poses(channels)).tolist() == list("ababab")  # x, y, z may be those of a foot
    with pytest.raises(TrajectoryError, match=r"'hand_x'.* got .*'foot_x'"):
        Recognizer().fit(poses(right)).predict(poses(channels))


def test_columns_of_other_kinds_are_refused(of_angles, of_poses):
    named = tuple(one._replace(name=f"arm{k}", columns=(f"arm{k}",)) for k, one in enumerate(JOINTS))
    paths, _ = joints()
    positions = tuple(one._replace(kind="position", period=None) for one in named)
    with pytest.raises(TrajectoryError, match=r"expected movements recorded as joint1 \(angle\), .* got arm0 \(posit"):
        of_angles.recognize(of_joints(paths, channels=positions))
    with pytest.raises(TrajectoryError, match=r"got joint1 \(angle\).*say what they are by kinds="):
        Recognizer().fit(of_joints(*joints(), channels=positions)).predict(of_joints(paths))
    with pytest.raises(TrajectoryError, match=r"joint1 \(angle\).* got gripper \(discrete\), x \(position\)"):
        of_angles.predict(poses())
    with pytest.raises(TrajectoryError, match=r"q \(orientation in qx, qy, qz, qw\).* got joint1 \(angle\)"):
        of_poses.spot(of_joints(paths)[0])
    claw = replace(poses().movements, channels=(*XYZ, Q), recorded=poses().recorded[:, 1:])
    assert of_poses.predict(Demonstrations.of_movements(claw)).tolist() == list("ababab")


def test_columns_that_only_count_are_taken_as_without_names(of_angles, of_poses):
    paths, labels = joints()
    counted = tuple(Channel(f"x{k}", "position", (f"x{k}",)) for k in range(1, 9))
    unwrapped = [one.positions for one in of_joints(paths)]
    assert of_angles.predict(of_joints(paths, channels=counted[:3])).tolist() == labels
    assert Recognizer().fit(of_joints(unwrapped, labels, counted[:3])).predict(of_joints(paths)).tolist() == labels
    jumping = (*counted[:2], counted[2]._replace(kind="angle", period=2 * np.pi))  # by its values
    assert of_angles.predict(of_joints(paths, channels=jumping)).tolist() == labels
    raw = [one.recorded for one in poses()]
    assert of_poses.predict(of_joints(raw, channels=counted)).tolist() == list("ababab")
    millimeters = tuple(one._replace(unit="mm") for one in counted)
    with pytest.raises(TrajectoryError, match=r"recorded as gripper \(discrete\), .* got x1 \(position\)"):
        of_poses.predict(of_joints(raw, channels=millimeters))


def test_columns_of_the_same_names_are_what_was_learned_whatever_their_values_look_like(of_angles):
    paths, labels = joints()
    positions = tuple(one._replace(kind="position", period=None) for one in JOINTS)
    assert of_angles.predict(of_joints(paths, channels=positions)).tolist() == labels
    learned = of_angles.comparison_.checked(of_joints(paths, channels=positions))
    np.testing.assert_array_equal(learned.positions, of_joints(paths).positions)


def test_explanations_name_the_columns_that_were_learned_in_their_order():
    moved = ("speed", "load", "force", "torque")
    channels = tuple(Channel(name, "position", (name,)) for name in moved)
    u = np.linspace(0, 1, 60)
    shown = np.column_stack((np.sin(6 * u), u**2, np.sin(6 * u) * u**2, np.cos(3 * u)))
    other = np.column_stack((np.sin(9 * u), 1 - u**2, np.sin(9 * u) * u, np.cos(5 * u)))
    recognizer = Recognizer().fit(of_joints([shown, other], list("ab"), channels))
    asked = shown + np.outer(np.exp(-(((u - 0.5) / 0.05) ** 2)), [0, 0.8, 0, 0])
    for order in ([0, 1, 2, 3], [3, 2, 1, 0]):
        there = of_joints([asked[:, order]], channels=tuple(channels[k] for k in order))
        explained = recognizer.recognize(there)[0].explain()
        assert (explained.columns, explained.nearest.part) == (moved, "load")


def test_a_list_of_movements_of_several_channels_is_refused_too(of_poses):
    six = tuple(Channel(f"j{k}", "angle", (f"j{k}",), "rad") for k in range(6))
    odd = of_joints([np.cumsum(np.random.default_rng(0).normal(size=(30, 6)), axis=0)], ["a"], six)[0]
    with pytest.raises(TrajectoryError, match=r"index 1 of the list: .* got j0 \(angle\)"):
        of_poses.predict([poses()[0], odd])


@both
def test_movements_of_a_list_are_converted_by_their_own_channels(of_poses, shown):
    asked = poses(seed=1)
    made = PoseDMP().learn(shown(asked)).rollout(n_samples=80)
    found = of_poses.comparison_.checked([asked[0], made[0], made, Trajectory(asked[0].times, asked[0].recorded, "a")])
    assert len(found) == 9
    np.testing.assert_allclose(found[1].positions[-1], found[0].positions[-1], atol=0.02)
    np.testing.assert_allclose(found[8].positions, found[0].positions, atol=1e-12)


def test_another_width_is_refused_with_what_was_expected(of_poses, of_angles):
    walk = np.cumsum(np.random.default_rng(0).normal(size=(30, 5)), axis=0)
    with pytest.raises(
        TrajectoryError, match=r"8 columns, gripper \(discrete\), .* or of the 6 coord.*, got 5 columns"
    ):
        of_poses.predict([walk])
    with pytest.raises(TrajectoryError, match=r"of 3 dimensions as learned, got 5, .* joint1 \(angle\)"):
        of_angles.predict([walk])
    bad = poses()[0].recorded.copy()
    bad[7, 4:] *= 2
    with pytest.raises(TrajectoryError, match="sample 7: expected unit quaternions in qx, qy, qz, qw, got norm 2"):
        of_poses.predict([bad])


def test_movements_learned_as_plain_columns_are_asked_for_as_plain_columns(monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")  # to compile for seven columns takes longer
    demos = poses()
    plain = Demonstrations.from_arrays(np.split(demos.recorded, demos.offsets[1:-1]), demos.labels)
    assert Recognizer().fit(plain).predict(demos).tolist() == list("ababab")


@given(cuts=st.lists(st.integers(1, 60), max_size=5), which=st.sampled_from(["poses", "angles"]))
def test_a_stream_takes_recorded_columns_and_ends_with_the_batch_answer(of_poses, of_angles, cuts, which):
    if which == "poses":
        recognizer, one = of_poses, poses(seed=2)[4]
        raw, positions = one.recorded, one.positions
    else:
        paths, _ = joints(seed=2)
        recognizer, one, raw = of_angles, of_joints(paths)[3], paths[3]
        positions = one.positions
    live = recognizer.stream()
    for rows in np.split(np.arange(len(raw)), sorted(min(cut, len(raw)) for cut in cuts)):
        live.update(one.times[rows], raw[rows])
    np.testing.assert_allclose(live._path.kept()[:, 1:], positions, atol=1e-12)
    assert live.skipped == 0
    same([live.finish()], [recognizer.recognize(one)])


def test_a_stream_skips_samples_that_are_no_rotation_and_stays_with_its_width(of_poses):
    one, live = poses(seed=3)[0], of_poses.stream()
    clean = of_poses.stream()
    for k, (t, x) in enumerate(zip(one.times, one.recorded, strict=True)):
        state = live.update(t, x)
        clean.update(t, x)
        if k == 10:
            bad = live.update(t + 1e-3, 2 * x)
            assert bad.status & LiveStatus.NOT_UNIT
            assert "a quaternion that is not of norm 1" in " ".join(bad.status.messages)
            assert live.update(t + 1e-3, one.positions[k]).status & LiveStatus.WRONG_SHAPE
    assert (state.skipped, live.skipped) == (2, 2)
    np.testing.assert_array_equal(live._path.kept(), clean._path.kept())
    live.reset()
    assert not live.update(one.times, one.positions).status & LiveStatus.WRONG_SHAPE


def test_a_spinning_joint_is_not_taken_for_a_wrapping_one_when_it_is_averaged(of_angles):
    u = np.linspace(0, 1, 20_000)
    path = np.column_stack([2000 * u, u, np.sin(3 * u)])
    live = of_angles.stream()
    live.update(u, path)
    before = live._path.kept()[:, 1:].copy()
    asked = []
    live._recognize = asked.append
    live.finish()
    np.testing.assert_array_equal(of_angles.comparison_.checked(asked).positions, before)


FOUR = tuple(Channel(f"joint{k}", "angle", (f"joint{k}",), period=2 * np.pi) for k in range(1, 5))


def resting(seed, n, wrapped):
    """Four joints, two of which rest near half a turn; the level of the last one tells the class."""
    random, u = np.random.default_rng(seed), np.linspace(0, 1, 40)[:, None]
    paths = []
    for i in range(n):
        places = np.array([np.pi, -np.pi, 1.0, 0.5 + 0.8 * (i % 2)]) + 0.05 * random.normal(size=4)
        path = places + np.sin(3 * u) * [0.5, -0.4, 0.6, 0.3] + 0.1 * np.sin(6 * u) * random.normal(size=4)
        paths.append((path + np.pi) % (2 * np.pi) - np.pi if wrapped else path)
    return of_joints(paths, ["ab"[i % 2] for i in range(n)], FOUR)


def test_joints_near_half_a_turn_are_recognized_as_in_one_turn():
    """Each recording is unwrapped from its own start: their values lie a whole turn apart, or do not."""
    (shown, asked), there = ([resting(seed, 8, wrapped) for seed in (0, 1)] for wrapped in (True, False))
    assert np.ptp(shown.positions[shown.offsets[:-1], 0]) > 6
    for translation in (True, False):
        here, expected = (Recognizer(translation=translation).fit(demos) for demos in (shown, there[0]))
        np.testing.assert_allclose(here.decision_function(asked), expected.decision_function(there[1]), atol=1e-4)
    everywhere = np.array([[-2.5], [0.0], [2.5]])
    assert np.isinf(mean_turn(everywhere, np.array([2 * np.pi]))[1])
    values = [squares_beside_kernels(describe(demos))[1][1] for demos in (shown, there[0])]
    np.testing.assert_allclose(*values, atol=1e-9)
