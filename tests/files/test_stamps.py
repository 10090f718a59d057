"""Time stamps as messages of ROS carry them: in a header, in seconds and nanoseconds apart, under %time."""

import json

import numpy as np
import pandas as pd
import pytest

import kineme

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


def test_a_second_clock_is_left_aside_where_the_time_is_said(tmp_path):
    """As loggers of phones write it: time in nanoseconds since 1970, and the seconds that elapsed."""
    rows = [f"{1_700_000_000_000_000_000 + 10_000_000 * k},{k / 100},{k},{k * k},{k % 3}" for k in range(20)]
    (tmp_path / "a.csv").write_text("\n".join(["time,seconds_elapsed,x,y,t", *rows]))
    with pytest.raises(kineme.DataError, match=r"say which of \['time', 'seconds_elapsed', 't'\] with time="):
        kineme.read_recordings(tmp_path / "a.csv")
    for time in ("time", "seconds_elapsed"):
        read = kineme.read_recordings(tmp_path / "a.csv", time=time)
        assert read.demonstrations.dimensions == ("x", "y", "t")
        np.testing.assert_allclose(np.diff(read.demonstrations[0].times), 0.01, rtol=1e-4)
    chosen = kineme.read_recordings(tmp_path / "a.csv", time="time", columns=["x", "seconds_elapsed"])
    assert chosen.demonstrations.dimensions == ("x", "seconds_elapsed")


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
