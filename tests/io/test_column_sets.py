"""A set of recordings has one set of columns: by their names, in one order and one unit, and others are problems."""

from __future__ import annotations

import json

import numpy as np
import pandas
import pytest
import scipy.io

import kineme
from kineme.io.inspection.inspect import inspect
from kineme.io.reading.recordings import HowToRead, NameRule, read_paths
from kineme.library.storage.source import known_sources
from kineme.movements.channels.detect import name_of
from kineme.movements.tables.layout import Layout

N = 30
T = np.linspace(0.0, 1.0, N)
PATH = np.column_stack([T, T**2, np.sin(3 * T)])


def table(path, heads, columns):
    path.parent.mkdir(exist_ok=True)
    np.savetxt(path, np.column_stack([T, columns]), delimiter=",", header=",".join(["t", *heads]), comments="")


def trc(path, unit, scale):
    heads = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        f"100\t100\t{N}\t1\t{unit}",
        "Frame#\tTime\twrist\t\t",
        "\t\tX1\tY1\tZ1",
        "",
    ]
    rows = [
        "\t".join(map(repr, [k + 1, float(t), *map(float, scale * (1 + x))]))
        for k, (t, x) in enumerate(zip(T, PATH, strict=True))
    ]
    path.write_text("\n".join([*heads, *rows, ""]))


def test_marker_files_in_millimeters_and_in_meters_have_one_unit(tmp_path):
    trc(tmp_path / "a.trc", "mm", 1000.0)
    trc(tmp_path / "b.trc", "m", 1.0)
    trc(tmp_path / "c.trc", "mm", 1000.0)
    recordings = kineme.read_recordings(tmp_path)
    assert (len(recordings), recordings.problems) == (3, ())
    assert {channel.unit for channel in recordings.demonstrations.channels} == {"mm"}
    for movement in recordings.demonstrations:
        np.testing.assert_allclose(movement.positions, 1000.0 * (1 + PATH), rtol=1e-12)
    assert "units are converted: m to mm" in inspect(recordings).notes


@pytest.mark.parametrize(
    ("here", "there", "factor"),
    [
        (["j1 [deg]", "j2 [deg]", "j3 [deg]"], ["j1 [rad]", "j2 (Radians)", "j3 [rad]"], 180 / np.pi),
        (["x_mm", "y_mm", "z_mm"], ["x [m]", "y [meters]", "z (m)"], 1000.0),
        (["x [in]", "y [in]", "z [in]"], ["X [cm]", "Y [cm]", "Z [cm]"], 1 / 2.54),
    ],
)
def test_units_in_heads_are_converted_to_those_of_most(tmp_path, here, there, factor):
    table(tmp_path / "0.csv", there, PATH)
    for k in range(2):
        table(tmp_path / f"{k + 1}.csv", here, factor * PATH)
    recordings = kineme.read_recordings(tmp_path)
    assert (len(recordings), recordings.problems) == (3, ())
    assert recordings.demonstrations.dimensions == tuple(here)
    for movement in recordings.demonstrations:
        np.testing.assert_allclose(movement.positions, factor * PATH, rtol=1e-12)


def test_columns_are_put_in_order_and_converted_by_their_names(tmp_path):
    table(tmp_path / "0.csv", ["x [mm]", "y [mm]", "z [mm]"], 1000 * PATH)
    table(tmp_path / "1.csv", ["z [m]", "x [m]", "y [mm]"], PATH[:, [2, 0, 1]] * [1, 1, 1000])
    table(tmp_path / "2.csv", ["y [mm]", "x [mm]", "z [mm]"], 1000 * PATH[:, [1, 0, 2]])
    recordings = kineme.read_recordings(tmp_path)
    assert recordings.problems == ()
    for movement in recordings.demonstrations:
        np.testing.assert_allclose(movement.positions, 1000 * PATH, rtol=1e-12)


@pytest.mark.parametrize(
    ("heads", "reason"),
    [
        (["elbow_roll", "temp", "volt"], r"the columns ['elbow_roll', 'temp', 'volt'] where most files have ['hand_x"),
        (
            ["hand_x", "hand_y", "hand_w"],
            "['hand_w'] where most files have ['hand_z [mm]']; say --exclude 'hand_z [mm],hand_w' ",
        ),
        (["hand_x [V]", "hand_y [V]", "hand_z [V]"], "expected 'hand_x [V]' in 'mm', as the others have it, got 'V'"),
        (["hand_x [parsec]", "hand_y [mm]", "hand_z [mm]"], "got 'parsec', which cannot be converted"),
        (["hand_x", "hand_y", "hand_z"], "expected 'hand_x' in 'mm', as the others have it, got no unit"),
    ],
)
def test_files_of_other_columns_are_left_out_and_said(tmp_path, heads, reason):
    for k in range(2):
        table(tmp_path / f"{k}.csv", ["hand_x [mm]", "hand_y [mm]", "hand_z [mm]"], PATH)
    table(tmp_path / "other.csv", heads, PATH)
    recordings = kineme.read_recordings(tmp_path)
    assert [source.path for source in recordings.sources] == ["0.csv", "1.csv"]
    (problem,) = recordings.problems
    assert problem.file == "other.csv"
    assert reason in problem.reason


def _frame(heads):
    columns = PATH * [1000.0, 1.0, 1000.0]  # x and z in mm, y in m
    return dict(zip(["t", *heads], [T, *columns.T], strict=True))


def _write_units_row(path):
    rows = ["t,x,y,z", "s,mm,m,mm", *(",".join(map(repr, row)) for row in zip(*_frame("xyz").values(), strict=True))]
    path.write_text("\n".join(rows).replace("np.float64(", "").replace(")", ""))


def _write_attributes(path):
    import h5py

    with h5py.File(path, "w") as file:
        for name, values in _frame("xyz").items():
            file[name] = values
            file[name].attrs["units"] = {"t": "s", "y": "m"}.get(name, "mm")


def _write_parquet(path):
    pytest.importorskip("pyarrow")
    pandas.DataFrame(_frame(["x [mm]", "y [m]", "z [mm]"])).to_parquet(path)


IN_WORDS = ["x_mm", "y_m", "z_mm"]
SEVERAL_UNITS = {
    "a.csv": lambda path: pandas.DataFrame(_frame(IN_WORDS)).to_csv(path, index=False),
    "b.csv": lambda path: pandas.DataFrame(_frame(["x [mm]", "y (Meters)", "z [mm]"])).to_csv(path, index=False),
    "c.csv": _write_units_row,
    "d.json": lambda path: pandas.DataFrame(_frame(IN_WORDS)).to_json(path, double_precision=15),
    "e.npz": lambda path: np.savez(path, **_frame(IN_WORDS)),
    "f.mat": lambda path: scipy.io.savemat(path, _frame(IN_WORDS)),
    "g.h5": _write_attributes,
    "h.parquet": _write_parquet,
}


@pytest.mark.parametrize("name", SEVERAL_UNITS)
def test_columns_of_one_file_in_several_units_are_in_that_of_most(tmp_path, name):
    SEVERAL_UNITS[name](tmp_path / name)
    recordings = kineme.read_recordings(tmp_path)
    demos = recordings.demonstrations
    np.testing.assert_allclose(demos[0].positions, 1000 * PATH, rtol=1e-12)
    assert {channel.unit for channel in demos.channels} == {"mm"}
    assert [name_of(channel.name) for channel in demos.channels] == ["x", "y", "z"]
    (note,) = (note for note in inspect(recordings).notes if "converted" in note)
    assert note.startswith("units are converted to those of most columns: y")


def test_angles_and_speeds_of_one_file_have_one_unit_and_ranges_keep_theirs(tmp_path):
    heads = ["j1 [deg]", "j2 [rad]", "j3 [deg]", "u [m/s]", "w [mm/s]", "gripper [%]", "thumb [-100..100]"]
    table(tmp_path / "a.csv", heads, np.column_stack([T] * 7))
    demos = kineme.read_recordings(tmp_path).demonstrations
    np.testing.assert_allclose(demos[0].positions[-1], [1, 180 / np.pi, 1, 1, 0.001, 1, 1])
    assert demos.dimensions == (heads[0], "j2 [deg]", *heads[2:4], "w [m/s]", *heads[5:])


def test_data_frames_of_several_units_are_converted_with_a_warning():
    with pytest.warns(UserWarning, match=r"units are converted to those of most columns: y_m as y \[mm\]"):
        demos = kineme.Demonstrations.from_dataframe(pandas.DataFrame(_frame(IN_WORDS)))
    np.testing.assert_allclose(demos[0].positions, 1000 * PATH, rtol=1e-12)


def test_one_column_in_two_units_is_refused_and_kinds_are_said_by_the_heads_of_the_file(tmp_path):
    table(tmp_path / "twice.csv", ["x_mm", "y_mm", "x_m"], PATH)
    with pytest.raises(
        kineme.errors.DataError, match=r"got \['x_mm', 'x_m'\], which are one in several units.*--exclude"
    ):
        kineme.read_recordings(tmp_path)
    recordings = kineme.read_recordings(tmp_path, exclude="x_mm")
    assert recordings.demonstrations.dimensions == ("y_mm", "x [mm]")
    table(tmp_path / "twice.csv", IN_WORDS, PATH)
    recordings = kineme.read_recordings(tmp_path, kinds={"y_m": "discrete"})
    assert recordings.demonstrations.channels[1][:2] == ("y [mm]", "discrete")


def test_files_that_are_joined_have_one_unit(tmp_path):
    table(tmp_path / "elbow.csv", ["x [mm]", "y [mm]"], 1000 * PATH[:, :2])
    table(tmp_path / "wrist.csv", ["x [m]"], PATH[:, 2:])
    recordings = kineme.read_recordings(tmp_path, join_files=True)
    assert recordings.demonstrations.dimensions == ("elbow.x [mm]", "elbow.y [mm]", "wrist.x [mm]")
    np.testing.assert_allclose(recordings.demonstrations[0].positions, 1000 * PATH, rtol=1e-12)
    assert "wrist.x [m] as wrist.x [mm]" in " ".join(inspect(recordings).notes)


def test_a_library_of_converted_columns_recognizes_files_that_have_more(tmp_path):
    for k, label in enumerate("ab"):
        table(tmp_path / label / "0.csv", IN_WORDS, (1 + k) * PATH[:, [0, 1, 2][:: 1 - 2 * k]])
    with kineme.ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(kineme.read_recordings([tmp_path / "a", tmp_path / "b"]).demonstrations)
        sources = known_sources(library.store)
    assert sources.columns == ("x_mm", "y [mm]", "z_mm")
    table(tmp_path / "asked.csv", [*IN_WORDS, "volt"], np.column_stack([PATH, T]))
    recordings = read_paths([tmp_path / "asked.csv"], HowToRead(Layout(reference=sources), NameRule()))
    assert recordings.demonstrations.dimensions == sources.columns
    assert recordings.demonstrations[0].positions[-1, 1] == pytest.approx(1000.0)


def test_an_unknown_unit_that_all_files_have_is_kept_as_text(tmp_path):
    for k in range(2):
        table(tmp_path / f"{k}.csv", ["X (a.u.)", "Y (a.u.)", "Z (a.u.)"], PATH)
    table(tmp_path / "2.csv", ["X (g)", "Y (g)", "Z (g)"], PATH)
    recordings = kineme.read_recordings(tmp_path)
    assert {channel.unit for channel in recordings.demonstrations.channels} == {"a.u."}
    assert [problem.file for problem in recordings.problems] == ["2.csv"]


def test_the_sensors_of_one_box_are_no_demonstrations_of_one_movement(tmp_path):
    for name in ("Accelerometer", "Gyroscope", "Magnetometer", "TotalAcceleration"):
        table(tmp_path / "Left Foot" / f"{name}.csv", ["z", "y", "x"], PATH)
    table(tmp_path / "Left Foot" / "Battery.csv", ["percentage", "voltage", "current"], PATH)
    recordings = kineme.read_recordings(tmp_path)
    assert [source.path for source in recordings.sources] == ["Left Foot/Accelerometer.csv"]
    assert len(recordings.problems) == 4
    assert "gyroscope where most files are of accelerometer; read them apart" in recordings.problems[1].reason
    for k in (1, 2):
        table(tmp_path / "wave" / f"{k}_accelerometer.csv", ["z", "y", "x"], PATH)
    assert len(kineme.read_recordings(tmp_path / "wave")) == 2


def bvh(path, joints):
    levels = [
        f"{'JOINT' if k else 'ROOT'} {name}\n{{\nOFFSET 0 1 0\nCHANNELS 3 Zrotation Xrotation Yrotation"
        for k, name in enumerate(joints)
    ]
    text = "\n".join(["HIERARCHY", *levels, "End Site\n{\nOFFSET 0 1 0\n}", *["}"] * len(joints)])
    rows = [" ".join(f"{100 * np.sin(t + k):.4f}" for k in range(3 * len(joints))) for t in T]
    path.write_text("\n".join([text, "MOTION", f"Frames: {N}", "Frame Time: 0.01", *rows, ""]))


def test_two_skeletons_never_merge(tmp_path):
    bvh(tmp_path / "a.bvh", ["Hips", "Spine", "Neck"])
    bvh(tmp_path / "b.bvh", ["Hips", "Spine", "Neck"])
    bvh(tmp_path / "c.bvh", ["pelvis", "torso", "head"])
    recordings = kineme.read_recordings(tmp_path)
    assert [source.path for source in recordings.sources] == ["a.bvh", "b.bvh"]
    assert [problem.file for problem in recordings.problems] == ["c.bvh"]


def test_files_without_names_are_taken_by_their_count(tmp_path):
    table(tmp_path / "named.csv", ["px", "py", "pz"], PATH)
    np.savetxt(tmp_path / "headless.csv", np.column_stack([T, PATH]), delimiter=",")
    table(tmp_path / "counted.csv", ["x1", "x2", "x3"], PATH)
    np.savez(tmp_path / "arrays.npz", times=T, positions=PATH)
    (tmp_path / "plain.json").write_text(json.dumps({"times": T.tolist(), "positions": PATH.tolist()}))
    recordings = kineme.read_recordings(tmp_path)
    assert recordings.problems == ()
    assert len(recordings) == 5
    assert [source.path for source in recordings.sources] == sorted(source.path for source in recordings.sources)
    assert recordings.demonstrations.channels is None
    for movement in recordings.demonstrations:
        np.testing.assert_allclose(movement.positions, PATH, rtol=1e-12)


def test_one_file_of_more_columns_is_left_out_and_the_chosen_columns_bring_it_back(tmp_path):
    for k in range(2):
        table(tmp_path / f"{k}.csv", ["x", "y"], PATH[:, :2])
    table(tmp_path / "more.csv", ["y", "x", "battery"], PATH[:, [1, 0, 2]])
    recordings = kineme.read_recordings(tmp_path)
    assert [problem.file for problem in recordings.problems] == ["more.csv"]
    chosen = kineme.read_recordings(tmp_path, columns=["x", "y"])
    assert chosen.problems == ()
    for movement in chosen.demonstrations:
        np.testing.assert_allclose(movement.positions, PATH[:, :2], rtol=1e-12)


def test_columns_chosen_by_their_numbers_may_have_any_names(tmp_path):
    table(tmp_path / "0.csv", ["left_x", "left_y", "left_z"], PATH)
    table(tmp_path / "1.csv", ["right_x", "right_y", "right_z"], PATH)
    assert [problem.file for problem in kineme.read_recordings(tmp_path).problems] == ["1.csv"]
    by_number = kineme.read_recordings(tmp_path, columns=[1, 2, 3])
    assert (len(by_number), by_number.problems) == (2, ())
