"""Time stamps as messages of ROS carry them: in a header, in seconds and nanoseconds apart, under %time."""

import json

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.io.reading.recordings import read_recording, read_recordings
from kineme.movements.tables.columns import is_time
from kineme.movements.tables.time_stamps import (
    is_date,
    nanoseconds,
    same_clock,
    seconds_of_dates,
    unit_by_size,
    unit_in_head,
)

STAMPS = [1_700_000_000 + k // 2 for k in range(20)], [500_000_000 * (k % 2) for k in range(20)]


@pytest.mark.parametrize(
    ("heads", "time"),
    [
        ("header.stamp.sec,header.stamp.nanosec,x,y", "header.stamp.sec + header.stamp.nanosec"),
        ("/pose/header/stamp/sec,/pose/header/stamp/nanosec,x,y", None),
        ("header_stamp_secs,header_stamp_nsecs,x,y", None),
        ("secs,nsecs,x,y", None),
        ("timestamp_sec,timestamp_nanosec,x,y", None),
    ],
)
@pytest.mark.parametrize("ending", [".csv", "frame", ".parquet", ".json"])
def test_seconds_and_nanoseconds_beside_them_are_one_time(tmp_path, heads, time, ending):
    rows = zip(*STAMPS, range(20), range(20), strict=True)
    frame = pd.DataFrame(list(rows), columns=heads.split(","))
    if ending == "frame":
        demos = kineme.Demonstrations.of(frame)
    else:
        path = tmp_path / f"a{ending}"
        if ending == ".csv":
            frame.to_csv(path, index=False)
        elif ending == ".parquet":
            pytest.importorskip("pyarrow")
            frame.to_parquet(path)
        else:
            path.write_text(json.dumps(frame.to_dict("list")))
        read = kineme.read_recordings(path)
        demos = read.demonstrations
        assert time is None or read.detected[0][0].time == time
    assert demos.dimensions == ("x", "y")
    np.testing.assert_allclose(np.diff(demos[0].times), 0.5, atol=1e-6)


def test_a_stamp_in_a_header_is_the_time_if_no_other_column_is(tmp_path):
    rows = [f"{1_700_000_000 + k / 100},{k / 100},{k},{k * k}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([".header.stamp,.header.seq,x,y", *rows]))
    (tmp_path / "b.csv").write_text("\n".join(["header.stamp,t,x,y", *rows]))
    a, b = (kineme.read_recordings(tmp_path / f"{name}.csv") for name in "ab")
    assert (a.detected[0][0].time, b.detected[0][0].time) == (".header.stamp", "t")
    assert a.demonstrations.dimensions == b.demonstrations.dimensions == ("x", "y")


def test_columns_of_one_clock_are_one_time_in_the_unit_that_one_of_them_says(tmp_path):
    """As loggers of phones write it: time in nanoseconds since 1970, and the seconds that elapsed."""
    start = 1_700_000_000_000_000_000
    rows = [f"{start + 10_000_000 * k},{k / 100 + 0.001 * (k % 2)},{k},{k * k}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join(["time,seconds_elapsed,x,y", *rows]))
    boot = [f"{1_200_000_000 + 1000 * k},{k / 1000},{k},{k * k}" for k in range(20)]
    (tmp_path / "b.csv").write_text("\n".join(["time,seconds_elapsed,x,y", *boot]))
    dated = [f"2026-01-02T03:04:05.{10 * k:03d}Z,{k / 100},{k},{k * k}" for k in range(20)]
    (tmp_path / "c.csv").write_text("\n".join(["time,seconds_elapsed,x,y", *dated]))
    for name, step, units in (("a", 0.01, "ns"), ("b", 0.001, "us"), ("c", 0.01, "s")):
        read = kineme.read_recordings(tmp_path / f"{name}.csv")
        how = read.detected[0][0]
        assert (how.time, how.units, how.ignored) == ("time", units, ("seconds_elapsed",))
        assert read.demonstrations.dimensions == ("x", "y")
        np.testing.assert_allclose(np.diff(read.demonstrations[0].times), step, rtol=1e-3)
        demos = kineme.Demonstrations.of(pd.read_csv(tmp_path / f"{name}.csv"))
        np.testing.assert_allclose(np.diff(demos[0].times), step, rtol=1e-3)


@pytest.mark.parametrize(
    "other", [lambda k: k / 50, lambda k: k / 100 + 0.006 * (k == 7), lambda k: 0.0, lambda k: 1.005 * k / 100]
)
def test_two_clocks_are_not_one(tmp_path, other):
    rows = [f"{1_700_000_000_000_000_000 + 10_000_000 * k},{other(k)},{k}" for k in range(200)]
    (tmp_path / "a.csv").write_text("\n".join(["time,seconds_elapsed,x", *rows]))
    with pytest.raises(kineme.errors.DataError, match=r"say which of \['time', 'seconds_elapsed'\] with time="):
        kineme.read_recordings(tmp_path / "a.csv")


def test_a_second_clock_is_left_aside_where_the_time_is_said(tmp_path):
    """As loggers of phones write it: time in nanoseconds since 1970, and the seconds that elapsed."""
    rows = [f"{1_700_000_000_000_000_000 + 10_000_000 * k},{k / 100},{k},{k * k},{k % 3}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join(["time,seconds_elapsed,x,y,t", *rows]))
    with pytest.raises(kineme.errors.DataError, match=r"say which of \['time', 'seconds_elapsed', 't'\] with time="):
        kineme.read_recordings(tmp_path / "a.csv")
    for time in ("time", "seconds_elapsed"):
        read = kineme.read_recordings(tmp_path / "a.csv", time=time)
        assert read.demonstrations.dimensions == ("x", "y", "t")
        np.testing.assert_allclose(np.diff(read.demonstrations[0].times), 0.01, rtol=1e-4)
    chosen = kineme.read_recordings(tmp_path / "a.csv", time="time", columns=["x", "seconds_elapsed"])
    assert chosen.demonstrations.dimensions == ("x", "seconds_elapsed")


@pytest.mark.parametrize(
    ("heads", "first", "second"), [("X [s],emg,X [s],acc", 0, 2), ("time_emg,emg,time_acc,acc", "time_emg", "time_acc")]
)
def test_values_at_the_times_of_another_sensor_are_refused(tmp_path, heads, first, second):
    """As Delsys writes them, each sensor at its own rate behind its own clock."""
    rows = [f"{k / 1000},{k},{k / 750},{k * k}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([heads, *rows]))
    with pytest.raises(kineme.errors.DataError, match=rf"in column 2, which runs at another rate.* exclude={second!r}"):
        kineme.read_recordings(tmp_path / "a.csv", time=first)
    for choice in ({"columns": "emg"}, {"exclude": second}):
        read = kineme.read_recordings(tmp_path / "a.csv", time=first, **choice).demonstrations
        assert read.dimensions == ("emg", *["acc"] * ("exclude" in choice))
    alike = [f"{k / 1000},{k},{k / 1000},{k * k}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([heads, *alike]))
    assert kineme.read_recordings(tmp_path / "a.csv", time=first).demonstrations.dimensions == ("emg", "acc")


def test_what_rostopic_echo_p_writes(tmp_path):
    """Times in %time, the first head, in nanoseconds."""
    heads = (
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.position.x,field.pose.position.y"
    )
    rows = [f"{1_700_000_000_000_000_000 + 20_000_000 * k},{k},{k},base,{k},{k * k}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([heads, *rows]))
    read = kineme.read_recordings(tmp_path / "a.csv")
    assert read.demonstrations.dimensions == ("field.pose.position.x", "field.pose.position.y")
    np.testing.assert_allclose(np.diff(read.demonstrations[0].times), 0.02, atol=1e-6)


#: Unit -> number per second, and the seconds since 1970 at the beginning of the years 2000 and 2100.
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
Y2000, Y2100 = 946_684_800, 4_102_444_800


@given(
    unit=st.sampled_from(["ms", "us", "ns"]),
    # of a machine that was switched on between never and a hundred days ago, and what it counts looks like a date
    magnitude=st.floats(0, 1),
    rate=st.floats(1.01, 199.0),
    days=st.booleans(),
)
def test_time_since_boot_is_in_the_unit_that_makes_its_steps_plausible(unit, magnitude, rate, days):
    first = magnitude * 100 * 86400 * PER_SECOND[unit] if days else Y2000 + magnitude * (Y2100 - Y2000)
    stamps = np.round(first + np.arange(50) * PER_SECOND[unit] / rate)
    assert unit_by_size(stamps)[0] == unit


@given(
    unit=st.sampled_from([*PER_SECOND]),
    since=st.floats(Y2000, Y2100 - 100),
    rate=st.floats(1.001, 1000.0),
    jitter=st.floats(0, 0.3),
)
def test_stamps_since_1970_are_told_in_every_unit_at_every_rate(unit, since, rate, jitter):
    spread = np.random.default_rng(0).uniform(-jitter, jitter, 50)
    stamps = (since + (np.arange(50) + spread) / rate) * PER_SECOND[unit]
    assert unit_by_size(stamps)[0] == unit


@pytest.mark.parametrize(
    ("step", "unit"), [(4.99, "s"), (5.0, "ms"), (999.0, "ms"), (1e3, "us"), (199e3, "us"), (1e6, "ns")]
)
def test_steps_of_stamps_that_count_from_anywhere_say_their_unit(step, unit):
    assert unit_by_size(step * np.arange(20.0))[0] == unit
    stamps = PER_SECOND["s"] * (1_700_000_000.0 + 1e-3 * step * np.arange(20))
    assert unit_by_size(stamps, "unix time") == ("s", "since 1970")  # up to seventeen minutes apart


@pytest.mark.parametrize(
    "head",
    ["ms_elapsed", "milliseconds_elapsed", "Time(ms) relative", "time_ms_since_boot", "ms since start time", "mSecs",
     "time_mSec", "elapsed_mS", "timeMSec"],
)  # fmt: skip
def test_the_unit_of_time_is_a_word_anywhere_in_the_head(tmp_path, head):
    (tmp_path / "a.csv").write_text(f"{head},x\n" + "".join(f"{k},{k % 7}\n" for k in range(2000)))
    recordings = read_recordings(tmp_path / "a.csv")
    assert (recordings.demonstrations.durations[0], recordings.detected[0][0].units_from) == (1.999, "head")
    assert unit_in_head(f"{head} 100 ns") == "100ns"
    assert unit_in_head("timestamp_S1") is None
    assert not is_time("uS")  # of conductance


def test_an_unusual_rate_is_noted_of_what_is_read(tmp_path):
    (tmp_path / "a.csv").write_text("time,x\n" + "".join(f"{k},{k % 7}\n" for k in range(50)))
    (note,) = read_recordings(tmp_path / "a.csv").notes
    assert note == "1 samples per second are unusual; if the unit of time is another, give --units"
    with pytest.warns(UserWarning, match="1 samples per second are unusual"):
        read_recording(tmp_path / "a.csv")
    assert read_recordings(tmp_path / "a.csv", units="ms").notes == ()


def test_clocks_of_one_device_drift_a_little():
    times = np.arange(0.0, 1000.0, 0.1)
    assert same_clock(times, 5.0 + times * (1 + 9e-5))
    assert not same_clock(times, 5.0 + times * (1 + 2e-4))


def test_midnight_passes_from_times_of_day_alone_and_missing_dates_are_none():
    assert seconds_of_dates(["23:59:59", "00:00:01"])[0].tolist() == [86_399.0, 86_401.0]
    assert seconds_of_dates(["1 days 23:30:00", "0 days 00:00:00"])[0].tolist() == [171_000.0, 0.0]
    np.testing.assert_array_equal(nanoseconds(np.array(["NaT", "1970-01-01T00:00:01"], "M8[s]")), [np.nan, 1e9])


@pytest.mark.parametrize("step", [1, 2, 4.9])
@pytest.mark.parametrize(("unit", "finer"), [("s", "ms"), ("ms", "us"), ("us", "ns")])
def test_stamps_that_may_be_two_units_are_refused_until_one_is_said(tmp_path, unit, finer, step):
    stamps = PER_SECOND[unit] * (1_200_000_000 + step * np.arange(20))
    with pytest.raises(
        kineme.errors.DataError, match=rf"since 1970 or {finer} since another time; say units='{unit}' or '{finer}'"
    ):
        unit_by_size(stamps, "time")
    assert unit_by_size(stamps, "unix time") == (unit, "since 1970")
    frame = pd.DataFrame({"time": stamps, "x": np.arange(20.0)})
    frame.to_csv(tmp_path / "a.csv", index=False, float_format="%.17g")
    read = kineme.read_recordings(tmp_path / "a.csv", units=finer)
    np.testing.assert_allclose(np.diff(read.demonstrations[0].times), step / 1000, rtol=1e-3)


@pytest.mark.parametrize(("step", "clear"), [(4.9, False), (0.005, True)])
def test_stamps_that_are_two_units_in_files_of_one_logger_are_refused_until_one_is_said(tmp_path, step, clear):
    for name, each in (("a", 5.1), ("b", step), ("c", step)):
        frame = pd.DataFrame({"time": each * np.arange(20), "x": np.arange(20.0)})
        frame.to_csv(tmp_path / f"{name}.csv", index=False)
    if clear:
        read = kineme.read_recordings(tmp_path)
        np.testing.assert_allclose([one.duration for one in read.demonstrations], 0.019 * np.array([5.1, 5, 5]))
    else:
        with pytest.raises(
            kineme.errors.DataError, match=r"'time' that is s \(in steps of 4\.9\) or ms .*; say units="
        ):
            kineme.read_recordings(tmp_path)
    assert len(kineme.read_recordings(tmp_path, units="ms").problems) == 0


def test_the_name_of_stamps_in_arrays_says_their_unit_too(tmp_path):
    x = np.column_stack((np.arange(20.0), np.arange(20.0) ** 2))
    (tmp_path / "a.json").write_text(json.dumps({"time_us": (10 * np.arange(20)).tolist(), "positions": x.tolist()}))
    read = kineme.read_recordings(tmp_path / "a.json")
    np.testing.assert_allclose(np.diff(read.demonstrations[0].times), 1e-5)


def test_the_state_of_joints_as_rostopic_writes_it_has_the_columns_of_the_bag(tmp_path):
    joints = [f"arm_{k}_joint" for k in range(6)]
    parts = [f"field.{what}{k}" for what in ("name", "position", "velocity", "effort") for k in range(6)]
    heads = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id", *parts]
    rows = []
    for k in range(20):
        t = 1_700_000_000_000_000_000 + 20_000_000 * k
        q = [0.1 * j + np.sin(0.1 * k) for j in range(6)]
        rows.append(",".join(map(str, [t, k, t, "", *joints, *q, *[np.cos(0.1 * k)] * 6, *[7.0 + k] * 6])))
    (tmp_path / "a.csv").write_text("\n".join([",".join(heads), *rows]))
    read = kineme.read_recordings(tmp_path / "a.csv")
    assert read.demonstrations.dimensions == tuple(joints)
    assert {channel.kind for channel in read.demonstrations.channels} == {"angle"}
    np.testing.assert_allclose(read.demonstrations[0].positions[5], [0.1 * j + np.sin(0.5) for j in range(6)])


def test_velocities_and_efforts_without_positions_are_what_moves(tmp_path):
    rows = [f"{k / 50},{np.sin(k)},{k}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join(["time,field.velocity0,field.effort0", *rows]))
    assert kineme.read_recordings(tmp_path / "a.csv").demonstrations.dimensions == ("field.velocity0", "field.effort0")


@pytest.mark.parametrize("clock", ["ros_time", "sensor_timestamp_ns", "device.stamp"])
def test_the_time_of_another_clock_is_no_coordinate(tmp_path, clock):
    rows = [f"{k / 50},{k},{k * k},{1.7e9 + k / 50 + 0.001 * (k % 3)}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join([f"time,x,y,{clock}", *rows]))
    read = kineme.read_recordings(tmp_path / "a.csv")
    assert read.demonstrations.dimensions == ("x", "y")
    assert read.detected[0][0].ignored == (clock,)
    assert kineme.read_recordings(tmp_path / "a.csv", columns=("x", clock)).demonstrations.n_dims == 2


@pytest.mark.parametrize(
    ("head", "first", "step", "seconds"),
    [
        ("clock", 133_000_000_000_000_000, 100_000, 0.01),  # FILETIME of Windows
        ("Timestamp", 638_000_000_000_000_000, 166_667, 1 / 60),  # DateTime.Ticks of .NET
        ("Time [100 ns]", 0, 333_333, 1 / 30),
        ("t_100ns", 5_000_000, 333_333, 1 / 30),
    ],
)
def test_ticks_of_100_ns_are_known_by_their_year_or_by_the_head(tmp_path, head, first, step, seconds):
    rows = [f"{first + k * step},{k},{k * k}" for k in range(30)]
    (tmp_path / "a.csv").write_text("\n".join([f"{head},x,y", *rows]))
    recordings = kineme.read_recordings(tmp_path / "a.csv", time=head)
    np.testing.assert_allclose(np.diff(recordings.demonstrations[0].times), seconds, rtol=2e-3)
    assert recordings.detected[0][0].units == "100ns"


def test_ticks_of_unknown_length_are_refused_until_it_is_said(tmp_path):
    rows = [f"{k * 333_333},{k},{k * k}" for k in range(30)]
    (tmp_path / "a.csv").write_text("\n".join(["ticks,x,y", *rows]))
    with pytest.raises(kineme.errors.DataError, match=r"got 'ticks' in steps of 333333; .* units='100ns' .* --units"):
        kineme.read_recordings(tmp_path / "a.csv", time="ticks")
    recordings = kineme.read_recordings(tmp_path / "a.csv", time="ticks", units="100ns")
    np.testing.assert_allclose(np.diff(recordings.demonstrations[0].times), 1 / 30, rtol=1e-5)


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        (["11:59:59.500 AM", "12:00:00.000 PM", "1:00:00 pm"], [43_199.5, 43_200, 46_800]),
        (["12:00:00.250AM", "01:00:00.000AM", "10:15:03,250 PM"], [0.25, 3600, 80_103.25]),
        (["11:59:59 PM", "12:00:00 AM", "12:00:01 AM"], [86_399, 86_400, 86_401]),
        (["2024-05-06 12:00:01 PM", "2024/05/06 13:00:00", "2024/05/07 12:00:01 AM"], [0, 3599, 43_200]),
    ],
)
def test_halves_of_days_and_dates_that_begin_with_the_year(cells, seconds):
    assert all(map(is_date, cells))
    values, others = seconds_of_dates(cells)
    assert others == {}
    begin = values[0] - seconds[0] if cells[0].startswith("2024") else 0.0
    np.testing.assert_allclose(values - begin, seconds)


@pytest.mark.parametrize(
    "cell", ["13:00:00 PM", "0:10:00 AM", "05/06/2024 10:00:00 AM", "2024-05/06 10:00:00", "10:00 AM"]
)
def test_what_is_no_time_of_day_or_no_certain_date_is_none(cell):
    assert not is_date(cell)
