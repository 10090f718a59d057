"""Reading recorded movements, and writing generated ones so that nothing is lost."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import kineme
import kineme.orientation
from kineme.dmp.generation.generate import MovementOptions, generate, learn_one
from kineme.io.reading.recordings import read_recording
from kineme.io.writing.write_movement import WRITERS, ColumnNames, write_movement

TIMES = np.array([0.0, 0.1, 0.25, 0.4, 0.5])
PATH = np.array([[0.0, 1.0], [0.5, 1.5], [1.0, 2.5], [1.5, 2.0], [2.0, 3.0]])


def table(separator=",", header="time,x,y", comment=""):
    rows = [[repr(float(cell)) for cell in row] for row in np.column_stack((TIMES, PATH))]
    lines = [header.replace(",", separator)] if header else []
    return comment + "\n".join(lines + [separator.join(row) for row in rows]) + "\n"


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize("header", ["time,x,y", "", "t,x,y", "Timestamp,x,y", '"time_s",x,y'])
@pytest.mark.parametrize("ending", [".csv", ".tsv", ".txt"])
def test_tables_of_many_kinds(tmp_path, separator, header, ending):
    path = tmp_path / f"wave{ending}"
    path.write_text(table(separator, header, comment="# recorded by hand\n"), encoding="utf-8")
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.times, TIMES)
    np.testing.assert_array_equal(recording.positions, PATH)
    assert recording.name == path.name


def test_time_may_stand_in_any_column_and_carry_a_unit(tmp_path):
    (tmp_path / "a.csv").write_text("x [m],time [s],y [m]\n" + "\n".join(f"{k},{k / 10},{k * k}" for k in range(5)))
    recording = read_recording(tmp_path / "a.csv")
    np.testing.assert_allclose(recording.times, np.arange(5) / 10)
    np.testing.assert_array_equal(recording.positions[:, 1], np.arange(5) ** 2)


def test_a_byte_order_mark_and_windows_lines_are_read(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"\xef\xbb\xbf" + table().replace("\n", "\r\n").encode())
    np.testing.assert_array_equal(read_recording(tmp_path / "a.csv").positions, PATH)


@pytest.mark.parametrize("ending", sorted(WRITERS))
def test_what_is_written_is_read_back_bit_for_bit(tmp_path, ending):
    columns = {"times": TIMES, "positions": PATH / 3}
    recording = read_recording(write_movement(tmp_path / f"x{ending}", columns))
    np.testing.assert_array_equal(recording.times, TIMES)
    np.testing.assert_array_equal(recording.positions, PATH / 3)


def test_whatever_holds_one_movement_is_written(tmp_path):
    movement = kineme.Trajectory(TIMES, PATH)
    rollout = kineme.DMP().learn(movement).rollout(n_samples=50)
    for held in (movement, [movement], kineme.Demonstrations([movement])):
        np.testing.assert_array_equal(read_recording(write_movement(str(tmp_path / "x.csv"), held)).positions, PATH)
    text = write_movement(tmp_path / "x.csv", rollout).read_text()
    assert text.splitlines()[0] == "time,x,y,v_x,v_y,a_x,a_y"
    np.testing.assert_array_equal(read_recording(tmp_path / "x.csv").positions, rollout.positions[0])
    with pytest.raises(kineme.errors.TrajectoryError, match="expected one recording, got 2 movements"):
        write_movement(tmp_path / "x.csv", [movement, movement])


def test_columns_are_named(tmp_path):
    columns = {"times": TIMES, "positions": PATH, "velocities": PATH, "accelerations": PATH}
    text = write_movement(tmp_path / "x.csv", columns).read_text()
    assert text.splitlines()[0] == "time,x,y,v_x,v_y,a_x,a_y"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", "", "a.csv: expected samples, got an empty file"),
        ("a.csv", "time,x\n0,1\n1,oops\n", "a.csv, line 3: expected a number in 'x', got 'oops'"),
        ("a.csv", "time,x\n0,1\n1\n", "a.csv, line 3: expected 2 columns, got 1"),
        ("a.csv", "time,x\n0,1\n1,2\ntime,x\n0,1\n", "a.csv, line 4: expected numbers, got the heads again"),
        ("a.csv", "a,b\n0,1\n1,2\n", r"a.csv: expected one column of times, .* got the columns \['a', 'b'\]"),
        ("a.csv", "time,t,x\n0,1,2\n1,5,2\n", "one column of times"),
        ("a.csv", "1\n2\n3\n4\n", "at least one of positions, got one column"),
        ("a.mp4", "", "a file ending in one of .csv, .tsv, .txt, .npz, .json, .*, got '.mp4'"),
        ("a.json", "[1, 2]", "an object with times and positions, got a list"),
        ("a.json", '{"times": [0, 1]}', "got no entry 'positions'"),
        ("a.json", '{"times": ', "a.json: expected JSON, got a truncated or damaged file .Expecting value"),
        ("a.npz", "not an archive", "archive of arrays"),
    ],
)
def test_files_that_are_not_what_their_name_says(tmp_path, name, content, words):
    (tmp_path / name).write_text(content)
    with pytest.raises(kineme.errors.DataError, match=words):
        read_recording(tmp_path / name)


def test_bytes_that_are_no_text(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"\xff\x00\x01" * 9)
    with pytest.raises(kineme.errors.DataError, match=r"a\.csv: expected text, got bytes that are none"):
        read_recording(tmp_path / "a.csv")


def test_numbers_that_are_no_movement_name_the_file(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps({"times": [0, 1, 1, 2], "positions": [1, 2, 3, 4]}))
    with pytest.raises(kineme.errors.TrajectoryError, match=r"a\.json: expected strictly increasing times"):
        read_recording(tmp_path / "a.json")


def test_writing_to_an_unknown_ending_is_refused(tmp_path):
    with pytest.raises(kineme.errors.DataError, match=r"\.csv, \.npz, \.json, \.parquet, got '\.xls'"):
        write_movement(tmp_path / "a.xls", {"times": TIMES, "positions": PATH})


@pytest.mark.parametrize(
    ("movement", "words"),
    [
        ({}, r"a dict of times, positions and, if you like, velocities, accelerations, got \[\]"),
        ({"times": TIMES, "positions": PATH, "speeds": PATH}, r"got \['times', 'positions', 'speeds'\]"),
        (
            {"times": TIMES, "positions": PATH[:-1]},
            r"times of shape \(T,\) .* got times of shape \(5,\) with positions of shape",
        ),
        (
            {"times": TIMES, "positions": TIMES},
            r"others of shape \(T, d\), got times of shape \(5,\) with positions of shape \(5,\)",
        ),
        ({"times": TIMES, "positions": PATH, "velocities": PATH[:, :1]}, r"got velocities of shape \(5, 1\) with"),
        ({"times": TIMES, "positions": "none"}, "positions: expected an array of numbers"),
    ],
)
def test_a_dict_that_is_no_movement_is_not_written(tmp_path, movement, words):
    with pytest.raises(kineme.errors.TrajectoryError, match=words):
        kineme.write_movement(tmp_path / "a.csv", movement)
    assert not list(tmp_path.iterdir())


def test_arguments_in_the_other_order_are_said_to_be():
    for movement in (PATH, kineme.Trajectory(TIMES, PATH)):
        with pytest.raises(
            TypeError, match=r"the path of a file to write, got .*; write write_movement\(path, movement"
        ):
            kineme.write_movement(movement, "a.csv")


def test_lists_are_written_as_arrays_are(tmp_path):
    path = kineme.write_movement(tmp_path / "a.json", {"times": TIMES.tolist(), "positions": PATH.tolist()})
    np.testing.assert_array_equal(kineme.read_recording(path).positions, PATH)


def test_the_page_lists_every_format():
    from kineme.io.reading.formats import DATA_SETS, FORMATS

    page = (Path(__file__).parents[2] / "docs" / "guide" / "recordings.md").read_text(encoding="utf-8")
    table = page.partition("## What is read")[2].partition("\n## ")[0]
    assert [
        ending for ending in (*FORMATS, *(data_set.marker for data_set in DATA_SETS)) if f"`{ending}`" not in table
    ] == []


@pytest.mark.parametrize("ending", sorted(WRITERS))
def test_generated_poses_are_read_as_poses(tmp_path, ending):
    u = np.linspace(0, 1, 50)
    q = kineme.orientation.exp(np.outer(u, [0.3, 0, 2.0]))
    rollout = kineme.orientation.PoseDMP().learn([np.column_stack([u, u**2, 1 - u, q])]).rollout(n_samples=60)
    path = write_movement(tmp_path / f"x{ending}", rollout)
    recording = read_recording(path)
    assert [(c.name, c.kind) for c in recording.channels or ()][2:] == [("z", "position"), ("q", "orientation")]
    np.testing.assert_allclose(recording.recorded, rollout.positions[0], atol=1e-12)
    if ending == ".csv":
        assert path.read_text().startswith("time,x,y,z,qw,qx,qy,qz,v_x,v_y,v_z,v_q.rx,v_q.ry,v_q.rz,a_x")


@pytest.mark.parametrize("ending", sorted(WRITERS))
def test_units_that_heads_do_not_say_are_written(tmp_path, ending):
    rows = np.column_stack([TIMES, PATH, 40 * PATH])
    text = "t,x,y (left),q1,q2\ns,mm,mm,deg,deg\n" + "\n".join(",".join(map(str, row)) for row in rows.tolist())
    (tmp_path / "a.csv").write_text(text)
    recording = read_recording(tmp_path / "a.csv")
    learned = learn_one(recording, kineme.DMP())
    made = generate(learned, MovementOptions())
    for movement in ((recording,), (learned.primitive.rollout(),), (made.columns, made.names)):
        channels = read_recording(write_movement(tmp_path / f"x{ending}", *movement)).channels or ()
        assert [(c.kind, c.unit) for c in channels] == [("position", "mm")] * 2 + [("angle", "deg")] * 2
        assert channels[0].name == "x [mm]"


def test_a_name_with_a_line_break_is_one_head_of_csv(tmp_path):
    columns = {"times": TIMES, "positions": PATH}
    names = ColumnNames(("a\nb", 'c,"d"'), ("a\nb", 'c,"d"'))
    text = write_movement(tmp_path / "x.csv", columns, names).read_text()
    assert text.startswith('time,a b,"c,""d"""\n')
    np.testing.assert_array_equal(read_recording(tmp_path / "x.csv").positions, PATH)


@pytest.mark.parametrize("name", ["=cmd|'/c calc'!A1", "@x", "-x", "'=x", "plain"])
def test_heads_are_no_formulas_in_csv_and_come_back(tmp_path, name):
    rows = np.column_stack([np.linspace(0, 1, 9), -np.arange(9.0)])
    demos = kineme.Demonstrations.of(pd.DataFrame(rows, columns=["t", name]))
    path = write_movement(
        tmp_path / "a.csv", {"times": demos.times, "positions": demos.positions}, ColumnNames((name,), (name,))
    )
    head, line = path.read_text().splitlines()[:2]
    assert not [cell for cell in head.replace('"', "").split(",") if cell[:1] in {"=", "+", "-", "@"}]
    assert line == "0.0,-0.0"
    assert kineme.read_recordings(path).demonstrations.dimensions == (name,)
