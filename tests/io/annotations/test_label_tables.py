"""Tables of labels as people, pandas, ELAN and Audacity write them, and the movements that they cut."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pandas
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme.errors import DataError, KinemeError
from kineme.io.reading.read_labels import labeled_pieces, read_labels, seconds_of, stretches_of
from kineme.io.reading.recordings import read_recordings
from kineme.io.writing.annotations import Annotation, write_annotations
from kineme.library.correct import as_labels, corrections_of

SPANS = [(0.5, 1.75, "wave"), (2.0, 4.0, "nod")]
#: As ELAN exports them: heads of a tier in a column of its own, heads with a tier for each row, and none.
ELAN = {
    "heads": "Begin Time - hh:mm:ss.ms\tBegin Time - ss.msec\tEnd Time - hh:mm:ss.ms\tEnd Time - ss.msec\t"
    "Duration - hh:mm:ss.ms\tDuration - ss.msec\tsymbol\n"
    "00:00:00.500\t0.5\t00:00:01.750\t1.75\t00:00:01.250\t1.25\twave\n"
    "00:00:02.000\t2.0\t00:00:04.000\t4.0\t00:00:02.000\t2.0\tnod\n",
    "media": '"#file:///home/a/video.mp4 -- offset: 0"\nTier\tBegin Time - msec\tEnd Time - msec\tAnnotation\n'
    "arm\t500\t1750\twave\narm\t2000\t4000\tnod\n",
    "none": "arm\tAnna\t00:00:00.500\t0.5\t00:00:01.750\t1.75\t00:00:01.250\t1.25\twave\n"
    "arm\tAnna\t00:00:02.000\t2.0\t00:00:04.000\t4.0\t00:00:02.000\t2.0\tnod\n",
}
TABLES = {
    "plain.csv": ("start,end,label\n0.5,1.75,wave\n2,4,nod\n", False),
    "units.csv": ("onset [ms];offset [ms];gesture\n500;1750;wave\n2000;4000;nod\n", False),
    "two units.csv": ("start [s],end [ms],label\n0.5,1750,wave\n2,4000,nod\n", False),
    "minutes.csv": ("start_us,end [min],label\n500000,0.029166666666666667,wave\n2e6,0.06666666666666667,nod\n", False),
    "clocks.csv": ("start [ms],end (min),label\n0:00.5,0:01.75,wave\n0:02,0:04,nod\n", False),
    "boris.csv": ("Behavior,Behavior type,Start (s),Stop (s)\nwave,STATE,0.5,1.75\nnod,STATE,2,4\n", False),
    "frames.csv": ("start frame,end frame,start,end,label\n15,52,0.5,1.75,wave\n60,120,2,4,nod\n", False),
    "comma.csv": ("Start;Ende;Ende Zeit;end time;label\n0,5;;;1,75;wave\n2,0;;;4,0;nod\n", False),
    "order.tsv": ("label\tstart_time\tend_time\nwave\t0.5\t1.75\nnod\t2\t4\n", False),
    "audacity.txt": ("0.5\t1.75\twave\n\\\t100.0\t200.0\n2.000000\t4.000000\tnod\n", True),
    "underscores.csv": ("start_ms,end_ms,label\n500,1750,wave\n2000,4000,nod\n", False),
    "seconds.csv": ("start_s,end_s,end_effector,label\n0.5,1.75,1,wave\n2,4,1,nod\n", False),
    "who.csv": ("event,name,start,end,label\n1,bob,0.5,1.75,wave\n2,ann,2,4,nod\n", False),
    "objects.json": (json.dumps([dict(zip(("start", "end", "label"), span, strict=True)) for span in SPANS]), False),
    **{f"elan-{name}.txt": (text, True) for name, text in ELAN.items()},
}


@pytest.fixture
def recordings(tmp_path):
    t = 1000.0 + np.arange(0.0, 5.0, 0.01)
    frame = pandas.DataFrame({"time": t, "a": np.sin(t), "b": np.cos(t), "gripper": (t > 1001).astype(int)})
    frame.to_csv(tmp_path / "long.csv", index=False)
    return read_recordings(tmp_path / "long.csv")


@pytest.mark.parametrize("name", TABLES)
def test_every_table_says_when_and_what(tmp_path, name):
    text, since_start = TABLES[name]
    (tmp_path / name).write_bytes(b"\xef\xbb\xbf" * name.endswith("csv") + text.encode())
    table = read_labels(tmp_path / name)
    assert [(row.start, row.end, row.label) for row in table.rows] == SPANS
    assert table.since_start is since_start


def test_notes_are_those_of_the_pieces(tmp_path):
    """Of two samples that a tracker lost, the labeled stretches hold none, or one."""
    t = np.arange(0.0, 5.0, 0.01)
    x = np.sin(3.0 * t) + 50.0
    x[[150, 450]] = 0.0
    pandas.DataFrame({"time": t, "x": x, "y": np.cos(t)}).to_csv(tmp_path / "lost.csv", index=False)
    whole = read_recordings(tmp_path / "lost.csv")
    (tmp_path / "l.csv").write_text("start,end,label\n0.5,1.75,wave\n2,4,nod\n")
    (tmp_path / "m.csv").write_text("start,end,label\n2,4,nod\n")
    lost = "1 movement with samples far from the path, the first "
    notes = [each.notes for each in (whole, *(labeled_pieces(whole, read_labels(tmp_path / f"{k}.csv")) for k in "lm"))]
    assert [[note.startswith(lost) for note in each] for each in notes] == [[True], [True], []]


@pytest.mark.parametrize("name", ["out.csv", "out.json", "out.eaf", "out.txt"])
def test_what_was_written_is_read_again_and_cuts_the_same_stretches(tmp_path, recordings, name):
    written = [
        Annotation("long.csv", "", 1000 + start, 1000 + end, label if label == "wave" else None, 0.5, 0.5, 1000.0)
        for start, end, label in SPANS
    ]
    write_annotations(tmp_path / name, written, [tmp_path / "long.csv"])
    pieces = labeled_pieces(recordings, read_labels(tmp_path / name))
    assert [source.label for source in pieces.sources] == ["wave", None]
    ends = [(round(movement.times[0], 6), round(movement.times[-1], 6)) for movement in pieces]
    assert ends == [(1000.5, 1001.75), (1002.0, 1004.0)]
    assert pieces.demonstrations.channels == recordings.demonstrations.channels
    first, last = np.searchsorted(recordings[0].times, [1000.5 - 1e-6, 1001.75 + 1e-6])
    np.testing.assert_array_equal(pieces[0].recorded, recordings[0].recorded[first:last])
    assert pieces.sources[0].place == "1000.5-1001.75 s"


def test_times_that_fit_only_from_the_first_sample_are_taken_so(tmp_path, recordings):
    (tmp_path / "plain.csv").write_text(TABLES["plain.csv"][0])
    pieces = labeled_pieces(recordings, read_labels(tmp_path / "plain.csv"))
    assert [round(movement.times[0], 6) for movement in pieces] == [1000.5, 1002.0]
    assert pieces.demonstrations.labels.tolist() == ["wave", "nod"]


def test_times_within_the_recording_are_by_its_clock_where_both_would_fit(tmp_path):
    rows = "\n".join(f"{0.01 * k},{np.sin(0.01 * k)}" for k in range(200, 701))
    (tmp_path / "late.csv").write_text(f"t,x\n{rows}\n")
    (tmp_path / "l.csv").write_text("start,end,label\n3,4,wave\n")
    (piece,) = labeled_pieces(read_recordings(tmp_path / "late.csv"), read_labels(tmp_path / "l.csv"))
    assert round(piece.times[0], 6) == 3.0


def test_stretches_outside_are_problems_that_name_the_line(tmp_path, recordings):
    (tmp_path / "l.csv").write_text("start,end,label\n1000.5,1001.75,wave\n1006,1007,nod\n1001,1001.01,nod\n")
    pieces = labeled_pieces(recordings, read_labels(tmp_path / "l.csv"))
    assert len(pieces) == 1
    assert [problem.line for problem in pieces.problems] == [3, 4]
    assert "between 1006.00 and 1007.00 s in long.csv; it lasts from 1000.00 to 1004.99 s" in str(pieces.problems[0])
    (tmp_path / "l.csv").write_text("start,end,label\n1004,1005.05,wave\n1003.5,1006,nod\n999,1001,nod\n")
    pieces = labeled_pieces(recordings, read_labels(tmp_path / "l.csv"))
    assert [source.label for source in pieces.sources] == ["wave"]
    assert [problem.line for problem in pieces.problems] == [3, 4]
    (tmp_path / "l.csv").write_text("start,end,label\n2000,2001,wave\n")
    with pytest.raises(DataError, match="found none; the first that is none"):
        labeled_pieces(recordings, read_labels(tmp_path / "l.csv"))


def test_a_stretch_at_rest_is_a_problem_beside_those_that_are_learned(tmp_path):
    t = 1.7e9 + np.arange(0.0, 10.0, 0.01)
    x = np.sin(np.minimum(t, 1.7e9 + 5))
    pandas.DataFrame({"time": t, "x": x}).to_csv(tmp_path / "r.csv", index=False)
    rows = "1700000001,1700000003,wave\n1700000006,1700000007,pause\n"
    (tmp_path / "l.csv").write_text("start,end,label\n" + rows)
    pieces = labeled_pieces(read_recordings(tmp_path / "r.csv"), read_labels(tmp_path / "l.csv"))
    said = "expected a movement between 1700000006.00 and 1700000007.00 s in r.csv, got 101 samples at the same place"
    assert ([*pieces.labels], [problem.what for problem in pieces.problems]) == (["wave"], [f"line 3: {said}"])


def test_a_mark_without_length_is_a_problem_beside_labels_that_are_read(tmp_path, recordings):
    (tmp_path / "labels.txt").write_text("1.0\t1.0\tmark\n2.0\t4.0\tnod\n")
    pieces = labeled_pieces(recordings, read_labels(tmp_path / "labels.txt"))
    assert pieces.labels.tolist() == ["nod"]
    assert [problem.line for problem in pieces.problems] == [1]


def test_rows_of_recordings_that_are_not_there_are_a_problem(tmp_path, recordings):
    rows = "long.csv,1000.5,1001.75,wave\nq.csv,1002,1004,nod\nr.csv,1002,1004,nod\n"
    (tmp_path / "l.csv").write_text("recording,start,end,label\n" + rows)
    pieces = labeled_pieces(recordings, read_labels(tmp_path / "l.csv"))
    assert len(pieces.demonstrations) == 1
    (problem,) = pieces.problems
    expected = "expected a recording q.csv among those that are read, found none, and 1 row more"
    assert problem.what == f"line 3: {expected}"


def test_a_stretch_that_is_labeled_twice_is_a_problem_that_names_both_lines(tmp_path, recordings):
    (tmp_path / "l.csv").write_text("start,end,label\n1000.5,1001.75,wave\n1000.5,1001.75,nod\n")
    pieces = labeled_pieces(recordings, read_labels(tmp_path / "l.csv"))
    assert pieces.demonstrations.labels.tolist() == ["wave"]
    assert [problem.what for problem in pieces.problems] == [
        "line 3: expected one label for a stretch, line 2 has it too"
    ]


def test_columns_say_which_recording_a_row_is_of(tmp_path, recordings):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "long.csv").write_bytes((tmp_path / "long.csv").read_bytes())
    (tmp_path / "long.csv").unlink()
    several = read_recordings(tmp_path)
    text = "recording,start,end,label\na/long.csv,1000.5,1001.75,wave\nb/long.csv,1002,1004,nod\n"
    (tmp_path / "labels.csv").write_text(text)
    pieces = labeled_pieces(several, read_labels(tmp_path / "labels.csv"))
    assert [(source.path, source.label) for source in pieces.sources] == [("a/long.csv", "wave"), ("b/long.csv", "nod")]
    (tmp_path / "labels.csv").write_text(TABLES["plain.csv"][0])
    with pytest.raises(DataError, match="beside one recording, got 2"):
        labeled_pieces(several, read_labels(tmp_path / "labels.csv"))


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.csv", "start,end,label\n1,2,wave\n3,2,nod\n", "line 3: expected a start and an end after it"),
        ("a.csv", "start,end,label\n1,oops,wave\n", "line 2"),
        ("a.csv", "start,end,label\n1\n", "line 2"),
        ("a.csv", "start,end,who,what\n1,2,ann,wave\n", "expected one column of labels .*; call it label"),
        ("a.csv", "x,y\n1,2\n", "expected a table with columns start, end and label"),
        ("a.csv", "start frame,end frame,label\n1,20,wave\n", "unit of time .*, got 'start frame'; divide frames"),
        ("a.csv", "Start,Stop [samples],label\n1,20,wave\n", "unit of time .*, got 'Stop \\[samples\\]'"),
        ("a.csv", "start [m],end [m],label\n1,20,wave\n", "unit of time .*, got 'start \\[m\\]'"),
        ("a.csv", "", "got no labels"),
        ("a.json", "{}", "list of objects"),
        ("a.json", "[", "a.json"),
        ("a.eaf", "<A", "a.eaf"),
        ("a.eaf", "<A/>", "got no labels"),
    ],
)
def test_a_table_that_is_none_is_refused_by_name(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    with pytest.raises(DataError, match=said) as error:
        read_labels(tmp_path / name)
    assert name in str(error.value)


@given(
    data=st.one_of(
        st.binary(max_size=200), st.sampled_from([*TABLES.values()]).flatmap(lambda table: _spoiled(table[0]))
    )
)
def test_whatever_the_bytes_only_an_error_for_users_comes_out(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("labels")
    for ending in (".csv", ".json", ".eaf"):
        (folder / f"a{ending}").write_bytes(data)
        try:
            table = read_labels(folder / f"a{ending}")
        except KinemeError:
            continue
        assert all(row.end > row.start for row in table.rows)


def _spoiled(text):
    def spoil(change):
        at, new = change
        data = bytearray(text.encode())
        data[at % len(data)] = new
        return bytes(data)

    return st.tuples(st.integers(0, 500), st.integers(0, 255)).map(spoil)


def test_pandas_writes_a_table_that_is_read(tmp_path):
    text = io.StringIO()
    pandas.DataFrame(SPANS, columns=["start", "end", "label"]).to_csv(text)
    (tmp_path / "l.csv").write_text(text.getvalue())
    assert [(row.start, row.end, row.label) for row in read_labels(tmp_path / "l.csv").rows] == SPANS


def test_a_name_that_two_recordings_have_is_said_and_labels_neither(tmp_path, recordings):
    for name in ("s1", "s2"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.csv").write_bytes((tmp_path / "long.csv").read_bytes())
    (tmp_path / "long.csv").unlink()
    several = read_recordings(tmp_path)
    labels = tmp_path / "labels" / "l.csv"
    labels.parent.mkdir()
    labels.write_text("recording,start,end,label\na.csv,1000.5,1001.75,wave\ns2/a.csv,1002,1004,nod\n")
    pieces = labeled_pieces(several, read_labels(labels))
    assert [(source.path, source.label) for source in pieces.sources] == [("s2/a.csv", "nod")]
    (problem,) = pieces.problems
    assert problem.what.startswith("line 2: expected one recording a.csv, got s1/a.csv, s2/a.csv; write its folder")
    labels.write_text("recording,start,end,label\n/home/anna/s1/a.csv,1000.5,1001.75,wave\n")
    assert [source.path for source in labeled_pieces(several, read_labels(labels)).sources] == ["s1/a.csv"]
    (tmp_path / "a.csv").write_bytes((tmp_path / "s1" / "a.csv").read_bytes())
    pieces = labeled_pieces(read_recordings(tmp_path), read_labels(labels))
    assert [source.path for source in pieces.sources] == ["s1/a.csv"]  # and not the shorter a.csv


@pytest.mark.parametrize(
    ("rows", "labels"),
    [
        (["day1/s.csv wave"], []),
        (["day1/s.csv wave", "day2/s.csv nod"], ["nod"]),
        (["../day1/s.csv wave", "../day2/s.csv nod"], ["nod"]),
        (["{root}/day1/s.csv wave"], []),
        (["{root}/day1/s.csv wave", "{root}/day2/s.csv nod"], ["nod"]),
        (["/moved/day1/s.csv wave", "/moved/day2/s.csv nod"], ["nod"]),
        (["/moved/rest/s.csv wave"], ["wave"]),
        (["C:/moved/s.csv wave"], ["wave"]),
        (["/moved/rest/s.csv wave", "/moved/others/s.csv nod"], []),
    ],
)
@pytest.mark.parametrize("given", ["day2/s.csv", "day2"])
def test_rows_of_another_folder_label_no_recording_of_the_same_file_name(tmp_path, recordings, given, rows, labels):
    for name in ("day1", "day2"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "s.csv").write_bytes((tmp_path / "long.csv").read_bytes())
    lines = [f"1000.5,1001.75,{row.format(root=tmp_path).replace(' ', ',')}" for row in rows]
    (tmp_path / "l.csv").write_text("\n".join(["start,end,recording,label", *lines]))
    read, table = read_recordings(tmp_path / given), read_labels(tmp_path / "l.csv")
    stretches, problems = stretches_of(read, table, tmp_path / "day2")
    assert [stretch.row.label for stretch in stretches] == labels
    assert len(problems) == (len(labels) < len(rows))
    assert all("expected a recording" in problem.what and "correct them" in problem.what for problem in problems)


def test_clocks_count_hours():
    assert [seconds_of(cell) for cell in ("1:02:03.5", "62:03,5", "3.5", "a")] == [3723.5, 3723.5, 3.5, None]


FORMULAS = ["=cmd|'/c calc'!A1", "+1+1", "-wave", "@SUM(A1)", "'=quoted", "''-", "=1,2", "plain", "'plain'", "-"]


@pytest.mark.parametrize("text", FORMULAS)
def test_names_are_no_formulas_in_what_is_written_and_come_back(tmp_path, text):
    written = [Annotation(f"{text}.csv", text, 1.0, 2.0, text, 0.5, 0.5, -1.0)]
    (path,) = write_annotations(tmp_path / "out.csv", written, [tmp_path / "long.csv"])
    cells = [cell for row in csv.reader(path.read_text().splitlines()) for cell in row]
    assert not [cell for cell in cells if cell[:1] in {"=", "+", "-", "@", "\t"}]
    assert "0.5" in cells, "numbers stay numbers"
    (row,) = read_labels(path).rows
    assert (row.recording, row.place, row.label) == (f"{text}.csv", text, None if text == "-" else text)


@pytest.mark.parametrize("name", ["out.csv", "out.json", "out.eaf", "out.txt"])
@pytest.mark.parametrize("symbol", ["wave ", " lead", "none", "NaN", "unknown", "-", "a  b", "tab\there", "n\nx", "=1"])
def test_what_nobody_changed_is_as_annotated_whatever_the_symbols_are_called(tmp_path, recordings, name, symbol):
    """Another boundary is a change of that symbol, and what another symbol was is renamed."""
    notes = [
        Annotation("long.csv", "", 1000 + start, 1000 + end, label, 0.5, 0.5, 1000.0)
        for (start, end, _), label in zip(SPANS, (symbol, None), strict=True)
    ]
    write_annotations(tmp_path / name, notes, [tmp_path / "long.csv"])
    table = read_labels(tmp_path / name)
    same = corrections_of(recordings, table, as_labels(notes))
    assert (same.changes, same.unchanged) == ([], 2)
    earlier = replace(notes[0], start=1000.25)
    (change,) = corrections_of(recordings, table, as_labels([earlier, notes[1]])).changes
    assert (change.kind, change.stretch.row.label) == ("moved", symbol)
    other = replace(notes[0], symbol="other")
    (change,) = corrections_of(recordings, table, as_labels([other, notes[1]])).changes
    assert change.kind in {"renamed", "unnamed"}


def test_a_symbol_that_is_known_may_have_a_name_that_elsewhere_says_nothing(tmp_path):
    (tmp_path / "out.csv").write_text("start,end,symbol,unknown\n0,1,none,false\n1,2,none,true\n2,3,unknown,false\n")
    assert [row.label for row in read_labels(tmp_path / "out.csv").rows] == ["none", None, None]
