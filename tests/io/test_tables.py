"""Tables of samples by lines: how they may be written, what their columns are, and what is wrong where."""

import io
import json
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme.errors import DataError
from kineme.io.reading.check_block import SENTINELS
from kineme.io.reading.recordings import read_recordings
from kineme.movements.tables.columns import choose_roles, is_time
from kineme.movements.tables.layout import Layout, distinct
from recordings_in_bytes import read_recordings_from_bytes
from soaking import examples

SIX = [(k, 10.0 + k, 20.0 - k * k) for k in range(6)]


def read(text, name="a.csv", **options):
    data = text if isinstance(text, bytes) else text.encode()
    return read_recordings_from_bytes(data, name, Layout(**options))


def lines(rows, head="time,x,y"):
    return "\n".join([head, *(",".join(map(str, row)) for row in rows)]) + "\n"


finite = st.floats(-1e100, 1e100).filter(lambda x: x not in SENTINELS)  # the range of positions
formats = st.sampled_from(["{!r}", "{:.17g}", "{:.17e}", "{:+.17E}", " {!r} ", '"{!r}"'])


@given(
    values=st.lists(st.tuples(finite, finite), min_size=4, max_size=30),
    style=formats,
    separator=st.sampled_from([",", ";", "\t", ", "]),
    comma=st.booleans(),
    end=st.sampled_from(["\n", "\r\n", "\n\n", "\n# between\n"]),
    names=st.booleans(),
)
@settings(max_examples=examples(60, 300))
def test_any_number_in_any_notation_is_read_to_the_last_bit(values, style, separator, comma, end, names):
    if separator == "\t" and style.startswith(" "):
        style = style.strip()
    comma = comma and "," not in separator
    values = [*values, (0.0, 1.0), (1.0, 0.0)]  # an extent in range
    rows = [[style.format(float(k)), *(style.format(value) for value in row)] for k, row in enumerate(values)]
    rows = [[cell.replace(".", ",") if comma else cell for cell in row] for row in rows]
    if names:
        rows = [["demo", "time", "a", "b"]] + [['"one, or two"', *row] for row in rows]
    else:
        rows = [["time", "a", "b"], *rows]
    kinds = {"a": "position", "b": "position"}  # 0, 359, 0 could be an angle
    demos = read(end.join(separator.join(row) for row in rows) + end, units="s", kinds=kinds).demonstrations
    np.testing.assert_array_equal(demos.positions, np.array(values))
    np.testing.assert_array_equal(demos.times, np.arange(len(values)))


@given(
    text=st.text("time,xy;\t 01.5e-+#%\"'\n\r\u00e4nalbeld", max_size=200) | st.text(max_size=80),
    skip=st.sampled_from(["movement", "sample"]),
)
@settings(max_examples=examples(80, 400))
def test_any_text_is_a_table_or_an_error(text, skip):
    try:
        recordings = read(text.encode("utf-8", "replace"), skip=skip)
    except kineme.errors.DataError as error:
        assert "a.csv" in str(error)  # noqa: PT017 - both ends are right
    else:
        assert np.isfinite(recordings.demonstrations.positions).all()
        assert (recordings.demonstrations.lengths >= 4).all()


@pytest.mark.parametrize(
    "write",
    [
        lambda: np.savetxt("x.csv", np.array(SIX), delimiter=",", header="time,x,y"),
        lambda: np.savetxt("x.csv", np.array(SIX), delimiter=",", header="time,x,y", comments=""),
        lambda: np.savetxt("x.csv", np.array(SIX), header="time x y"),
        lambda: np.savetxt("x.csv", np.array(SIX)),
        lambda: np.savetxt("x.csv", np.array(SIX), delimiter="\t", fmt="%.3f"),
    ],
)
def test_what_numpy_writes_is_read(tmp_path, monkeypatch, write):
    monkeypatch.chdir(tmp_path)
    write()
    movement = read_recordings("x.csv").demonstrations[0]
    np.testing.assert_array_equal(np.column_stack((movement.times, movement.positions)), np.array(SIX))


@pytest.mark.parametrize(
    "data",
    [
        lines(SIX, "time,x [µm],y").encode(),
        lines(SIX, "time,x [µm],y").encode("latin-1"),
        lines(SIX, "time,x [µm],y").encode("utf-8-sig"),
        lines(SIX, "time,x [µm],y").encode("utf-16"),
        lines(SIX, "time,x [µm],y").replace("\n", "\r").encode(),
    ],
)
def test_encodings(data):
    recordings = read(data)
    assert recordings.detected[0][0].columns == ("x [µm]", "y")
    np.testing.assert_array_equal(recordings.demonstrations.positions, np.array(SIX)[:, 1:])


@pytest.mark.parametrize(
    ("head", "scale", "units"),
    [
        ("time [ms]", 1e3, ("ms", "head")),
        ("Time (us)", 1e6, ("us", "head")),
        ("t_ns", 1e9, ("ns", "head")),
        ("timeMs", 1e3, ("ms", "head")),
        ("time/ms", 1e3, ("ms", "head")),
        ("seconds", 1, ("s", "head")),
        ("time", 1, ("s", "assumed")),
        ("time", 1e3, ("ms", "by its steps")),
        ("time", 1e6, ("us", "by its steps")),
        ("time", 1e9, ("ns", "by its steps")),
    ],
)
def test_units_of_time_are_told_by_head_or_by_size(head, scale, units):
    times = np.arange(8) / 100
    text = lines([(repr(float(t)), 1, k) for k, t in enumerate(times * scale)], f"{head},x,y")
    recordings = read(text)
    how = recordings.detected[0][0]
    assert (how.units, how.units_from) == units
    np.testing.assert_allclose(recordings.demonstrations.times, times, rtol=1e-15, atol=0)


@pytest.mark.parametrize(("scale", "units"), [(1, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_stamps_since_1970_tell_their_unit_whatever_the_rate(scale, units):
    times = 1.7e9 + np.arange(8) / 4
    recordings = read(lines([(f"{t * scale:.2f}", 1, k) for k, t in enumerate(times)], "stamp,x,y"))
    assert recordings.detected[0][0][4:6] == (units, "since 1970")
    np.testing.assert_allclose(recordings.demonstrations.times, times, rtol=1e-15)


@pytest.mark.parametrize(("head", "step"), [("RelativeTime", 333_333), ("relative_time", 100_000), ("time", 250_000)])
def test_stamps_that_may_be_ticks_of_a_camera_are_refused_until_it_is_said(head, step):
    text = lines([(k * step, 1, k) for k in range(8)], f"{head},x,y")
    with pytest.raises(kineme.errors.DataError, match="say how long one is, as units='us', '100ns'"):
        read(text)
    assert read(text, units="100ns").demonstrations.times[1] == pytest.approx(step * 1e-7)


@pytest.mark.parametrize(("units", "divisor"), [("ms", 1000), ("us", 10**6), (0.5, 2), ("milliseconds", 1000)])
def test_units_that_are_given_win(units, divisor):
    recordings = read(lines(SIX, "time [s],x,y"), units=units)
    assert recordings.detected[0][0][4:6] == (units, "given")
    np.testing.assert_array_equal(recordings.demonstrations.times, np.arange(6) / divisor)


def test_rows_without_stamps_are_a_given_step_apart():
    with pytest.raises(kineme.errors.DataError, match="or the step between samples with units= where there is none"):
        read(lines(SIX, "a,b,c"))
    recordings = read(lines(SIX, "a,b,c"), units=0.02)
    np.testing.assert_allclose(recordings.demonstrations.times, np.arange(6) * 0.02)
    assert recordings.demonstrations.n_dims == 3
    long = read(lines([("p" if k < 4 else "q", *SIX[k % 6]) for k in range(8)], "trial,a,b,c"), units=0.02)
    np.testing.assert_allclose(long.demonstrations.times, np.tile(np.arange(4) * 0.02, 2))


@pytest.mark.parametrize("head", ["t", "T", "Time", "time [s]", "timestamp", "t_ms", "ElapsedTime", "sec", "unix time"])
def test_heads_that_are_time(head):
    assert is_time(head)


@pytest.mark.parametrize("head", ["x", "t0", "tx", "s", "temp", "torque", "time constant", "", "min", "states"])
def test_heads_that_are_not(head):
    assert not is_time(head)


@pytest.mark.parametrize(
    ("heads", "roles"),
    [
        ("time x y", (0, (1, 2), (), None, ())),
        ("x t y", (1, (0, 2), (), None, ())),
        ("id label t x", (2, (3,), (0,), 1, ())),
        ("subject trial gesture stamp q1 q2", (3, (4, 5), (0, 1), 2, ())),
        ("frame time x y v_x v_y a_x a_y", (1, (2, 3), (), None, (0, 4, 5, 6, 7))),
        ("time num_bodies x y", (0, (2, 3), (), None, (1,))),
        ("time observation.state.q1 action", (0, (1, 2), (), None, ())),
        ("Unnamed:_0 time x y vx vy", (1, (2, 3), (), None, (0, 4, 5))),
        ("t x y z az el", (0, (1, 2, 3, 4, 5), (), None, ())),
        ("t x y z az", (0, (1, 2, 3, 4), (), None, ())),
        ("t x y z vx vy vz ax ay az", (0, (1, 2, 3), (), None, (4, 5, 6, 7, 8, 9))),
        ("t z az", (0, (1,), (), None, (2,))),
        ("time v_x v_y", (0, (1, 2), (), None, ())),
        ("class_name movement_id time_ms x", (2, (3,), (1,), 0, ())),
        ("run ep_id clip_number t x", (3, (4,), (0, 1, 2), None, ())),
    ],
)
def test_columns_find_their_roles(heads, roles):
    assert choose_roles(heads.split(), ["number"] * len(heads.split()), Layout()) == (*roles, None, None, (), ())


def test_roles_that_are_given_win():
    text = lines([("n", *row) for row in SIX], "note,clock,x,y")
    recordings = read(text, time="clock", columns=("y", "x"), label="note")
    np.testing.assert_array_equal(recordings.demonstrations.positions, np.array(SIX)[:, [2, 1]])
    assert tuple(recordings.labels) == ("n",)
    by_number = read(text, time=1, columns=(3, "2"), label=0)
    np.testing.assert_array_equal(by_number.demonstrations.positions, recordings.demonstrations.positions)
    assert read(text, time="clock").detected[0][0].ignored == ("note",)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"columns": "z"}, r"expected a column 'z', got the columns \['time', 'x', 'y'\]"),
        ({"time": 7}, r"expected a column 7, got the columns"),
        ({"columns": "time", "time": "time", "label": "q"}, r"expected a column 'q'"),
    ],
)
def test_a_column_that_is_not_there_is_refused_with_those_that_are(options, words):
    with pytest.raises(kineme.errors.DataError, match=words):
        read(lines(SIX), **options)


def test_ambiguous_columns_are_refused():
    with pytest.raises(
        kineme.errors.DataError, match=r"expected one column of times, .*\['time', 'y', 'stamp'\]; say which"
    ):
        read(lines(SIX, "time,y,stamp"))
    with pytest.raises(
        kineme.errors.DataError, match=r"expected one column of labels, got \['label', 'class'\]; say which"
    ):
        read(lines([("a", "b", *row) for row in SIX], "label,class,time,x,y"))


def test_movements_of_a_long_table_may_be_interleaved_and_share_their_number_between_labels():
    rows = [(label, k % 2, t, x, y) for t, x, y in SIX for k, label in enumerate(("wave", "wave", "point", "point"))]
    recordings = read(lines(rows, "label,trial,time,x,y"))
    assert [(source.label, source.place) for source in recordings.sources] == [
        (label, f"{label}/{k}") for label in ("wave", "point") for k in "01"
    ]
    for movement in recordings.demonstrations:
        np.testing.assert_array_equal(np.column_stack((movement.times, movement.positions)), np.array(SIX))


@pytest.mark.parametrize(
    ("head", "values", "noted"),
    [
        ("cycle", "0 1 2", True), ("track_id", "7 8 9", True), ("stroke", "a b c", True), ("gripper", "0 1 2", False),
        ("x", "0 2 3", False), ("cycle", "0 1 0", False), ("phase", "a b a", False),
    ],
)  # fmt: skip
def test_a_column_that_may_count_movements_is_noted(head, values, noted):
    rows = [(k, k**2, values.split()[k // 5]) for k in range(15)]
    for several in (
        read(lines(rows, f"t,p,{head}")),
        read(lines([(*row, row[2]) for row in rows], f"t,p,{head},trial")),
    ):
        assert [note for note in several.notes if "may count" in note] == [
            f"{head} may count movements that are read as one: the value changes after many samples, and never back; "
            "if so, say movement=, in the shell --movement"
        ] * (noted and len(several) == 1)
    assert len(read(lines(rows, f"t,p,{head}"), movement=head)) == len({*values.split()})


@pytest.mark.parametrize(
    ("head", "names", "apart", "noted"),
    [
        ("sensor", ["acc", "gyro"], 9.0, True),
        ("sensor_type", [1, 4], 9.0, True),
        ("kind", ["a", "b", "c"], 9.0, True),
        ("hand", ["left", "right"], 0.0, True),  # named so, though they are as near to each other as to themselves
        ("kind", ["a", "b"], 0.0, False),
        ("gripper", [0, 1], 9.0, False),
    ],
)
@pytest.mark.parametrize("batch", [1, 5])
def test_rows_of_several_things_in_turns_are_noted(head, names, apart, noted, batch):
    turn = [k // batch % len(names) for k in range(60)]
    rows = [(k / 10, names[i], apart * i + np.sin(k / 9), 1.0) for k, i in enumerate(turn)]
    recordings = read(lines(rows, f"t,{head},x,y"))
    if noted and (apart or batch == 1):
        (note,) = recordings.notes
        assert f"which {head} names in turns" in note
        assert "--movement" in note
        recordings = read(lines(rows, f"t,{head},x,y"), movement=head)
    assert "in turns" not in " ".join(recordings.notes)  # gaps between their samples are noted


@pytest.mark.parametrize(
    ("heads", "names", "lengths"),
    [
        ("id,time,x", [(1000 + k,) for k in range(12)], [12]),
        ("trial,id,time,x", [(k // 6, k % 6) for k in range(12)], [6, 6]),
        ("trial,id,time,x", [(k % 2, k // 2) for k in range(12)], None),
        ("action,time,x", [(k / 4,) for k in range(12)], None),
        ("label,time,x", [("ab"[k % 2],) for k in range(12)], None),
    ],
)
def test_an_id_that_is_new_in_each_sample_tells_no_movements_apart(heads, names, lengths):
    text = lines([(*name, k, k * k) for k, name in enumerate(names)], heads)
    if lengths is None:
        with pytest.raises(DataError, match=r"at least 4 samples, got fewer in each, told apart by \[.*--exclude"):
            read(text)
        return
    recordings = read(text)
    assert recordings.demonstrations.lengths.tolist() == lengths
    assert recordings.detected[0][0].ignored == ("id",)


def test_labels_alone_begin_a_movement_where_they_change_or_time_begins_anew():
    rows = [(label, *row) for label in ("wave", "wave", "rest", "wave") for row in SIX]
    rows += [("nod", 100 + row[0], *row[1:]) for row in SIX]
    recordings = read(lines(rows, "label,time,x,y"))
    assert tuple(recordings.labels) == ("wave", "wave", "rest", "wave", "nod")
    assert [source.place for source in recordings.sources] == ["0", "1", "2", "3", "4"]
    assert recordings.demonstrations.lengths.tolist() == [6] * 5


def test_names_are_text_whatever_they_look_like():
    rows = [(name, label, *row) for name, label in (("001", "1e3"), ("1", "nan"), ("a, b; c", "")) for row in SIX]
    text = "\n".join(["id\tlabel\ttime\tx\ty", *("\t".join(map(str, row)) for row in rows)])
    recordings = read(text)
    assert [source.place for source in recordings.sources] == ["001", "1", "a, b; c"]
    assert tuple(recordings.labels) == ("1e3", "nan", None)


FAULTS = [
    ("oops", "expected a number in 'x', got 'oops'"),
    ("NaK", "expected a number in 'x', got 'NaK'"),
    ("1_0", "expected a number in 'x', got '1_0'"),
    ("0x10", "expected a number in 'x', got '0x10'"),
    ("1,2", "expected 4 columns, got 5"),
    ("inf", r"expected finite positions, got [inf, 18.0] at sample 2"),
]
GAP = "expected a number in 'x', got nothing in 17 % of the samples, for up to 2 s; say --exclude x or --fill-gaps 2"


@pytest.mark.parametrize(("cell", "reason"), FAULTS)
@pytest.mark.parametrize("good", [6, 3000])  # the slow reader has more than one stretch of lines
def test_a_bad_cell_costs_its_movement_and_is_found_by_its_line(cell, reason, good):
    rows = [("a", k, 10 + k, 20 - k) for k in range(good)] + [("b", k, 10 + k, 20 - k) for k in range(6)]
    rows[good + 2] = ("b", 2, cell, 18.0)
    recordings = read("# a comment\n\n" + lines(rows, "demo,time,x,y"))
    (problem,) = recordings.problems
    assert (problem.file, problem.line, problem.reason) == ("a.csv", 3 + good + 3, f"movement b: {reason}")
    assert [source.place for source in recordings.sources] == ["a"]
    thinned = read("# a comment\n\n" + lines(rows, "demo,time,x,y"), skip="sample")
    assert thinned.demonstrations.lengths.tolist() == [good, 5]
    assert thinned.problems[0].reason == f"movement b: {reason}; this sample left out"


@pytest.mark.parametrize("gap", ["", "nan", "NA", "null"])
def test_a_column_without_values_at_the_beginning_is_not_taken_for_text(gap):
    rows = [(k / 100, gap if k < 30 else k * k, k) for k in range(100)]
    recordings = read(lines(rows, "time,x,y"))
    assert recordings.demonstrations.dimensions == ("x", "y")
    assert recordings.demonstrations.lengths.tolist() == [70]
    states = [(k / 100, "none" if k < 30 else "moving", k) for k in range(100)]
    assert read(lines(states, "time,state,y")).demonstrations.dimensions == ("y",)


@pytest.mark.parametrize("cell", ["", "nan", "NA", "<NA>", "null", "None"])
@pytest.mark.parametrize("good", [6, 3000])
def test_an_empty_cell_costs_its_movement_where_its_gap_is_too_long_to_be_filled(cell, good):
    rows = [("a", k, 10 + k, 20 - k) for k in range(good)] + [("b", k, 10 + k, 20 - k) for k in range(6)]
    rows[good + 2] = ("b", 2, cell, 18.0)
    text = "# a comment\n\n" + lines(rows, "demo,time,x,y")
    (problem,) = read(text).problems
    assert (problem.line, problem.missing, problem.samples) == (3 + good + 3, ("x",), 0)
    said = f"movement b: {GAP} or --skip sample, in Python exclude= or fill_gaps= or skip="
    assert problem.reason == said
    recordings = read(text, skip="sample")
    assert recordings.demonstrations.lengths.tolist() == [good, 5]
    assert recordings.problems[0].reason.endswith("1 sample like this left out")
    assert (recordings.problems[0].missing, recordings.problems[0].samples) == ((), 1)
    filled = read(text, fill_gaps=2.0)
    np.testing.assert_allclose(filled.demonstrations[1].positions[2], [12, 18])


@pytest.mark.parametrize(
    ("times", "reason", "remaining"),
    [
        ((0, 1, 1, 2, 3, 4), "got duplicate stamps 1 and 1 s at sample 2", [0, 1, 2, 3, 4]),
        (
            (0, 1, 2, 1.5, 1.7, 3),
            "got decreasing stamps 2 and 1.5 s at sample 3; if several movements .*, --movement",
            [0, 1, 1.5, 1.7, 3],
        ),
        ((0, 1, 1000, 2, 3, 4), "got decreasing stamps 1000 and 2 s at sample 3", [0, 1, 2, 3, 4]),
        ((0, 1000, 1001, 2, 3, 4), "got decreasing stamps 1001 and 2 s at sample 3", [0, 2, 3, 4]),
        ((0, 1, "inf", 3, 4, 5), "expected finite times, got inf at sample 2", [0, 1, 3, 4, 5]),
        ((5, 0, 1, 2, 3, 6), "got decreasing stamps 5 and 0 s at sample 1", [0, 1, 2, 3, 6]),
        ((5, 4, 3, 2, 1, 6), "got decreasing stamps 5 and 4 s at sample 1", None),
    ],
)
def test_time_must_go_on(times, reason, remaining):
    text = lines([(t, k, -k) for k, t in enumerate(times)], "time,x,y")
    with pytest.raises(kineme.errors.DataError, match=rf"line [345]: .*{reason}") as refused:
        read(text)
    assert ("leave such samples out with --skip sample" in str(refused.value)) == ("duplicate" in reason)
    if remaining is None:
        with pytest.raises(kineme.errors.DataError, match="expected at least 4 samples, got 2"):
            read(text, skip="sample")
    else:
        recordings = read(text, skip="sample")
        assert recordings.demonstrations.times.tolist() == remaining
        assert re.search(reason, recordings.problems[0].reason)


@pytest.mark.parametrize("text", ["time,x,y,\n" + "".join(f"{k},1,{k},\n" for k in range(5))])
def test_a_separator_at_the_end_of_every_line_is_no_column(text):
    recordings = read(text)
    assert recordings.demonstrations.n_dims == 2
    assert recordings.detected[0][0].ignored == ("",)


def test_many_faults_are_told_once_per_movement():
    rows = [(k, "" if k % 3 == 0 else k, k) for k in range(30)]
    rows[0], rows[3] = (0, 0, 0), (3, "oops", 3)
    with pytest.raises(kineme.errors.DataError, match=r"line 5: expected a number in 'x', got 'oops'"):
        read(lines(rows))
    recordings = read(lines(rows), skip="sample")
    assert recordings.problems[1].reason.endswith("; 8 samples like this left out")
    assert recordings.demonstrations.lengths.tolist() == [21]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected samples, got an empty file"),
        ("# nothing\n\n", "expected samples, got an empty file"),
        ("time,x\n", "expected samples, got none below the heads|at least 4 samples"),
        ("1\n2\n3\n4\n", "at least one of positions, got one column"),
        ("a,b\nc,d\ne,f\n", r"one column of times"),
        ("time,x\n1,a\n2,b\n3,c\n4,d\n", "at least one of positions"),
    ],
)
def test_no_table(text, words):
    with pytest.raises(kineme.errors.DataError, match=words):
        read(text)


def test_missing_numbers_agree_with_an_independent_reader():
    rng = np.random.default_rng(0)
    table = np.round(rng.normal(size=(4000, 3)), 6)
    gone = rng.random(table.shape) < 0.1
    cells = [["" if lost else repr(float(cell)) for cell, lost in zip(row, drop, strict=True)]
             for row, drop in zip(table, gone, strict=True)]  # fmt: skip
    text = "time,x,y,z\n" + "\n".join(f"{k},{','.join(row)}" for k, row in enumerate(cells)) + "\n"
    expected = np.genfromtxt(io.StringIO(text), delimiter=",", skip_header=1)
    expected = expected[np.isfinite(expected).all(axis=1)]
    demos = read(text, skip="sample").demonstrations
    np.testing.assert_array_equal(np.column_stack((demos.times, demos.positions)), expected)


@pytest.mark.parametrize("style", ["{}", "{}Z", "{}+02:00", " {} "])
@pytest.mark.parametrize("between", ["T", " "])
@pytest.mark.parametrize("head", ["time,x,y", "", "Timestamp [ms],x,y"])
def test_dates_are_time_stamps(style, between, head):
    dates = [f"2024-05-06{between}07:08:{9 + k / 4:09.6f}" for k in range(6)]
    rows = [",".join(map(str, (style.format(date), k, -k))) for k, date in enumerate(dates)]
    recordings = read("\n".join([head] * bool(head) + rows))
    np.testing.assert_allclose(np.diff(recordings.demonstrations.times), 0.25, atol=3e-7)
    offset = 7200 if "+" in style else 0
    assert recordings.demonstrations.times[0] == 1714979289 - offset
    assert recordings.detected[0][0][4:6] == ("s", "dates")
    assert recordings.demonstrations.n_dims == 2


def test_minutes_and_seconds_with_a_fraction_are_times_and_without_one_may_be_hours():
    rows = [(f"01:{k / 4:06.3f}", k, -k) for k in range(6)]
    assert read(lines(rows)).demonstrations[0].times.tolist() == [60 + k / 4 for k in range(6)]
    with pytest.raises(DataError, match="'01:00'"):
        read(lines([(row[0][:5], *row[1:]) for row in rows]))


def test_a_cell_that_is_no_date_is_found_by_its_line():
    rows = [(f"2024-05-06 07:{8 + k // 60:02}:{k % 60:02}", k) for k in range(40)]
    rows[30] = ("yesterday", 30)
    with pytest.raises(kineme.errors.DataError, match="line 32: expected a date in 'time', got 'yesterday'"):
        read(lines(rows, "time,x"))
    assert read(lines(rows, "time,x"), skip="sample").demonstrations.lengths.tolist() == [39]


def test_decimal_commas_between_blanks():
    demos = read("0,0 1,5\n0,1 2,5\n0,2 3,5\n0,3 4,5\n").demonstrations
    np.testing.assert_array_equal(
        np.column_stack((demos.times, demos.positions)), [[0, 1.5], [0.1, 2.5], [0.2, 3.5], [0.3, 4.5]]
    )
    named = read("t x\n0,0 1,5\n0,1 2,5\n0,2 3,5\n0,3 4,5\n").demonstrations
    np.testing.assert_array_equal(named.positions, demos.positions)


@pytest.mark.parametrize("mark", [".", ","])
def test_marks_between_thousands_are_no_decimal_marks(mark):
    x = np.linspace(900, 1200, 40).round()
    grouped = [f"{number:,.0f}".replace(",", mark) for number in x]
    text = "t;x\n" + "\n".join(f"{k};{cell}" for k, cell in enumerate(grouped))
    with pytest.raises(
        kineme.errors.DataError, match=rf"'x' without marks between thousands, got '1\{mark}0.*' beside '900'"
    ):
        read(text)
    shortest = [f"{number:g}".replace(".", mark) for number in (x / 1000).round(3)]  # 0.9, 1, 1.008: decimals
    text = "t;x\n" + "\n".join(f"{k};{cell}" for k, cell in enumerate(shortest))
    np.testing.assert_allclose(read(text).demonstrations[0].positions[:, 0], (x / 1000).round(3))


@pytest.mark.parametrize(
    ("separator", "cells", "got"),
    [
        (",", ["0.5", '"1,{}.25"', "7.25"], "'1,000.25'"),
        (",", ["0.5", '"1,{}"', "7.25"], "'1,000'"),
        (",", ["0.5", "1'{}.25", "7.25"], '"1\'000.25"'),
        (",", ["0.5", "1_{}.25", "7.25"], "'1_000.25'"),
        (";", ["0.5", "1,{}.25", "7.25"], "'1,000.25'"),
        (";", ["0,5", "1.{},25", "7,25"], "'1.000,25'"),
        (";", ["0,5", "1 {},25", "7,25"], "'1 000,25'"),
        (";", ["0,5", "1\u202f{},25", "7,25"], r"'1\\u202f000,25'"),
        (";", ["0,5", "1.{}", "7,25"], "'1.000' beside"),
        ("\t", ["0.5", "1,{}", "7.25"], "'1,000' beside"),
        (";", ["0.5", "1,000,{}", "7.25"], "'1,000,000'"),
    ],
)
def test_columns_of_thousands_alone_are_refused_and_never_left_aside(separator, cells, got):
    """The other column could be read alone: nothing would say that x was lost."""
    rows = [
        separator.join([f"{k}{cells[0][1:]}", cells[1].format(f"{k * 37:03d}"), f"{k}{cells[2][1:]}"])
        for k in range(20)
    ]
    text = "\n".join([separator.join(["t", "x", "y"]), *rows])
    with pytest.raises(kineme.errors.DataError, match=rf"'x'.* without marks between thousands, got {got}"):
        read(text)
    assert read(text, exclude="x").demonstrations.dimensions == ("y",)
    with pytest.raises(kineme.errors.DataError, match=rf"'x'.* without marks between thousands, got {got}"):
        read(text, exclude="y")


@pytest.mark.parametrize("names", [["scorer", "bodyparts", "coords"], [None, None]])
def test_several_lines_of_heads_are_one(tmp_path, names):
    """As pandas writes columns of several levels, and DeepLabCut the points of a body."""
    points = [("net", point, coord) for point in ("nose", "paw") for coord in ("x", "y", "likelihood")]
    columns = pd.MultiIndex.from_tuples([each[-len(names) :] for each in points], names=names)
    frame = pd.DataFrame(np.arange(60.0).reshape(10, 6) ** 2, columns=columns)
    frame.index.name = None if names[0] else "time"
    frame.to_csv(tmp_path / "a.csv")
    demos = read_recordings(tmp_path / "a.csv", units=0.1).demonstrations
    assert demos.dimensions == ("nose.x", "nose.y", "paw.x", "paw.y")
    np.testing.assert_array_equal(demos[0].positions, frame.to_numpy()[:, [0, 1, 3, 4]])


@pytest.mark.parametrize(
    ("heads", "names", "unit"),
    [
        ("Time,Hand,,,\n,x,y,z,", ["Hand.x", "Hand.y", "Hand.z"], None),
        ("Time,Hand,Hand,Hand,\n,x,y,z,\ns,m,m,m,", ["Hand.x", "Hand.y", "Hand.z"], "m"),
        (",Hand,,,\nTime,x,y,z,\ns,mm,mm,mm,", ["Hand.x", "Hand.y", "Hand.z"], "mm"),
        ("Time,left,,right,\n,Hand,,,\n,x,y,z,", ["left.Hand.x", "left.Hand.y", "right.z"], None),
    ],
)
def test_a_head_stands_also_above_the_empty_cells_to_its_right(heads, names, unit):
    recordings = read("\n".join([heads, *(f"{k / 10},{k},{k * k},{k % 3}," for k in range(8))]))
    assert recordings.detected[0][0].columns == tuple(names)
    assert recordings.detected[0][0].measured_in == ((unit,) * 3 if unit else ())


def test_times_that_are_not_understood_are_shown():
    for stamp in ("01/05/2024 10:00:0{}", "5/1/2024 11:59:5{} PM", "10:00:01:00{}"):
        with pytest.raises(
            kineme.errors.DataError, match=r"times such as 2024-05-06T07:08:09.25 .* in 'timestamp', got '.*0.*'"
        ):
            read(lines([(stamp.format(k), k, k * k) for k in range(8)], "timestamp,x,y"))


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_lines_above_the_heads_are_passed_over(mark):
    rows = "\n".join(mark.join((str(k / 10), str(k * k), "1.5")) for k in range(9))
    said = {"sep=;": mark == ";", f"Device{mark}A12\nRate{mark}60": True, "Made by me on May 3": True, "ok\n\n\n": True}
    for above in (key for key, applies in said.items() if applies):
        recordings = read(f"{above}\ntime{mark}x{mark}y\n{rows}")
        assert recordings.demonstrations.dimensions == ("x", "y"), above
        np.testing.assert_array_equal(recordings.demonstrations[0].positions[:, 0], np.arange(9.0) ** 2)
    for above in (mark.join("12"), mark.join(("time", "x"))):  # another table, or heads that lack one
        with pytest.raises(kineme.errors.DataError):
            read(f"{above}\n{rows}")


def test_a_first_column_without_a_head_that_does_not_increase_is_no_time():
    x = np.sin(np.arange(20))
    oscillates = [(a, k / 7, k) for k, a in enumerate(x)]
    with pytest.raises(kineme.errors.DataError, match=r"numbers that do not increase; say which has them .* --units"):
        read(lines(oscillates, "").strip())
    for choice, columns in ({}, ["column 0", "column 1", "column 2"]), ({"columns": [1, 2]}, ["column 1", "column 2"]):
        recordings = read(lines(oscillates, "").strip(), units=0.5, **choice)
        assert recordings.detected[0][0].columns == tuple(columns)
        np.testing.assert_array_equal(recordings.demonstrations.times, np.arange(20) / 2)
    increases = [(k / 7, a, k) for k, a in enumerate(x)]
    with pytest.raises(kineme.errors.DataError, match="say time=0 if they are times, else columns= with 0 among them"):
        read(lines(increases, "").strip(), units=0.5)
    for choice, n_dims, end in ({"time": 0}, 2, 19 / 14), ({"columns": [0, 1, 2]}, 3, 9.5), ({"exclude": 0}, 2, 9.5):
        demos = read(lines(increases, "").strip(), units=0.5, **choice).demonstrations
        assert (demos.n_dims, demos.times[-1]) == (n_dims, pytest.approx(end))
    counted = read(lines([(k, a) for k, a in enumerate(x)], "").strip(), units=0.5).demonstrations  # as frames
    assert (counted.n_dims, counted.times[-1]) == (1, 9.5)


def test_a_line_that_numbers_the_columns_is_no_sample():
    rows = [(k / 10, 1.5 * k, k) for k in range(5)]
    np.testing.assert_array_equal(read(lines(rows, "0,1,2")).demonstrations.times, np.arange(5) / 10)
    integers = [(k, k + 1, k + 2) for k in range(5)]
    assert read("\n".join(",".join(map(str, row)) for row in integers)).demonstrations.lengths.tolist() == [5]


def test_columns_of_one_name_are_numbered_as_pandas_does_and_not_chosen_by_it():
    rows = "\n".join(f"{k},{k * k},{k + 1},{k - 1}" for k in range(5))
    data = f"t,x,y,x\n{rows}\n".encode()
    read = read_recordings_from_bytes(data, "a.csv", Layout())
    assert read.demonstrations.dimensions == ("x", "y", "x.1")
    np.testing.assert_array_equal(read.demonstrations.positions[:, 2], np.arange(5) - 1)
    with pytest.raises(
        kineme.errors.DataError, match=r"expected one column 'x', got the columns \[1, 3\] of that name; say"
    ):
        read_recordings_from_bytes(data, "a.csv", Layout(columns=["x"]))
    chosen = read_recordings_from_bytes(data, "a.csv", Layout(columns=[3, 2]))
    assert chosen.demonstrations.dimensions == ("x", "y")


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["x", "x", "x"], ("x", "x.1", "x.2")),
        (["x", "x.1", "x"], ("x", "x.1", "x.2")),
        (["x", "x", "x.1", "x.1"], ("x", "x.2", "x.1", "x.1.1")),
        ([], ()),
    ],
)
def test_numbered_names_are_all_different(names, expected):
    assert distinct(names) == expected


@pytest.mark.parametrize("label", ["%d", "//x", "#hash", "% 3 times"])
@pytest.mark.parametrize("head", ["label", "trial", "subject"])
def test_names_like_comments_beside_numbers_are_names_and_rows_commented_out_are_none(label, head):
    rows = [(name, *row) for name in ("1", "2", label) for row in SIX]
    recordings = read(lines([*rows, ("#1", 9, 9, 9), ("# 2", 9, 9, 9)], f"{head},time,x,y"))
    names = [source.label if head == "label" else source.place for source in recordings.sources]
    assert names == (["1", "2", label] if head != "subject" else names)
    assert (len(recordings), recordings.problems) == (3, ())
    assert recordings.demonstrations.lengths.tolist() == [6, 6, 6]


LONG = 2**53 + 1


@pytest.mark.parametrize("integer", [LONG, -LONG, 10**30 + 1])
def test_integers_that_floats_would_round_are_refused(tmp_path, integer):
    rows = [(k, k, integer + k) for k in range(6)]
    with pytest.raises(
        kineme.errors.DataError, match=rf"expected a number in 'x' that a float can hold, got {integer}, which"
    ):
        read(lines(rows, "time,y,x"))
    assert len(read(lines([(k, k, float(integer) + k * 1e20) for k in range(6)], "time,y,x"))) == 1
    if abs(integer) > 2**60:
        return
    refused = rf"that floats can hold, got {integer}"
    frame = pd.DataFrame(rows, columns=["time", "y", "x"])
    with pytest.raises(kineme.errors.KinemeError, match=refused):
        kineme.Demonstrations.of(frame)
    with pytest.raises(kineme.errors.KinemeError, match=refused):
        kineme.Demonstrations.from_arrays(frame[["y", "x"]].to_numpy()[None])
    with pytest.raises(kineme.errors.KinemeError, match=refused):
        kineme.Trajectory(np.arange(6.0), frame[["y", "x"]].to_numpy())
    np.savez(tmp_path / "a.npz", times=np.arange(6), positions=frame[["y", "x"]].to_numpy())
    frame.to_parquet(tmp_path / "a.parquet")
    (tmp_path / "a.json").write_text(json.dumps(frame.to_dict("list")))
    for ending in ("npz", "parquet", "json"):
        with pytest.raises(kineme.errors.KinemeError, match=refused):
            kineme.read_recordings(tmp_path / f"a.{ending}")


def test_stamps_of_nanoseconds_may_be_rounded(tmp_path):
    stamps = 1_700_000_000_123_456_789 + 10_000_000 * np.arange(6)
    frame = pd.DataFrame({"time": stamps, "x": np.arange(6.0) ** 2, "y": 1.0})
    frame.to_csv(tmp_path / "a.csv", index=False)
    frame.to_parquet(tmp_path / "a.parquet")
    np.savez(tmp_path / "a.npz", times=stamps, positions=frame[["x", "y"]].to_numpy())
    (tmp_path / "a.json").write_text(json.dumps(frame.to_dict("list")))
    for ending in ("csv", "parquet", "npz", "json"):
        times = kineme.read_recordings(tmp_path / f"a.{ending}").demonstrations.times
        np.testing.assert_allclose(np.diff(times), 0.01, atol=1e-6)


@pytest.mark.parametrize("ending", [".xlsx", ".XLS", ".ods"])
def test_spreadsheets_are_to_be_saved_as_text(tmp_path, ending):
    (tmp_path / f"a{ending}").write_bytes(b"PK")
    with pytest.raises(kineme.errors.DataError, match=rf"the spreadsheet a{ending}; save its sheet as \.csv"):
        read_recordings(tmp_path / f"a{ending}")


@pytest.mark.parametrize("true", ["true", "True", "TRUE"])
def test_true_and_false_are_one_and_zero(true, tmp_path):
    """A gripper is a channel in text, Parquet and data frames, another flag is none; a word is a fault of its row."""
    frame = pd.DataFrame({"t": np.arange(30) / 10, "x": np.arange(30.0) ** 2, "gripper": np.arange(30) // 9 % 2 > 0})
    beside = frame.assign(valid=frame.gripper)
    beside.to_parquet(tmp_path / "b.parquet")
    text = beside.to_csv(index=False)
    assert read(text).demonstrations.recorded.shape == (30, 2)
    assert read_recordings(tmp_path / "b.parquet").demonstrations.recorded.shape == (30, 2)
    assert kineme.Demonstrations.of(beside).recorded.shape == (30, 2)
    assert read(text, columns=["x", "valid"]).demonstrations.recorded[:, 1].tolist() == frame.gripper.tolist()
    frame.to_parquet(tmp_path / "a.parquet")
    for demos in (kineme.Demonstrations.of(frame), read_recordings(tmp_path / "a.parquet").demonstrations):
        np.testing.assert_array_equal(demos.recorded[:, 1], frame.gripper)
    rows = [f"{t},{x},{true if g else 'false'}" for t, x, g in frame.itertuples(index=False)]
    demos = read("\n".join(["t,x,gripper", *rows])).demonstrations
    np.testing.assert_array_equal(demos.recorded[:, 1], frame.gripper)
    assert [channel.kind for channel in demos.channels] == ["position", "discrete"]
    with pytest.raises(kineme.errors.DataError, match="line 31: expected true or false in 'gripper', got 'open'"):
        read("\n".join(["t,x,gripper", *rows[:-1], "2.9,1,open"]))


@pytest.mark.parametrize("unit", [" mm", "%", "deg"])
def test_numbers_with_their_units_are_refused_unless_their_column_is_left_aside(unit):
    """Half of the movement would be lost; a column of a label may hold them."""
    rows = [(k / 10, f"{k}.5{unit}", k * k) for k in range(6)]
    with pytest.raises(kineme.errors.DataError, match=f"expected numbers in 'x' without their unit.* got '0.5{unit}'"):
        read(lines(rows))
    assert read(lines(rows), exclude="x").demonstrations.dimensions == ("y",)
    assert read(lines([(t, "0.5 mm", y) for t, _, y in rows], "t,label,y")).labels.tolist() == ["0.5 mm"]


def test_texts_that_begin_with_a_number_without_a_unit_are_left_aside():
    assert read(lines([(k / 10, f"{k} left", k * k) for k in range(6)])).demonstrations.dimensions == ("y",)


@pytest.mark.parametrize("mark", ["D", "d"])
def test_exponents_of_double_precision_are_read(mark):
    rows = [(k / 10, f"{k * k + 0.5:.3e}".replace("e", mark), k) for k in range(6)]
    np.testing.assert_array_equal(read(lines(rows)).demonstrations.positions[:, 0], [k * k + 0.5 for k in range(6)])
