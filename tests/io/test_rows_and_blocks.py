"""Movements as lines of a text, as series of an archive, and as blocks of so many samples."""

import numpy as np
import pytest

import kineme
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

RANDOM = np.random.default_rng(3)
POINTS = RANDOM.normal(size=(6, 16, 2)).round(6)


def read(text, name="a.csv", **options):
    data = text if isinstance(text, bytes) else text.encode()
    return read_recordings_from_bytes(data, name, Layout(**options))


def lines(values, labels=None):
    rows = [list(map(repr, movement.ravel().tolist())) for movement in values]
    return "\n".join(",".join([str(labels[k]), *row] if labels else row) for k, row in enumerate(rows))


def positions(demos):
    return [movement.positions for movement in demos]


def test_a_history_of_points_is_a_movement_in_each_line():
    recordings = read(lines(POINTS, [0, 0, 1, 1, 2, 2]), rows=True, columns=("x", "y"), units=1 / 30)
    np.testing.assert_array_equal(np.array(positions(recordings)), POINTS)
    assert recordings.labels.tolist() == ["0", "0", "1", "1", "2", "2"]
    assert recordings.sources[4].place == "line 5"
    np.testing.assert_allclose(recordings.demonstrations.durations, 15 / 30)
    assert recordings.detected[0][0].label == ("column 0",)
    assert read(lines(POINTS), rows=True, columns=("x", "y")).labels.tolist() == [None] * 6


def test_heads_say_the_coordinates_and_the_label():
    heads = ",".join(["gesture", *(f"{axis}{k}" for k in range(16) for axis in "xy")])
    recordings = read(f"{heads}\n{lines(POINTS, [7] * 6)}", rows=True)
    assert recordings.demonstrations.dimensions == ("x", "y")
    assert recordings.labels.tolist() == ["7"] * 6
    np.testing.assert_array_equal(np.array(positions(recordings)), POINTS)


def test_words_are_labels_wherever_they_stand_and_a_given_column_wins():
    last = "\n".join(f"{row},wave" for row in lines(POINTS).split("\n"))
    for label in (None, 32, "32"):
        assert read(last, rows=True, columns="x", label=label).labels.tolist() == ["wave"] * 6
    assert read(lines(POINTS, ["nod"] * 6), rows=True, columns="x").demonstrations.lengths.tolist() == [32] * 6


def test_one_coordinate_has_a_label_where_whole_numbers_stand_beside_fractions():
    recordings = read(lines(POINTS, [1, 2] * 3).replace(",", "\t"), "a.tsv", rows=True, columns="x")
    assert recordings.labels.tolist() == ["1", "2"] * 3
    assert recordings.demonstrations.lengths.tolist() == [32] * 6
    assert read(lines(POINTS), rows=True, columns="x").labels.tolist() == [None] * 6
    assert read(lines(POINTS, ["1.0000000e+00", "2."] * 3), rows=True, columns="x").labels.tolist() == ["1", "2"] * 3
    begins_at_0 = read(lines(POINTS, ["0.000"] * 6), rows=True, columns="x")
    assert (begins_at_0.labels.tolist(), begins_at_0.demonstrations.lengths.tolist()) == ([None] * 6, [33] * 6)


def test_a_class_at_the_end_of_lines_is_no_coordinate():
    recordings = read(
        "\n".join(f"{row},{k % 3}" for k, row in enumerate(lines(POINTS).split("\n"))), rows=True, columns=("x", "y")
    )
    np.testing.assert_array_equal(np.array(positions(recordings)), POINTS)
    assert recordings.labels.tolist() == ["0", "1", "2"] * 2
    with pytest.raises(kineme.errors.DataError, match=r"got fractions in both; say which with label=.*--label-column"):
        read("\n".join(f"{row},0.5" for row in lines(POINTS).split("\n")), rows=True, columns=("x", "y"))


def test_lines_may_differ_in_length_and_be_padded():
    text = "a,1,2,3,4,5,6,7,9,,\nb,1,2,3,5,6,7,7,8,9,NaN,,\nc,1,2,3,4,6,7,8,9,10,12\n"
    recordings = read(text, rows=True, columns=("x", "y"))
    assert recordings.demonstrations.lengths.tolist() == [4, 5]
    assert recordings.labels.tolist() == ["a", "c"]
    assert [problem.reason for problem in recordings.problems] == [
        "line 2: expected samples of 2 coordinates, got 9 numbers"
    ]


def test_what_rows_leave_open_is_said():
    with pytest.raises(kineme.errors.DataError, match=r"say columns=.*in the shell --columns x,y"):
        read(lines(POINTS, [0] * 6), rows=True)
    with pytest.raises(kineme.errors.SpecificationError, match="expected rows without every"):
        Layout(rows=True, every=5)
    with pytest.raises(kineme.errors.DataError, match="expected text, of which each line is a movement"):
        read(b"PK", "a.npz", rows=True)
    recordings = read(lines(POINTS, [0] * 6) + "\n0,oops,1,2,3,4,5,6,7\n", rows=True, columns=("x", "y"))
    assert [problem.reason for problem in recordings.problems] == ["line 7: expected numbers, got 'oops'"]


SERIES = "# an archive\n@problemName Demo\n@timeStamps {timed}\n@univariate false\n@classLabel true wave nod\n@data\n"


def test_series_of_an_archive_have_a_column_between_colons_and_the_class_last():
    text = SERIES.format(timed="false") + "1,2,3,4.5:0,1,0,2:wave\n1,2,?,4,5:0,1,?,1,7:nod\n1,2,4,4,?:0,1,1,3,?:wave\n"
    recordings = read(text, "demo_TRAIN.ts", skip="sample", fill_gaps=0)
    assert recordings.labels.tolist() == ["wave", "nod", "wave"]
    assert recordings.demonstrations.lengths.tolist() == [4, 4, 4]
    np.testing.assert_array_equal(positions(recordings)[0], [[1, 0], [2, 1], [3, 0], [4.5, 2]])
    assert any("no times" in how.units_from for how, _ in recordings.detected)
    assert read(text, "a.ts", units=0.1, skip="sample", fill_gaps=0).demonstrations.durations[0] == pytest.approx(0.3)


def test_series_with_times_have_them():
    text = SERIES.format(timed="true") + "(0,1),(0.5,2),(0.75,3),(1,5):(0,1),(0.5,1),(0.75,2),(1,2):wave\n"
    (movement,) = read(text, "a.ts")
    np.testing.assert_array_equal(movement.times, [0, 0.5, 0.75, 1])
    np.testing.assert_array_equal(movement.positions[:, 1], [1, 1, 2, 2])
    dated = ",".join(f"(2007-01-01 00:0{k}:30,{k * k})" for k in range(4))
    (movement,) = read(SERIES.format(timed="true") + f"{dated}:{dated}:nod\n", "a.ts")
    np.testing.assert_array_equal(movement.times - movement.times[0], [0, 60, 120, 180])
    assert (movement.positions.shape, movement.label) == ((4, 2), "nod")
    odd = text + "(0,1),(0.5,2),(0.75,3),(1,5):(0,1),(0.6,1),(0.75,2),(1,2):wave\n"
    assert "line 8: expected columns at the same times" in read(odd, "a.ts").problems[0].reason


def test_values_to_predict_are_no_labels_and_other_ts_files_are_named():
    text = "@targetlabel true\n@timestamps false\n@data\n1,2,3,4:0.25\n1,2,3,9:0.5\n"
    assert read(text, "a.ts").labels.tolist() == [None, None]
    for other in ("export const x = 1;", "", "@data\n", "@classLabel true\n@data\n:wave\n"):
        with pytest.raises(kineme.errors.DataError, match=r"a\.ts: expected"):
            read(other, "a.ts")


def logged(n, label=None):
    head = "aX,aY,aZ" + (",label" if label else "")
    rows = [f"{100 * k},{k * k},{50 - k}" + (f",{label(k)}" if label else "") for k in range(n)]
    return "\n".join([head, *rows])


def test_blocks_of_samples_are_movements():
    recordings = read(logged(12 * 5), every=12, units=0.01)
    assert recordings.demonstrations.lengths.tolist() == [12] * 5
    assert [source.place for source in recordings.sources] == ["0", "1", "2", "3", "4"]
    np.testing.assert_allclose(recordings.demonstrations.durations, 0.11)
    np.testing.assert_array_equal(positions(recordings)[2][:, 0], [100 * k for k in range(24, 36)])
    assert "blocks of 12 samples" in recordings.detected[0][0].layout


def test_blocks_keep_the_labels_and_begin_where_labels_change():
    recordings = read(logged(48, lambda k: "punch" if k < 36 else "flex"), every=12, units=0.01)
    assert recordings.labels.tolist() == ["punch", "punch", "punch", "flex"]
    assert [source.place for source in recordings.sources] == ["0/0", "0/1", "0/2", "1/0"]
    people = read(
        logged(48, lambda k: "ann" if k < 12 else "bob").replace("label", "who"), every=12, units=0.01, person="who"
    )
    assert people.people == ["ann", "bob", "bob", "bob"]
    with pytest.raises(
        kineme.errors.DataError, match="expected blocks of 12 samples, got 35 samples in movement 0: 2 blocks"
    ):
        read(logged(48, lambda k: "punch" if k < 35 else "flex"), every=12, units=0.01)


def test_blocks_of_any_format_and_a_rest_that_is_no_block_is_refused(tmp_path):
    np.savez(tmp_path / "a.npz", positions=RANDOM.normal(size=(40, 3)), times=np.tile(np.arange(10) / 10, 4))
    recordings = kineme.read_recordings(tmp_path / "a.npz", every=10)
    assert recordings.demonstrations.lengths.tolist() == [10] * 4
    np.testing.assert_array_equal(recordings[3].times, np.arange(10) / 10)
    with pytest.raises(
        kineme.errors.DataError, match="expected blocks of 9 samples, got 40 samples: 4 blocks and 4 more"
    ):
        kineme.read_recordings(tmp_path / "a.npz", every=9)
    with pytest.raises(kineme.errors.SpecificationError, match="expected every to be"):
        Layout(every=3)


def test_a_line_may_have_more_columns_than_samples():
    text = SERIES.format(timed="false") + ":".join(f"{k},1,{k},2" for k in range(7)) + ":wave\n"
    assert read(text, "a.ts").demonstrations.n_dims == 7


def test_a_log_without_heads_and_times_has_no_time_where_all_columns_are_chosen():
    log = "\n".join(f"{k},{100 - k * k},{k % 5}" for k in range(24))
    recordings = read(log, every=12, units=0.01, columns=(0, 1, 2))
    assert (recordings.demonstrations.n_dims, recordings.detected[0][0].time) == (3, None)
    np.testing.assert_allclose(recordings.demonstrations.durations, 0.11)
    with pytest.raises(kineme.errors.DataError, match="expected a column of times"):
        read(log, every=12, columns=(0, 1, 2))


def test_empty_lines_between_samples_without_times_part_movements():
    blocks = ["\n".join(f"{k},{k * k}" for k in range(n)) for n in (9, 9, 9, 7)]
    with pytest.raises(
        kineme.errors.DataError, match=r"got 3 blocks of 9 to 9 samples .* say every=9, in the shell --every 9"
    ):
        read("x,y\n" + "\n\n".join(blocks[:3]), units=0.1)
    assert len(read("x,y\n" + "\n\n".join(blocks[:3]), units=0.1, every=9)) == 3
    with pytest.raises(
        kineme.errors.DataError, match=r"got 4 blocks of 7 to 9 samples .* save each in a file of its own"
    ):
        read("x,y\n" + "\n \n".join(blocks), units=0.1)
    assert len(read("x,y\n\n" + blocks[0].replace("\n", "\n\n") + "\n\n", units=0.1)) == 1
