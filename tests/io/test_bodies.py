"""Bodies and robots over time in NPZ: AMASS and others of SMPL's family, retargeted movements, points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import kineme

N = 60
RANDOM = np.random.default_rng(7)


def walk(width, n=N):
    return np.cumsum(RANDOM.normal(size=(n, width)), axis=0) * 0.05


@pytest.fixture
def save(tmp_path):
    def saved(**arrays):
        np.savez(tmp_path / "a.npz", **arrays)
        return tmp_path / "a.npz"

    return saved


def as_of_amass(poses, **others):
    """The entries of AMASS, one of them objects, as its files of SMPL-X have them."""
    return {
        "gender": "female", "betas": RANDOM.normal(size=16), "dmpls": walk(8), "trans": walk(3), "poses": poses,
        "markers_latent_vids": np.array([None, {}], dtype=object), **others,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("n_joints", "model", "rate"),
    [(24, "SMPL", 30), (52, "SMPL-H", 120), (55, "SMPL-X", 59.94), (22, "the joi", 25)],
)
def test_poses_are_one_recording_at_the_rate_of_the_file(save, n_joints, model, rate):
    name = "mocap_framerate" if n_joints == 52 else "mocap_frame_rate"
    arrays = as_of_amass(walk(3 * n_joints), **{name: np.array(float(rate))})
    read = kineme.read_recordings(save(**arrays))
    demos = read.demonstrations
    assert (len(read), demos.n_dims) == (1, 3 + 3 * n_joints)
    np.testing.assert_allclose(demos.times, np.arange(N) / rate)
    how = read.detected[0][0]
    assert how.layout.startswith(model)
    assert f"{rate} Hz by {name}" in how.layout
    assert {"betas", "dmpls", "gender"} <= set(how.ignored)
    np.testing.assert_array_equal(demos.recorded[:, :3], arrays["trans"])
    joints = [channel.name for channel in demos.channels[3:]]
    if n_joints == 55:  # after smplx, the hands of SMPL-X behind the face
        assert [joints.index(name) for name in ("jaw", "right_eye", "left_index1", "right_thumb3")] == [22, 24, 25, 54]
    if n_joints == 52:  # after AMASS
        assert [joints.index(name) for name in ("left_index1", "left_pinky1", "right_index1")] == [22, 28, 37]


def test_rotation_vectors_are_those_of_their_joints_beyond_a_half_turn_too(save):
    poses = walk(156)
    poses[:, 60:63] = np.linspace(0, 9, N)[:, None] * [0.6, 0.0, 0.8]  # the 20th joint is the left wrist
    read = kineme.read_recordings(save(**as_of_amass(poses, mocap_framerate=120.0)), columns="left_wrist")
    (channel,) = read.demonstrations.channels
    assert (channel.name, channel.kind, channel.order) == ("left_wrist", "orientation", "wxyz")
    expected = Rotation.from_rotvec(poses[:, 60:63]).as_matrix()
    got = Rotation.from_quat(read.demonstrations.recorded, scalar_first=True).as_matrix()
    np.testing.assert_allclose(got, expected, atol=1e-12)
    np.testing.assert_allclose(np.ptp(read.demonstrations.positions, axis=0), [5.4, 0, 7.2], atol=1e-9)


def test_parts_of_a_pose_are_joined_in_the_order_of_the_joints(save):
    root, body, hand = walk(3), walk(63), walk(45)
    read = kineme.read_recordings(save(global_orient=root, body_pose=body, left_hand_pose=hand, transl=walk(3), fps=30))
    names = [channel.name for channel in read.demonstrations.channels]
    assert names[3:6] == ["pelvis", "left_hip", "right_hip"]
    assert (names[24], names[25], len(names)) == ("right_wrist", "left_index1", 3 + 22 + 15)


def test_a_pose_without_a_rate_needs_the_step_and_a_given_step_wins(save):
    path = save(poses=walk(72), betas=np.zeros(10), trans=walk(3))
    with pytest.raises(
        kineme.errors.DataError, match=r"expected the rate of poses beside it, .* say the seconds between two"
    ):
        kineme.read_recordings(path)
    assert kineme.read_recordings(path, units=0.5).demonstrations.durations == pytest.approx([(N - 1) * 0.5])
    path = save(poses=walk(72), fps=30)
    assert kineme.read_recordings(path, units=0.5).demonstrations.durations == pytest.approx([(N - 1) * 0.5])
    assert kineme.read_recordings(path, units="ms").demonstrations.durations == pytest.approx([(N - 1) / 30])


def test_joints_of_a_robot_have_their_names_and_velocities_are_left_aside(save):
    arrays = {"dof_positions": walk(3), "dof_velocities": walk(3), "dof_names": ["hip", "knee", "ankle"]}
    read = kineme.read_recordings(save(fps=np.array([50]), body_rotations=RANDOM.normal(size=(N, 9, 4)), **arrays))
    assert read.demonstrations.dimensions == ("hip", "knee", "ankle")
    assert read.demonstrations.durations == pytest.approx([(N - 1) / 50])
    assert set(read.detected[0][0].ignored) == {"dof_velocities", "dof_names", "body_rotations"}
    read = kineme.read_recordings(save(fps=50, **arrays), columns=["knee", "dof_velocities"])
    assert read.demonstrations.n_dims == 4


def test_positions_of_mujoco_begin_with_the_pose_of_a_free_root_and_split_points_cut(save):
    turn = Rotation.from_rotvec(walk(3)).as_quat(scalar_first=True)
    qpos = np.hstack((walk(3), turn, walk(2)))
    path = save(qpos=qpos, qvel=walk(8), frequency=100.0, joint_names=["base", "hip", "knee"], split_points=[0, 20, N])
    read = kineme.read_recordings(path)
    assert read.demonstrations.lengths.tolist() == [20, N - 20]
    kinds = {channel.name: channel.kind for channel in read.demonstrations.channels}
    assert kinds["base.orientation"] == "orientation"
    assert [*kinds][-2:] == ["hip", "knee"]
    np.testing.assert_array_equal(read.demonstrations.recorded[:, 7:], qpos[:, 7:])
    heads = read.detected[0][0].columns
    assert heads[:7] == tuple(f"base.position.{k}" for k in "xyz") + tuple(f"base.orientation.{k}" for k in "wxyz")
    np.testing.assert_allclose(np.abs((read.demonstrations.recorded[:, 3:7] * turn).sum(axis=1)), 1.0)
    arm = np.hstack((walk(3), 0.95 * turn, walk(2)))  # nine joints, by chance nearly a quaternion among them
    assert kineme.read_recordings(save(qpos=arm, fps=50)).demonstrations.dimensions[:2] == ("qpos.0", "qpos.1")
    for cuts in ([1, 20, N], [0, 20, N - 1], [0, 30, 20, N]):
        with pytest.raises(kineme.errors.DataError, match="expected split_points that rise from 0 to 60"):
            kineme.read_recordings(save(qpos=qpos, frequency=100.0, split_points=cuts))


def test_a_quaternion_of_a_root_that_does_not_say_its_order_is_not_guessed(save):
    turn = Rotation.from_rotvec(walk(3)).as_quat()
    path = save(fps=30, root_pos=walk(3), root_rot=turn, dof_pos=walk(2))
    with pytest.raises(kineme.errors.SpecificationError, match="its scalar w, got numbers; say kinds="):
        kineme.read_recordings(path)
    read = kineme.read_recordings(path, kinds={"root_rot": "xyzw"})
    got = Rotation.from_quat(read.demonstrations.recorded[:, 3:7]).as_matrix()
    np.testing.assert_allclose(got, Rotation.from_quat(turn).as_matrix(), atol=1e-12)


def test_points_over_time_are_one_movement_where_a_rate_or_times_say_so(save):
    points = walk(12).reshape(N, 4, 3)
    names = ["nose", "neck", "left", "right"]
    read = kineme.read_recordings(save(keypoints=points, keypoint_names=names, fps=25), columns=["neck"])
    np.testing.assert_array_equal(read.demonstrations.positions, points[:, 1])
    assert kineme.read_recordings(save(joints=points, timestamp=np.arange(N) / 25)).demonstrations.n_dims == 12


def test_a_rate_beside_arrays_of_any_name_is_their_clock_and_what_is_static_is_left_aside(save):
    read = kineme.read_recordings(save(tool=walk(3), force=walk(1)[:, 0], shape=np.zeros(5), dt=0.02))
    assert read.demonstrations.dimensions == ("tool.0", "tool.1", "tool.2", "force")
    assert read.demonstrations.durations == pytest.approx([(N - 1) * 0.02])
    assert "shape" in read.detected[0][0].ignored
    assert kineme.read_recordings(save(positions=walk(2), fps=20)).demonstrations.durations == pytest.approx([59 / 20])
    many = kineme.read_recordings(save(positions=np.moveaxis(walk(40).reshape(N, 4, 10), 1, 0), fps=20)).demonstrations
    np.testing.assert_allclose(many.durations, 59 / 20)
