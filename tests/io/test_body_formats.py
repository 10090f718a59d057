"""Bodies as OpenSim, Xsens MVN and C3D with rotations store them: by their public formats, C3D by ezc3d."""

import numpy as np
import pytest

from kineme.errors import DataError
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

N = 24
T = np.arange(N) / 60


def read(content, name, **options):
    data = content if isinstance(content, bytes) else content.encode()
    return read_recordings_from_bytes(data, name, Layout(**options))


def motion(in_degrees="yes", title="Coordinates", heads=("pelvis_tilt", "pelvis_tx", "knee_angle_r"), separator="\t"):
    """After OpenSim, "Motion (.mot) Files", version 1."""
    lines = [title, "version=1", f"nRows={N}", f"nColumns={len(heads) + 1}", f"inDegrees={in_degrees}", ""]
    lines += ["Units are S.I. units (second, meters, Newtons, ...)", "", "endheader", separator.join(("time", *heads))]
    columns = [T, *(np.sin(T + k) for k in range(len(heads)))]
    return "\n".join([*lines, *(separator.join(f"{x:.8f}" for x in row) for row in zip(*columns, strict=True)), ""])


def quaternions():
    return np.column_stack([np.cos(T), np.sin(T), 0 * T, 0 * T])


def storage(kind="Quaternion"):
    """After OpenSim, "Storage (.sto) Files", as OpenSense reads them."""
    lines = ["DataRate=60.000000", f"DataType={kind}", "version=3", "OpenSimVersion=4.4", "endheader"]
    lines.append("time\tpelvis_imu\ttibia_r_imu")
    width = {"Quaternion": 4, "Vec3": 3}[kind]
    for t, q in zip(T, quaternions()[:, :width], strict=True):
        cell = ",".join(f"{x:.17g}" for x in q)
        lines.append(f"{t:.6f}\t{cell}\t{cell}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("separator", ["\t", "  "])
@pytest.mark.parametrize(("in_degrees", "unit"), [("yes", "deg"), ("no", "rad")])
def test_coordinates_of_opensim_have_the_units_that_the_head_says(in_degrees, unit, separator):
    recordings = read(motion(in_degrees, separator=separator), "walk.mot")
    assert recordings.detected[0][0].format == "OpenSim CSV"
    assert recordings.detected[0][0].measured_in == (unit, "m", unit)
    assert [channel.kind for channel in recordings.demonstrations.channels] == ["angle", "position", "angle"]
    np.testing.assert_allclose(recordings.demonstrations.times, T, atol=1e-7)
    np.testing.assert_allclose(recordings.demonstrations.recorded[:, 2], np.sin(T + 2), atol=1e-7)


def test_forces_and_controls_of_opensim_have_no_unit_of_angles():
    forces = read(motion(heads=("ground_force_vx", "ground_force_px", "ground_torque_x")), "grf.mot")
    assert {*forces.detected[0][0].measured_in} == {""}
    controls = read(motion("no", "controls", ("soleus_r", "gasmed_r")), "a.sto")
    assert {*controls.detected[0][0].measured_in} == {""}
    for in_degrees, title, unit in (("no", "results", ""), ("yes", "results", "deg"), ("yes", "model speeds", "")):
        some = read(motion(in_degrees, title, ("hip_flexion_r", "knee_angle_r")), "a.sto").detected[0][0]
        assert {*some.measured_in} == {unit}


def test_a_motion_file_of_simm_and_states_with_speeds():
    lines = ["name walk.mot", "datacolumns 3", f"datarows {N}", "otherdata 1", "range 0 0.4", "endheader"]
    rows = "\n".join(f"{t} {np.sin(t)} {np.cos(t)}" for t in T)
    recordings = read("\n".join([*lines, "time\thip\tknee", rows]), "walk.mot")
    assert recordings.demonstrations.dimensions == ("hip", "knee")
    hip = "/jointset/hip_r/hip_flexion_r"
    states = read(motion("no", "states", (f"{hip}/value", f"{hip}/speed")), "states.sto")
    assert states.detected[0][0].columns == (f"{hip}/value",)
    assert states.detected[0][0].measured_in == ("rad",)


def test_cells_of_opensense_are_quaternions():
    recordings = read(storage(), "imu.sto")
    assert [(channel.name, channel.kind, channel.order) for channel in recordings.demonstrations.channels] == [
        ("pelvis_imu", "orientation", "wxyz"),
        ("tibia_r_imu", "orientation", "wxyz"),
    ]
    np.testing.assert_allclose(recordings.demonstrations.recorded[:, 4:], quaternions(), atol=1e-12)
    points = read(storage("Vec3"), "points.sto")
    assert points.detected[0][0].columns[3:] == ("tibia_r_imu.x", "tibia_r_imu.y", "tibia_r_imu.z")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (motion().replace("endheader", ""), "expected 'endheader'"),
        (motion().partition("time\t")[0], "expected names and samples below 'endheader'"),
        (motion().replace("time\t", "frame\t"), r"expected 'time' as first column of an OpenSim file, got \['frame'\]"),
    ],
)
def test_a_damaged_file_of_opensim_says_so(content, words):
    with pytest.raises(DataError, match=words):
        read(content, "walk.mot")


def mvnx(times=None, doctype="", lost=None):
    """After Xsens, "MVN User Manual", version 4 of the format."""
    head = f'<?xml version="1.0" encoding="UTF-8"?>{doctype}<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">'
    head += '<mvn version="2021.2"/><subject label="Ann" frameRate="60" segmentCount="2"><segments>'
    head += '<segment label="Pelvis" id="1"><points><point label="pHipOrigin"/></points></segment>'
    head += '<segment label="L5" id="2"/>'
    head += '</segments><joints><joint label="jL5S1"><connector1>Pelvis/jL5S1</connector1></joint></joints><frames>'
    pose = (
        '<frame time="" type="tpose"><orientation>1 0 0 0 1 0 0 0</orientation><position>0 0 0 0 0 0</position></frame>'
    )
    rows = []
    for k, (t, q) in enumerate(zip(T, quaternions(), strict=True)):
        time = round(1000 * t) if times is None else times[k]
        both = " ".join(f"{x:.9f}" for x in (*q, *q))
        where = "" if k == lost else f"<position>{t} {t * t} 1 {t} 2 {k}</position>"
        angle = f"<jointAngle>{k} {2 * k} 0</jointAngle>"
        rows.append(
            f'<frame time="{time}" index="{k}" type="normal"><orientation>{both}</orientation>{where}{angle}</frame>'
        )
    return head + pose + "".join(rows) + "</frames></subject></mvnx>"


def test_segments_of_mvnx_are_poses_and_joints_can_be_chosen():
    recordings = read(mvnx(), "walk.mvnx")
    how = recordings.detected[0][0]
    assert how.format == "Xsens MVNX"
    assert how.columns[:4] == ("Pelvis.position.x", "Pelvis.position.y", "Pelvis.position.z", "L5.position.x")
    assert {*how.measured_in} == {"m", ""}
    np.testing.assert_allclose(recordings.demonstrations.times, T, atol=1e-12)
    assert [channel.kind for channel in recordings.demonstrations.channels] == ["position"] * 6 + ["orientation"] * 2
    assert how.columns[6:10] == tuple(f"Pelvis.orientation.{part}" for part in "wxyz")
    np.testing.assert_allclose(recordings.demonstrations.recorded[:, 6:10], quaternions(), atol=1e-8)
    assert "jL5S1.angle.x" in how.ignored
    joints = read(mvnx(), "walk.mvnx", columns="j*")
    assert joints.detected[0][0].measured_in == ("deg", "deg", "deg")
    np.testing.assert_allclose(joints.demonstrations.recorded[:, 1], 2 * np.arange(N))


def test_frames_of_mvnx_without_a_quantity_are_gaps_and_stamps_that_stand_still_follow_from_the_rate():
    recordings = read(mvnx(lost=5), "walk.mvnx")
    assert recordings.sources[0].filled == 1
    np.testing.assert_allclose(read(mvnx(times=[0] * N), "walk.mvnx").demonstrations.times, T)
    late = [round(1000 * t) + 5 * (k == N - 1) for k, t in enumerate(T)]  # by more than a millisecond
    np.testing.assert_allclose(read(mvnx(times=late), "walk.mvnx").demonstrations.times, np.array(late) / 1e3)
    uneven = [100 * k + (k % 3) for k in range(N)]
    np.testing.assert_allclose(read(mvnx(times=uneven), "walk.mvnx").demonstrations.times, np.array(uneven) / 1e3)


def test_each_subject_of_mvnx_is_a_movement():
    one, end = mvnx().removesuffix("</mvnx>"), "</mvnx>"
    other = one[one.index("<subject") :].replace('"Ann"', '"Bo"').replace("<position>0.0 0.0 1", "<position>9 0.0 1")
    recordings = read(one + other + end, "walk.mvnx")
    assert [source.place for source in recordings.sources] == ["Ann", "Bo"]
    ann, bo = recordings.demonstrations
    np.testing.assert_array_equal(ann.times, bo.times)
    assert (ann.positions[0, 0], bo.positions[0, 0]) == (0, 9)
    with pytest.raises(DataError, match="got others of 'Bo' than of 'Ann'; export each to a file of its own"):
        read(one + other.replace("L5", "L3") + end, "walk.mvnx")


BOMB = '<!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (mvnx(doctype=BOMB), "without a document type"),
        ("<a>" * 100, "at most 32 elements within each other"),
        (mvnx()[:900], "truncated or damaged"),
        ("<mvnx/>", "expected frames of type 'normal'"),
        (
            mvnx().replace("<position>0.0 0.0 1 0.0 2 0<", "<position>0.0 0.0 1<"),
            "expected 6 numbers in 'position', got 3",
        ),
        (mvnx().replace('type="normal"', 'type="tpose"'), "expected frames of type 'normal'"),
    ],
)
def test_a_damaged_or_hostile_mvnx_file_says_so(content, words):
    with pytest.raises(DataError, match=words):
        read(content, "walk.mvnx")


@pytest.fixture(scope="module")
def rotations(tmp_path_factory):
    """A file by ezc3d with the poses of two segments, then without its point, as programs without markers write it."""
    pytest.importorskip("c3d", reason="the package c3d reads C3D")
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d writes the file")
    from scipy.spatial.transform import Rotation

    content = ezc3d.c3d()
    poses = np.zeros((4, 4, 2, N))
    for j in range(2):
        poses[:3, :3, j] = Rotation.from_rotvec((j + 1) * T[:, None] * [1, 0, 0]).as_matrix().transpose(1, 2, 0)
        poses[:3, 3, j] = [100 * T, T + j, 0 * T]
    poses[3, 3] = 1
    content["parameters"]["POINT"]["RATE"]["value"] = [60]
    content["parameters"]["POINT"]["UNITS"]["value"] = ("mm",)
    content["parameters"]["POINT"]["LABELS"]["value"] = ("A",)
    content["data"]["points"] = np.ones((4, 1, N))
    content["data"]["rotations"] = poses
    for name, value in (("LABELS", ("pelvis_4X4", "thigh_4X4")), ("USED", [2]), ("RATIO", [1]), ("RATE", [60.0])):
        content.add_parameter("ROTATION", name, value)
    path = tmp_path_factory.mktemp("rotations") / "a.c3d"
    content.write(str(path))
    np.testing.assert_allclose(ezc3d.c3d(str(path))["data"]["rotations"], poses, atol=1e-5)
    with_point = path.read_bytes()
    data = bytearray(with_point)
    data[2:4] = b"\0\0"  # of the points in the header
    used = data.index(b"USED", 512)
    assert data[used + 4 : used + 10] == b"\x07\0\x02\0\x01\0"
    data[used + 8] = 0
    return bytes(data), poses, with_point


def test_c3d_with_rotations_alone_is_poses_of_segments(rotations):
    data, poses, _ = rotations
    recordings = read(data, "a.c3d")
    assert [channel.name for channel in recordings.demonstrations.channels if channel.kind == "orientation"] == [
        "pelvis.orientation",
        "thigh.orientation",
    ]
    assert recordings.detected[0][0].columns[:3] == ("pelvis.position.x", "pelvis.position.y", "pelvis.position.z")
    assert recordings.detected[0][0].measured_in[:4] == ("mm", "mm", "mm", "")
    np.testing.assert_allclose(recordings.demonstrations.times, T)
    recorded = recordings.demonstrations.recorded
    np.testing.assert_allclose(recorded[:, :3], poses[:3, 3, 0].T, atol=1e-4)
    np.testing.assert_allclose(recorded[:, 10:], np.column_stack([np.cos(T), np.sin(T), 0 * T, 0 * T]), atol=1e-6)


def test_unknown_rotations_of_c3d_are_gaps_and_a_truncated_file_says_so(rotations):
    data, poses, _ = rotations
    start = data.index(np.asarray(poses[:, :, 0, 5].T, np.float32).tobytes())
    lost = data[: start + 64] + np.float32(-1).tobytes() + data[start + 68 :]
    assert read(lost, "a.c3d").sources[0].filled == 1
    with pytest.raises(DataError, match="expected 24 samples of 2 rotations in a C3D file, got fewer"):
        read(data[:-600], "a.c3d")


def test_rotations_beside_points_of_c3d_are_left_aside_unless_they_are_chosen(rotations):
    _, poses, data = rotations
    recordings = read(data, "a.c3d")
    assert recordings.detected[0][0].columns == ("A.x", "A.y", "A.z")
    assert "pelvis.orientation.w" in recordings.detected[0][0].ignored
    both = read(data, "a.c3d", columns=["A", "thigh"])
    assert [channel.name for channel in both.demonstrations.channels if channel.kind == "orientation"] == [
        "thigh.orientation"
    ]
    np.testing.assert_allclose(both.demonstrations.recorded[:, 3:6], poses[:3, 3, 1].T, atol=1e-4)


def test_more_than_255_points_of_c3d_have_their_names(tmp_path):
    pytest.importorskip("c3d", reason="the package c3d reads C3D")
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d writes the file")
    content, names = ezc3d.c3d(), tuple(f"M{k:03d}" for k in range(300))
    content["parameters"]["POINT"]["RATE"]["value"] = [60]
    content["parameters"]["POINT"]["LABELS"]["value"] = names
    content["data"]["points"] = np.ones((4, 300, N))
    content["data"]["points"][0] = np.arange(300)[:, None] + T
    content.write(str(tmp_path / "a.c3d"))
    (movement,) = read((tmp_path / "a.c3d").read_bytes(), "a.c3d", columns=["M299", "M254"]).demonstrations
    np.testing.assert_allclose(movement.recorded[:, [0, 3]], np.column_stack([299 + T, 254 + T]), atol=1e-4)


def test_what_a_model_computed_in_c3d_is_no_place(tmp_path):
    """As Vicon's Plug-in Gait writes angles and moments of joints among the points."""
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d writes the file")
    content, names = ezc3d.c3d(), ["A:HAND", "A:LKneeAngles", "A:LKneeMoment"]
    for name, value in (("RATE", [100.0]), ("LABELS", names), ("UNITS", ["mm"])):
        content["parameters"]["POINT"][name]["value"] = value
    for kind, unit, label in (("ANGLE", "deg", names[1]), ("MOMENT", "Nmm", names[2])):
        content.add_parameter("POINT", f"{kind}S", [label])
        content.add_parameter("POINT", f"{kind}_UNITS", [unit])
    content["data"]["points"] = np.ones((4, 3, 20)) + np.arange(60.0).reshape(3, 20)
    content.write(str(tmp_path / "a.c3d"))
    places = read((tmp_path / "a.c3d").read_bytes(), "a.c3d")
    assert places.demonstrations.dimensions == ("HAND.x", "HAND.y", "HAND.z")
    assert len(places.detected[0][0].ignored) == 6
    chosen = ["LKneeAngles.x", "LKneeMoment.y"]
    angle = read((tmp_path / "a.c3d").read_bytes(), "a.c3d", columns=chosen).demonstrations
    assert [channel.unit for channel in angle.channels] == ["deg", "Nmm"]
    np.testing.assert_array_equal(angle[0].recorded[:, 0], 21 + np.arange(20.0))
