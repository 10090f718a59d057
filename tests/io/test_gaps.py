"""Missing values in files that other programs write: filled, cropped, or named with the option that helps."""

import numpy as np
import pytest
from click.testing import CliRunner

from kineme.cli import main
from kineme.errors import DataError, SpecificationError
from kineme.io.reading.merge_files import notes_on_gaps
from kineme.io.reading.recordings import read_recording, read_recordings
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

RATE = 100
MARKERS = ("LASI", "RASI", "LFIN")


def points(n=200, n_markers=3):
    """Markers (T, n, 3) in millimeters that move smoothly."""
    t = np.arange(n) / RATE
    phases = np.arange(3 * n_markers).reshape(n_markers, 3)
    return 500 + 300 * np.sin(2.0 * t[:, None, None] + phases)


def write_c3d(path, x, names=MARKERS, lost=()):
    """Markers in a file by ezc3d; NaN is written as such, and rows of `lost`, (marker, frames), have residual -1."""
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d writes the files")
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    content["parameters"]["POINT"]["LABELS"]["value"] = tuple(f"Ann:{name}" for name in names)
    content["parameters"]["POINT"]["UNITS"]["value"] = ("mm",)
    content["data"]["points"] = np.concatenate((x.transpose(2, 1, 0), np.ones((1, x.shape[1], len(x)))))
    residuals = np.zeros((1, x.shape[1], len(x)))
    for marker, frames in lost:
        residuals[0, marker, frames] = -1
    content["data"]["meta_points"] = {"residuals": residuals, "camera_masks": np.zeros((7, x.shape[1], len(x)), bool)}
    path.parent.mkdir(parents=True, exist_ok=True)
    content.write(str(path))


def table(times, columns, heads):
    rows = ([t, *("" if np.isnan(x) else x for x in row)] for t, row in zip(times, columns, strict=True))
    return ("\n".join([",".join(("time [s]", *heads)), *(",".join(map(str, row)) for row in rows)])).encode()


def read(data, **options):
    return read_recordings_from_bytes(data, "a.csv", Layout(**options))


def test_c3d_files_with_occlusions_are_read_and_what_was_done_is_said_once(tmp_path):
    x = points()
    write_c3d(tmp_path / "wave" / "whole.c3d", x)
    lost = x.copy()
    lost[:30, 0] = np.nan  # before it is first seen
    lost[190:, 1] = np.nan
    write_c3d(tmp_path / "wave" / "gaps.c3d", lost, lost=[(2, slice(100, 115)), (1, slice(60, 64))])
    read = read_recordings(tmp_path)
    complete, gaps = sorted(read.sources, key=lambda source: source.path, reverse=True)
    assert read.problems == ()
    assert (complete.filled, complete.cropped) == (0, 0.0)
    assert (gaps.filled, gaps.longest_gap, gaps.cropped) == (19, pytest.approx(0.16), pytest.approx(0.4))
    movement = read.demonstrations[[source.path for source in read.sources].index(gaps.path)]
    np.testing.assert_allclose(movement.positions, x[30:190].reshape(160, -1), atol=0.5)
    assert notes_on_gaps(read) == [
        "gaps of up to 0.16 s were filled in 1 movement, 19 samples in all; --fill-gaps 0 fills none",
        "1 movement cropped to where all columns have values, by up to 0.4 s, 0.4 s in all",
    ]
    shown = CliRunner().invoke(main, ["inspect", str(tmp_path), "--no-outliers"])
    assert "not read" not in shown.output
    assert shown.output.count("gaps of up to 0.16 s were filled") == 1
    learned = CliRunner().invoke(main, ["learn", str(tmp_path), "--library", str(tmp_path / "library")])
    assert learned.output.count("gaps of up to 0.16 s were filled") == 1


def test_markers_that_are_missing_most_of_the_time_are_named_with_the_option_that_reads_the_files(tmp_path):
    for k in range(3):
        x = points()
        x[40 : 190 - k, 2] = np.nan
        write_c3d(tmp_path / f"{k}.c3d", x)
    with pytest.raises(
        DataError, match=r"found none; 3 could not be read.*3 movements were not read.*LFIN in 3"
    ) as warned:
        read_recordings(tmp_path)
    assert "expected a number in 'LFIN', got nothing in 75 % of the samples, for up to 1.51 s" in str(warned.value)
    assert "--exclude LFIN or --fill-gaps 1.6 or --skip sample" in str(warned.value)
    read = read_recordings(tmp_path, exclude="LFIN")
    assert read.demonstrations.dimensions == ("LASI.x", "LASI.y", "LASI.z", "RASI.x", "RASI.y", "RASI.z")
    assert len(read) == 3
    assert len(read_recordings(tmp_path, fill_gaps=1.6)) == 3


def test_a_crop_that_would_cost_half_of_a_movement_names_the_markers_instead(tmp_path):
    x = points()
    x[:110, 0] = np.nan
    x[195:, 1] = np.nan
    write_c3d(tmp_path / "a.c3d", x)
    with pytest.raises(DataError, match=r"in 'LASI', got nothing in 56 % of the samples; say --exclude LASI or --skip"):
        read_recordings(tmp_path / "a.c3d")
    recordings = read_recordings(tmp_path / "a.c3d", skip="sample")
    assert (recordings.demonstrations.lengths.tolist(), recordings.problems) == ([85], ())
    x = points()
    x[:80, 0] = np.nan
    x[160:, 1] = np.nan  # less than a quarter: cropped
    write_c3d(tmp_path / "a.c3d", x)
    with pytest.raises(DataError, match=r"in 'LASI', got nothing in 50 % of the samples; say --exclude LASI or --skip"):
        read_recordings(tmp_path / "a.c3d")


def test_a_crop_that_begins_within_a_gap_goes_on_to_its_end(tmp_path):
    x = points()
    x[:20, 0] = np.nan
    x[5:45, 1] = np.nan  # too long to be filled, but for what the other marker takes away anyway
    x[150:160, 1] = np.nan
    x[155:, 2] = np.nan
    write_c3d(tmp_path / "a.c3d", x)
    read = read_recordings(tmp_path / "a.c3d")
    np.testing.assert_allclose(read.demonstrations.positions, x_between(points(), 45, 155), atol=0.5)
    assert (read.sources[0].filled, read.sources[0].cropped) == (5, pytest.approx(0.9))


def x_between(x, start, stop):
    return x[start:stop].reshape(stop - start, -1)


def test_markers_that_nobody_named_and_markers_that_were_never_seen_are_left_aside(tmp_path):
    x = points(n_markers=5)
    x[:, 2] = np.nan
    x[50:, 3] = np.nan
    write_c3d(tmp_path / "a.c3d", x, ("LASI", "RASI", "LFIN", "*0", "*12"))
    read = read_recordings(tmp_path)
    assert read.demonstrations.n_dims == 6
    assert {"*0.x", "*12.z", "LFIN.y"} <= {*read.detected[0][0].ignored}
    named = read_recordings(tmp_path, columns=["*12"])
    assert named.demonstrations.dimensions == ("*12.x", "*12.y", "*12.z")
    with pytest.raises(DataError, match="in 'LFIN', got nothing in 100 % of the samples"):
        read_recordings(tmp_path, columns=["LASI", "LFIN"])


def test_patterns_name_columns_and_names_that_are_there_stand_for_themselves():
    t = np.arange(50) / 50
    heads = ("l_x [mm]", "l_y [mm]", "r_x", "l*", "T_out")
    data = table(t, np.column_stack([t * k for k in range(1, 6)]), heads)
    assert read(data, columns="*_x").demonstrations.dimensions == ("l_x [mm]", "r_x")
    assert read(data, columns="l*").demonstrations.dimensions == ("l*",)
    assert read(data, columns="l_?").demonstrations.dimensions == ("l_x [mm]", "l_y [mm]")
    assert read(data, columns="*").demonstrations.n_dims == 5
    assert read(data, columns=["r_x", "*_x"]).demonstrations.dimensions == ("r_x", "l_x [mm]")
    assert read(data, exclude=["?_*", "T*"]).demonstrations.dimensions == ("l*",)
    assert read(data, columns="l_*", exclude="*y").demonstrations.dimensions == ("l_x [mm]",)
    with pytest.raises(DataError, match=r"columns like 'L_\*', got the columns \['time \[s\]', 'l_x"):
        read(data, columns="L_*")
    with pytest.raises(DataError, match=r"expected columns like 'q\*' to exclude, got none but \['T_out'"):
        read(data, exclude=["q*"])


def test_patterns_take_no_times_and_brackets_stand_for_themselves():
    t = np.arange(50) / 50
    data = table(t, np.column_stack([t, t**2, t**3]), ("tx", "q[0]", "q[1]"))
    assert read(data, exclude="t*").demonstrations.dimensions == ("q[0]", "q[1]")
    assert read(data, columns="q[*]").demonstrations.dimensions == ("q[0]", "q[1]")


def test_files_that_are_read_but_for_samples_are_not_listed_as_not_read(tmp_path):
    x = points()
    x[60:100, 1] = np.nan
    write_c3d(tmp_path / "a.c3d", x)
    shown = CliRunner().invoke(main, ["inspect", str(tmp_path), "--skip", "sample"]).output
    assert "not read:" not in shown
    assert "read but for samples:\n  a.c3d: expected a number in 'RASI', got nothing in 20 % of the samples" in shown


def test_a_second_clock_is_excluded():
    t = np.arange(50) / 50
    data = table(t, np.column_stack([t + 3, t**2]), ("timestamp [s]", "x"))
    assert read(data, exclude="timestamp [s]").demonstrations.dimensions == ("x",)


def test_numbers_of_columns_that_are_excluded_count_once_over_all_of_the_file():
    t = np.arange(50) / 50
    data = table(t, np.column_stack([t, t**2, t**3]), ("x", "y", "z"))
    assert read(data, exclude=1).demonstrations.dimensions == ("y", "z")
    assert read(data, exclude="1").demonstrations.dimensions == ("y", "z")


def test_the_shell_takes_names_with_commas_in_quotes(tmp_path):
    t = np.arange(50) / 50
    heads = ("x", '"Joint, 2"', "y")
    (tmp_path / "a.csv").write_bytes(table(t, np.column_stack([t, t, t**2]), heads))
    shown = CliRunner().invoke(main, ["inspect", str(tmp_path / "a.csv"), "--exclude", '"Joint, 2",x', "--json"])
    assert '"columns": ["y"]' in " ".join(shown.output.split()).replace("[ ", "[").replace(" ]", "]")


def with_gap(x, rows):
    lost = np.array(x, dtype=float)
    lost[rows] = np.nan
    return lost


def test_angles_orientations_and_switches_are_filled_as_what_they_are():
    t = np.arange(200) / 100
    yaw = (350 + 20 * t) % 360  # wraps at 0.5 s
    half = np.pi * t / 2
    q = np.column_stack([np.cos(half), 0 * t, 0 * t, np.sin(half)])
    q[51:] *= -1  # the other sign of the same rotation behind the gap
    gripper = (t > 0.5).astype(float)
    gap = slice(45, 55)
    columns = np.column_stack([with_gap(yaw, gap), with_gap(q, gap), with_gap(gripper, gap)])
    recordings = read(table(t, columns, ("yaw [deg]", "q.w", "q.x", "q.y", "q.z", "gripper")))
    filled = recordings.demonstrations.recorded
    np.testing.assert_allclose(filled[:, 0], 350 + 20 * t, atol=1e-9)
    np.testing.assert_allclose(np.abs((filled[:, 1:5] * q).sum(axis=1)), 1.0, atol=1e-9)
    np.testing.assert_array_equal(filled[gap, 5], 0.0)
    np.testing.assert_array_equal(filled[55:, 5], 1.0)


@pytest.mark.parametrize("low", [-180, 0])
def test_an_angle_that_only_its_wraps_tell_stays_one_where_gaps_are_filled(low):
    t = np.arange(400) / 100
    a = 170 + 200 * t
    wrapped = (a - low) % 360 + low
    crossing = int(np.flatnonzero(np.abs(np.diff(wrapped)) > 180)[1])
    for gap in (slice(crossing + 20, crossing + 24), slice(crossing - 1, crossing + 3)):
        demos = read(table(t, np.column_stack([with_gap(wrapped, gap), t]), ("c", "x"))).demonstrations
        assert [(channel.kind, channel.period) for channel in demos.channels] == [("angle", 360.0), ("position", None)]
        np.testing.assert_allclose(demos.recorded[:, 0], a - a[0] + wrapped[0], atol=1e-9)


def test_gaps_are_filled_up_to_the_limit_alone_whatever_the_rate():
    t = np.cumsum(np.r_[0, np.tile([0.01, 0.03], 100)])
    x = np.column_stack([np.sin(3 * t), np.cos(2 * t)])
    for seconds, n in ((0.2, 9), (0.24, 11)):
        lost = x.copy()
        lost[40 : 40 + n, 0] = np.nan
        assert t[40 + n] - t[39] == pytest.approx(seconds)
        filled = read(table(t, lost, ("x", "y")), fill_gaps=seconds)
        np.testing.assert_allclose(filled.demonstrations.positions, x, atol=6e-3)
        with pytest.raises(DataError, match=f"--fill-gaps {seconds:g}"):
            read(table(t, lost, ("x", "y")), fill_gaps=0.97 * seconds)
    with pytest.raises(SpecificationError, match="expected fill_gaps to be a number of at least 0, got -1"):
        read(b"t,x\n", fill_gaps=-1)


def test_one_recording_that_is_read_alone_warns_of_what_was_filled(tmp_path):
    t = np.arange(100) / 100
    (tmp_path / "a.csv").write_bytes(table(t, with_gap(np.column_stack([t, t**2]), (slice(30, 35), 0)), ("x", "y")))
    with pytest.warns(UserWarning, match=r"a.csv: gaps of up to 0.06 s were filled in 1 movement, 5 samples"):
        read_recording(tmp_path / "a.csv")


@pytest.mark.parametrize("suffix", ["npz", "parquet"])
def test_gaps_of_arrays_and_tables_are_filled_alike(tmp_path, suffix):
    t = np.arange(100) / 100
    x = np.column_stack([t, t**2])
    lost = with_gap(x, (slice(30, 35), 1))
    path = tmp_path / f"a.{suffix}"
    if suffix == "npz":
        np.savez(path, times=t, positions=lost)
    else:
        pandas = pytest.importorskip("pandas")
        pytest.importorskip("pyarrow")
        pandas.DataFrame({"time": t, "x": lost[:, 0], "y": lost[:, 1]}).to_parquet(path)
    recordings = read_recordings(path)
    np.testing.assert_allclose(recordings.demonstrations.positions, x, atol=1e-4)
    assert recordings.sources[0].filled == 5


def test_gaps_of_movements_without_stamps_are_filled_by_their_share_of_the_movement():
    x = np.sin(np.arange(101) / 20)
    text = ",".join("?" if 30 <= k < 34 else f"{value:.6f}" for k, value in enumerate(x))
    series = f"@timeStamps false\n@missing true\n@classLabel true a\n@data\n{text}:a\n"
    recordings = read_recordings_from_bytes(series.encode(), "a.ts", Layout())
    np.testing.assert_allclose(recordings.demonstrations.positions[:, 0], x, atol=1e-3)
    assert (recordings.sources[0].filled, recordings.sources[0].longest_gap) == (4, pytest.approx(0.05))
    with pytest.raises(DataError, match=r"for up to 0.05 s; say --fill-gaps 0.05 or"):
        read_recordings_from_bytes(series.encode(), "a.ts", Layout(fill_gaps=0.04))


def test_a_library_takes_its_columns_from_recordings_with_more(tmp_path):
    t = np.arange(120) / 60
    rng = np.random.default_rng(0)
    for label, turn in (("wave", 5.0), ("nod", 2.0)):
        for k in range(3):
            x = np.column_stack([np.sin(turn * t + 0.1 * k), np.cos(turn * t) * (1 + 0.1 * k)])
            path = tmp_path / "learned" / label / f"{k}.csv"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(table(t, x, ("hand.x", "hand.y")))
    library = ["--library", str(tmp_path / "library")]
    assert CliRunner().invoke(main, ["learn", str(tmp_path / "learned"), *library]).exit_code == 0
    x = np.column_stack([rng.normal(size=120), np.cos(5 * t), np.sin(5 * t), rng.normal(size=120)])
    more, fewer = tmp_path / "more.csv", tmp_path / "fewer.csv"
    more.write_bytes(table(t, with_gap(x, (slice(0, 90), 3)), ("battery", "hand.y", "hand.x", "elbow.x")))
    fewer.write_bytes(table(t, x[:, [0, 2, 3]], ("battery", "hand.x", "elbow.x")))
    answer = CliRunner().invoke(main, ["recognize", str(more), *library])
    assert "wave" in answer.output
    said = "Read the columns of the library alone, hand.x, hand.y, without battery, elbow.x; say --columns"
    assert said in answer.output
    lacking = CliRunner().invoke(main, ["recognize", str(fewer), *library])
    assert lacking.exit_code
    assert (
        "expected the columns of the library, got none of ['hand.y'] but ['battery', 'hand.x', 'elbow.x']"
        in lacking.output
    )
