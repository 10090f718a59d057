"""Text exports of motion capture systems, in the layouts that their makers document; BVH; C3D written by ezc3d."""

import re

import numpy as np
import pytest

from kineme.errors import DataError
from kineme.io.inspection.inspect import as_words, inspect
from kineme.io.reading.recordings import read_recordings
from kineme.movements.channels.channel import recorded_names
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

N = 12


def read(content, name="a.csv", **options):
    data = content if isinstance(content, bytes) else content.encode()
    return read_recordings_from_bytes(data, name, Layout(**options))


def vicon(first=101, gap=None):
    """After Vicon, "Nexus User Guide", Export ASCII: two sections, of which the second one holds the markers."""
    lines = ["Devices", "1000", ",,Plate - Force,,", "Frame,Sub Frame,Fx,Fy,Fz", ",,N,N,N"]
    lines += [f"{first + k // 10},{k % 10},1,2,{k}" for k in range(20)]
    lines += ["", "Trajectories", "100", ",,Ann:LASI,,,Ann:RASI,,"]
    lines += ["Frame,Sub Frame,X,Y,Z,X,Y,Z", ",,mm,mm,mm,mm,mm,mm"]
    lines += [f"{first + k},0,{k},{k * k},3,{'' if k == gap else k / 2},5,6" for k in range(N)]
    return "\r\n".join([*lines, "", ""])


def motive(rigid=True, more=""):
    """After OptiTrack, "Data Export: CSV", version 1.23 of the format."""
    head = "Format Version,1.23,Take Name,Pour,Take Notes,,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
    head += f"Rotation Type,Quaternion{more},Length Units,Meters,Coordinate Space,Global"
    turned = ["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"] if rigid else []
    kinds = ["Rigid Body"] * len(turned) + (["Rigid Body Marker"] * 4 if rigid else []) + ["Marker"] * 3
    names = ["Cup"] * len(turned) + (['"Cup:Marker1"'] * 4 if rigid else []) + ["Cup:Marker1"] * 3
    contents = turned + (["Position"] * 3 + ["Marker Quality"] if rigid else []) + ["Position"] * 3
    axes = [*"XYZWXYZ", "", *"XYZ", ""] * rigid + [*"XYZ"]
    rows = [head, ""] + [",," + ",".join(row) for row in (kinds, names, names, contents)]
    rows.append("Frame,Time (Seconds)," + ",".join(axes))
    for k in range(N):
        pose = [0, 0, 0, 1, 0.1 * k, 0.2, 0.01 * k * k, 0.0004, 1, 2, 3, 1] if rigid else []
        rows.append(",".join(map(str, [k, f"{k / 120:.6f}", *pose, k, 2, 3])))
    return "\n".join(rows) + "\n"


def qualisys(headed=False, lost=(), rate="200"):
    """After Qualisys, "Motion data (.tsv)"."""
    lines = [
        f"NO_OF_FRAMES\t{N}", "NO_OF_CAMERAS\t8", "NO_OF_MARKERS\t2", f"FREQUENCY\t{rate}", "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--", "TIME_STAMP\t2022-06-02, 15:49:44.620\t25975.44751328",
        "DATA_INCLUDED\t3D", "EVENT\tStart\t1\t0.00000", "MARKER_NAMES\tHead\tWrist",
        "TRAJECTORY_TYPES\tMeasured\tMeasured",
    ]  # fmt: skip
    if headed:
        lines.append("Frame\tTime\tHead X\tHead Y\tHead Z\tWrist X\tWrist Y\tWrist Z")
    for k in range(N):
        wrist = ["0.000"] * 3 if k in lost else [f"{k * k:.3f}", "0.000", "7.125"]
        before = [str(k + 1), f"{k / 200:.5f}"] if headed else []
        lines.append("\t".join([*before, f"{k:.3f}", "2.000", "3.000", *wrist]))
    return "\r\n".join(lines) + "\r\n"


def qualisys_bodies():
    """After Qualisys, "6DOF data (.tsv)"."""
    columns = ["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{k}]" for k in range(9))]
    lines = [f"NO_OF_FRAMES\t{N}", "NO_OF_BODIES\t1", "FREQUENCY\t100", "DATA_INCLUDED\t6D", "BODY_NAMES\tCup"]
    lines.append("\t".join(["Frame", "Time", "Cup X", *columns[1:]]))
    lines += ["\t".join(map(str, [k + 1, k / 100, k, 2, 3, k / 10, 0, 0, 0.1, *[1] * 9])) for k in range(N)]
    return "\n".join(lines)


def trc(rate="100.00"):
    """After OpenSim, "Marker (.trc) Files"."""
    lines = ["PathFileType\t4\t(X/Y/Z)\twalk.trc"]
    lines += ["DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames"]
    lines += [f"{rate}\t100.00\t{N}\t2\tmm\t100.00\t1\t{N}", "Frame#\tTime\tLASI\t\t\tRASI\t\t\t"]
    lines += ["\t\tX1\tY1\tZ1\tX2\tY2\tZ2\t", ""]
    lines += [f"{k + 1}\t{k / 100:.5f}\t{k}\t{k * k}\t3\t4\t{k / 2}\t6\t" for k in range(N)]
    return "\r\n".join(lines)


BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Lower Spine
  {
    OFFSET 0 10 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 10 0
    }
  }
}
MOTION
Frames: 12
Frame Time: 0.0333333
""" + "".join(" ".join(str(k * j) for j in range(9)) + "\n" for k in range(N))


def test_vicon_markers_have_names_units_and_times_from_the_rate():
    recordings = read(vicon())
    demos, how = recordings.demonstrations, recordings.detected[0][0]
    assert demos.dimensions == ("LASI.x", "LASI.y", "LASI.z", "RASI.x", "RASI.y", "RASI.z")
    np.testing.assert_allclose(demos.times, np.arange(N) / 100, atol=1e-12)
    np.testing.assert_array_equal(demos.positions[:, 1], np.arange(N) ** 2)
    assert how.format == "Vicon CSV"
    assert set(how.measured_in) == {"mm"}
    assert how.ignored == ("frame", "sub frame")
    assert "RASI.z in mm" in as_words(inspect(recordings))
    assert read(vicon(), columns="RASI").demonstrations.dimensions == ("RASI.x", "RASI.y", "RASI.z")


def test_a_gap_names_its_line_and_marker_and_costs_its_sample_alone_if_asked():
    with pytest.raises(DataError, match=r"line 35: expected a number in 'RASI.x', got nothing"):
        read(vicon(gap=3), fill_gaps=0)
    recordings = read(vicon(gap=3), skip="sample", fill_gaps=0)
    assert recordings.demonstrations.lengths.tolist() == [N - 1]
    assert recordings.problems[0].line == 35
    np.testing.assert_allclose(recordings.demonstrations.times[2:4], [0.02, 0.04])
    assert len(read(vicon(gap=3), columns="LASI").demonstrations.positions) == N


def test_frames_that_are_missing_leave_a_gap_in_time():
    lines = vicon().splitlines()
    del lines[35]
    steps = np.diff(read("\n".join(lines)).demonstrations.times)
    assert steps.max() == pytest.approx(0.02)
    assert steps.min() == pytest.approx(0.01)


def test_vicon_poses_are_named_as_poses():
    rows = ["Objects", "100", ",,Global Angle (Quaternion) Cup:Cup", "Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ"]
    rows += [",,,,,,mm,mm,mm", *(f"{k},0,0,0,0,1,{k},2,{k * k}" for k in range(N))]
    recordings = read("\n".join(rows))
    names = [f"Cup.orientation.{axis}" for axis in "xyzw"] + [f"Cup.position.{axis}" for axis in "xyz"]
    assert list(recorded_names(recordings.demonstrations.channels)) == names
    assert recordings.detected[0][0].measured_in == ("", "", "", "", "mm", "mm", "mm")


def test_devices_count_sub_frames_by_their_own_rate():
    recordings = read(vicon().partition("Trajectories")[0])
    np.testing.assert_allclose(np.diff(recordings.demonstrations.times), 0.001)


def test_motive_rigid_bodies_are_poses_and_what_follows_from_them_is_left_aside():
    recordings = read(motive())
    names = [f"Cup.orientation.{axis}" for axis in "xyzw"] + [f"Cup.position.{axis}" for axis in "xyz"]
    assert list(recorded_names(recordings.demonstrations.channels)) == [
        *names,
        *(f"Marker1.position.{axis}" for axis in "xyz"),
    ]
    assert recordings.detected[0][0].format == "OptiTrack CSV"
    assert recordings.detected[0][0].measured_in == ("", "", "", "", *["m"] * 6)
    np.testing.assert_allclose(recordings.demonstrations.times, np.arange(N) / 120, atol=1e-6)
    markers = read(motive(rigid=False)).demonstrations
    assert markers.dimensions == ("Marker1.x", "Marker1.y", "Marker1.z")


def test_motive_without_a_column_of_times_keeps_its_first_coordinate():
    timed = motive(rigid=False)
    bare = "\n".join(re.sub(r"^(Frame|\d*),[^,]*,(?!1.23)", r"\1,", line) for line in timed.splitlines())
    assert "\nFrame,X,Y,Z\n" in bare
    np.testing.assert_allclose(read(bare).demonstrations.recorded, read(timed).demonstrations.recorded)


@pytest.mark.parametrize(("order", "name"), [("XYZ", "rotation"), ("ZYX", "rotation_zyx"), ("Euler", "rotation")])
def test_motive_angles_in_an_order_of_their_own_are_named_by_it(order, name):
    text = motive().replace("Type,Quaternion", f"Type,{order}").replace("X,Y,Z,W,X,Y,Z", "X,Y,Z,,X,Y,Z")
    channels = read(text).demonstrations.channels
    assert recorded_names(channels)[:3] == tuple(f"Cup.{name}.{axis}" for axis in "xyz")
    assert [(channel.kind, channel.unit) for channel in channels][:3] == [("angle", "deg")] * 3


def test_qualisys_times_come_from_the_frequency_or_from_their_column():
    for headed in (False, True):
        recordings = read(qualisys(headed), "a.tsv")
        assert recordings.demonstrations.dimensions == ("Head.x", "Head.y", "Head.z", "Wrist.x", "Wrist.y", "Wrist.z")
        np.testing.assert_allclose(recordings.demonstrations.times, np.arange(N) / 200, atol=1e-9)
        assert set(recordings.detected[0][0].measured_in) == {"mm"}


def test_zeros_in_place_of_a_lost_marker_are_a_gap():
    recordings = read(qualisys(lost=(3, 4)), "a.tsv", skip="sample", fill_gaps=0)
    assert recordings.demonstrations.lengths.tolist() == [N - 2]
    assert "'Wrist', got nothing" in recordings.problems[0].reason
    everywhere = read(qualisys(lost=range(N)), "a.tsv")  # a marker that was never found is left aside
    assert everywhere.demonstrations.dimensions == ("Head.x", "Head.y", "Head.z")


@pytest.mark.parametrize("zeros", ["0\t0\t0", "0.000\t0.000\t0.000", "\t\t"])
def test_zeros_and_nothing_in_place_of_a_marker_of_trc_are_a_gap(zeros):
    complete, lost = trc(), trc()
    for k in (5, 6):
        lost = lost.replace(f"\t{k}\t{k * k}\t3\t", f"\t{zeros}\t")
    recordings = read(lost, "walk.trc")
    assert (recordings.sources[0].filled, recordings.problems) == (2, ())
    expected = read(complete, "walk.trc").demonstrations.positions
    np.testing.assert_allclose(recordings.demonstrations.positions, expected, atol=0.5)


@pytest.mark.parametrize("export", [vicon, motive])
def test_exports_that_a_european_program_for_tables_has_saved(export):
    text = re.sub(r"(?<=\d)\.(?=\d)", "@", export()).replace(",", ";").replace("@", ",")
    saved = text.replace("\r", "").strip().replace("\n\n", "\n;;;\n")
    np.testing.assert_array_equal(read(saved).demonstrations.recorded, read(export()).demonstrations.recorded)
    assert read(saved).detected[0][0] == read(export()).detected[0][0]


def test_the_first_two_rows_of_an_empatica_are_its_start_and_its_rate():
    rows = [(k, k * k, 5) for k in range(N)]
    for n, names in (3, ("x", "y", "z")), (1, ("x",)):
        text = "\n".join(", ".join([cell] * n) for cell in ("1700000000.000000", "32.000000"))
        text += "".join("\n" + ",".join(map(str, row[-n - (n == 1) :][:n])) for row in rows)
        recordings = read(text)
        assert (recordings.detected[0][0].format, recordings.detected[0][0].columns) == ("Empatica CSV", names)
        np.testing.assert_array_equal(
            recordings.demonstrations.recorded, [row[:n] if n > 1 else row[1:2] for row in rows]
        )
        np.testing.assert_array_equal(recordings.demonstrations.times, 1.7e9 + np.arange(N) / 32)
        np.testing.assert_allclose(np.diff(read(text, units=0.5).demonstrations.times), 0.5)


def test_qualisys_bodies_are_positions_and_angles():
    recordings = read(qualisys_bodies(), "a.tsv")
    names = ["Cup.position.x", "Cup.position.y", "Cup.position.z", "Cup.roll", "Cup.pitch", "Cup.yaw"]
    assert list(recorded_names(recordings.demonstrations.channels)) == names
    assert recordings.detected[0][0].measured_in == ("mm", "mm", "mm", "deg", "deg", "deg")


@pytest.mark.parametrize("separator", [",", ";"])
def test_trc_that_a_program_for_tables_has_saved(separator):
    """As pyomeca's example: commas, as many in every line, and a line of nothing but commas below the axes."""
    lines = [line.split("\t") for line in trc().splitlines() if line]
    widest = max(map(len, lines))
    saved = "\n".join(separator.join(line + [""] * (widest - len(line))) for line in lines)
    head, _, samples = saved.partition("\n1" + separator)
    for empty in ("", "\n" + separator * (widest - 1)):
        recordings = read(f"{head}{empty}\n1{separator}{samples}", "walk.trc")
        np.testing.assert_array_equal(
            recordings.demonstrations.recorded, read(trc(), "walk.trc").demonstrations.recorded
        )
        assert recordings.detected[0][0].columns == read(trc(), "walk.trc").detected[0][0].columns


def test_trc_markers_have_names_units_and_times():
    recordings = read(trc(), "walk.trc")
    assert recordings.demonstrations.dimensions == ("LASI.x", "LASI.y", "LASI.z", "RASI.x", "RASI.y", "RASI.z")
    assert set(recordings.detected[0][0].measured_in) == {"mm"}
    np.testing.assert_array_equal(recordings.demonstrations.times, np.arange(N) / 100)
    with pytest.raises(DataError, match="expected the heads 'Frame#', 'Time'"):
        read(trc().replace("Frame#", "Row"), "walk.trc")


def test_times_that_are_rounded_are_those_of_the_frames_at_the_rate():
    exact = np.arange(N) / 120
    assert np.abs(np.round(exact, 6) - exact).max() > 1e-8
    np.testing.assert_allclose(read(motive()).demonstrations.times, exact, atol=1e-12)
    other = read(motive().replace("Export Frame Rate,120.000000", "Export Frame Rate,60.000000"))
    np.testing.assert_allclose(other.demonstrations.times, np.round(exact, 6), atol=1e-12)  # the column wins


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (vicon().partition("Frame,Sub Frame,X")[0], "got its head alone"),
        ("Events\n100\n", "got events alone"),
        (motive().partition("Frame,Time")[0], "row of heads 'Frame, Time"),
        (motive().partition("0,0.000000")[0], "expected samples below the heads"),
        (qualisys().replace("MARKER_NAMES", "OTHERS"), "MARKER_NAMES or BODY_NAMES"),
        (qualisys(rate="EXT"), "a FREQUENCY in hertz"),
        (qualisys().replace("\tWrist\r", "\tWrist\tAnkle\r"), "expected 9 columns"),
    ],
)
def test_an_export_without_what_it_needs_says_so(content, words):
    with pytest.raises(DataError, match=words):
        read(content)


@pytest.mark.parametrize("units", ["ms,mm,deg", "[ms],[mm],[deg]", ",mm,deg"])
def test_a_row_of_units_below_the_heads_is_not_a_sample(units):
    rows = "".join(f"{10 * k},{k},{k * k}\n" for k in range(N))
    recordings = read(f"time,x,y\n{units}\n{rows}")
    how = recordings.detected[0][0]
    assert (how.measured_in, recordings.problems) == (("mm", "deg"), ())
    np.testing.assert_allclose(recordings.demonstrations.times, np.arange(N) / 100)
    assert how.units_from == ("head" if "ms" in units else "by its steps")


@pytest.mark.parametrize("unit", ["m/(s^2)", "no_units", "local_flux", "kOhms", "%MVC", "µV", "uT", "dps"])
def test_a_row_of_units_may_hold_some_that_nobody_knows(unit):
    rows = "".join(f"{10 * k},{k},{k * k}\n" for k in range(N))
    how = read(f"time,x,y\nms,{unit},{unit}\n{rows}").detected[0][0]
    assert (how.units, how.columns, how.measured_in) == ("ms", ("x", "y"), (unit, unit))


def test_names_and_gaps_below_the_heads_are_not_units():
    rows = "".join(f"w,{k / 10},{k},{k * k}\n" for k in range(N))
    cropped = read(f"label,time,x,y\nw,-1,,\n{rows}")
    assert (len(cropped.demonstrations.positions), cropped.sources[0].cropped) == (N, 1.0)
    assert "expected finite times, got nan" in read(f"label,time,x,y\nmm,,,\n{rows}").problems[0].reason


def test_bvh_channels_are_named_by_their_joints():
    recordings = read(BVH, "walk.bvh")
    assert recordings.demonstrations.dimensions[5:7] == ("Hips.Yrotation", "Lower Spine.Zrotation")
    assert recordings.detected[0][0].measured_in == ("", "", "", *["deg"] * 6)
    np.testing.assert_allclose(recordings.demonstrations.times, np.arange(N) * 0.0333333)
    assert read(BVH, "walk.bvh", columns="Lower Spine").demonstrations.n_dims == 3


def test_bvh_files_that_turn_about_their_axes_in_another_order_are_not_mixed(tmp_path):
    """The three angles of one turn are others in another order, though their names are the same."""
    for k, order in enumerate(("Xrotation Yrotation Zrotation", *["Zrotation Xrotation Yrotation"] * 2)):
        (tmp_path / f"{k}.bvh").write_text(BVH.replace("Zrotation Xrotation Yrotation", order))
    recordings = read_recordings(tmp_path)
    assert [source.path for source in recordings.sources] == ["1.bvh", "2.bvh"]
    (problem,) = recordings.problems
    assert (problem.file, "expected the rotations of 'hips' in the order zxy" in problem.reason) == ("0.bvh", True)
    names = [f"Hips.{axis}rotation" for axis in "XYZ"]
    with pytest.raises(DataError, match="in the order zxy, as the file has them, got xyz"):
        read_recordings(tmp_path / "1.bvh", columns=names)


@pytest.mark.parametrize("tail", ["\t", ""])
def test_names_of_trc_may_end_in_more_tabs_than_samples(tail):
    text = f"{trc()}\r\n".replace("\t\r\n", f"{tail}\r\n").replace("RASI\t\t" + tail, "RASI\t\t\t")
    recordings = read(text, "walk.trc")
    np.testing.assert_array_equal(recordings.demonstrations.positions, read(trc(), "walk.trc").demonstrations.positions)
    assert recordings.problems == ()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("x", "begins with HIERARCHY"),
        (BVH[:100], "expected MOTION"),
        (BVH.replace("CHANNELS 3", "CHANNELS 4"), "in line 9, got 'CHANNELS 4"),
        (BVH.replace("Frame Time: 0.0333333", "Frame Time: 0"), "above 0 s in line 18, got '0'"),
        (BVH[:-8], "line 30: expected 9 numbers, one for each channel, got"),
        (BVH.partition("Frame Time")[0], "expected 'Frame Time: SECONDS'"),
    ],
)
def test_a_damaged_bvh_file_says_where(content, words):
    with pytest.raises(DataError, match=words):
        read(content, "walk.bvh")


@pytest.fixture(scope="module")
def c3d_bytes(tmp_path_factory):
    """A file by ezc3d: two markers at 100 Hz, each lost once, and an analog channel at 1000 Hz."""
    pytest.importorskip("c3d", reason="the package c3d reads C3D")
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d writes the file")
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [100]
    content["parameters"]["POINT"]["LABELS"]["value"] = ("Ann:LASI", "Ann:RASI")
    content["parameters"]["POINT"]["UNITS"]["value"] = ("mm",)
    points = np.ones((4, 2, N))
    points[0] = np.arange(2 * N).reshape(2, N)
    points[:3, 1, 5] = np.nan
    content["data"]["points"] = points
    residuals = np.zeros((1, 2, N))
    residuals[0, 0, 7] = -1  # computed, not found, though it has a position
    content["data"]["meta_points"] = {"residuals": residuals, "camera_masks": np.zeros((7, 2, N), bool)}
    content["parameters"]["ANALOG"]["RATE"]["value"] = [1000]
    content["parameters"]["ANALOG"]["LABELS"]["value"] = ("force",)
    content["data"]["analogs"] = np.zeros((1, 1, 10 * N))
    path = tmp_path_factory.mktemp("c3d") / "a.c3d"
    content.write(str(path))
    return path.read_bytes()


def test_c3d_points_are_named_and_lost_ones_are_gaps(c3d_bytes):
    recordings = read(c3d_bytes, "a.c3d", skip="sample", fill_gaps=0)
    assert recordings.demonstrations.dimensions == ("LASI.x", "LASI.y", "LASI.z", "RASI.x", "RASI.y", "RASI.z")
    np.testing.assert_allclose(recordings.demonstrations.positions[:, 0], np.delete(np.arange(N), [5, 7]))
    np.testing.assert_allclose(recordings.demonstrations.times, np.delete(np.arange(N), [5, 7]) / 100)
    assert set(recordings.detected[0][0].measured_in) == {"mm"}
    assert "got nothing in 8.3 % of the samples, 8.3 % of 'RASI'" in recordings.problems[0].reason
    some = read(c3d_bytes, "a.c3d", columns="LASI", skip="sample", fill_gaps=0)
    assert some.demonstrations.lengths.tolist() == [N - 1]


def test_the_marker_that_one_file_lacks_is_named(tmp_path):
    pytest.importorskip("c3d", reason="the package c3d reads C3D")
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d writes the file")
    for name, markers in (
        ("a", ("M29", "M30")),
        ("b", ("M29", "M30")),
        ("c", ("M29",)),
        ("d", ("M29", "M30", "EXTRA")),
    ):
        content = ezc3d.c3d()
        content["parameters"]["POINT"]["RATE"]["value"] = [100]
        content["parameters"]["POINT"]["LABELS"]["value"] = markers
        points = np.ones((4, len(markers), N))
        points[:3] += np.sin(np.arange(N)) * np.arange(3 * len(markers)).reshape(3, -1, 1)
        content["data"]["points"] = points
        content.write(str(tmp_path / f"{name}.c3d"))
    recordings = read_recordings(tmp_path)
    assert len(recordings) == 2
    lacking, more = (problem.reason for problem in recordings.problems)
    assert lacking.startswith(
        "3 dimensions where most have 6: it lacks ['M30.x', 'M30.y', 'M30.z']; say --exclude M30 "
    )
    assert more.startswith("9 dimensions where most have 6: it has ['EXTRA.x', 'EXTRA.y', 'EXTRA.z'] besides; say --ex")
    recordings = read_recordings(tmp_path, exclude=["M30", "EXTRA"])
    assert (len(recordings), recordings.problems) == (4, ())


def test_a_damaged_c3d_file_says_so(c3d_bytes):
    for data, words in ((c3d_bytes[:-600], "truncated"), (c3d_bytes[:600], "truncated"), (b"hello", "foreign")):
        with pytest.raises(DataError, match=words):
            read(data, "a.c3d")


def test_without_the_package_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "c3d", None)
    with pytest.raises(DataError, match=r"pip install 'kineme\[mocap\]'"):
        read(b"\x02\x50", "a.c3d")
