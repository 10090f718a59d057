"""The files of a phone's sensors, one for each sensor in a folder for each recording, as one recording."""

import json

import commands
import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import kineme
from kineme.cli.reading import files_of
from kineme.io.reading.recordings import HowToRead, NameRule, read_paths
from kineme.movements.tables.layout import Known, Layout
from lerobot_sets import write_v3

BEGIN = 1_700_000_000.0  # s since 1970


def table(path, heads, times, values):
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [
        ",".join([str(round(t * 1e9)), repr(t - BEGIN), *map(repr, row)])
        for t, row in zip(times.tolist(), values, strict=True)
    ]
    path.write_text("\n".join([",".join(["time", "seconds_elapsed", *heads]), *rows]) + "\n")


def clock(rate, begin, end):
    return BEGIN + np.arange(begin, end, 1 / rate)


def spatial(t):
    return np.column_stack([np.sin(t - BEGIN), np.cos(2 * (t - BEGIN)), (t - BEGIN) ** 2])


def heading(t):
    return (170 + 20 * (t - BEGIN) + 180) % 360 - 180  # degrees that wrap after half a second


def turned(t):
    return Rotation.from_rotvec(np.outer(t - BEGIN, [0.3, 0.4, 1.2]))


def record(folder):
    t = clock(100, 0.05, 2)
    table(folder / "Accelerometer.csv", ["z", "y", "x"], t, spatial(t).tolist())
    t = clock(40, 0, 2.2)
    table(folder / "Gyroscope.csv", ["z", "y", "x"], t, (2 * spatial(t)).tolist())
    t = clock(25, 0.1, 1.9)
    q = turned(t).as_quat()
    q[::7] *= -1
    table(
        folder / "Orientation.csv", ["qx", "qy", "qz", "qw", "yaw [deg]"], t, np.column_stack([q, heading(t)]).tolist()
    )
    (folder / "Metadata.csv").write_text("device name,platform\nphone,android\n")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("log")
    for name in ("wave/one", "wave/two", "nod/one"):
        record(folder / name)
    return folder


def test_each_folder_is_one_recording_with_the_columns_of_all_files(folder):
    read = kineme.read_recordings(folder, join_files=True)
    assert [(one.path, one.label) for one in read.sources] == [
        ("nod/one", "nod"), ("wave/one", "wave"), ("wave/two", "wave"),
    ]  # fmt: skip
    names = [channel.name for channel in read.demonstrations.channels]
    assert names[:4] == ["Accelerometer.z", "Accelerometer.y", "Accelerometer.x", "Gyroscope.z"]
    kinds = {channel.name: channel.kind for channel in read.demonstrations.channels}
    assert sorted(kinds.values()) == ["angle", "orientation", *["position"] * 6]
    assert sum("Metadata.csv" in one.file for one in read.problems) == 3
    assert "3 files on one clock" in read.detected[0][0].layout


def test_samples_are_those_of_the_densest_file_and_the_others_are_interpolated(folder):
    demos = kineme.read_recordings(folder / "wave" / "one", join_files=True).demonstrations
    t = demos.times
    assert demos.names == ("one",)
    np.testing.assert_allclose(np.diff(t), 0.01, atol=1e-6)
    assert t[0] - BEGIN == pytest.approx(0.1, abs=0.011)
    assert t[-1] - BEGIN == pytest.approx(1.86, abs=0.011)
    recorded = demos.recorded
    np.testing.assert_allclose(recorded[:, :3], spatial(t), atol=1e-6)
    np.testing.assert_allclose(recorded[:, 3:6], 2 * spatial(t), atol=2e-3)
    stamps = clock(25, 0.1, 1.9)
    expected = Slerp(stamps, turned(stamps))(t).as_matrix()
    got = Rotation.from_quat(recorded[:, 6:10]).as_matrix()
    np.testing.assert_allclose(got, expected, atol=1e-5)
    np.testing.assert_allclose(np.unwrap(recorded[:, 10], period=360), 170 + 20 * (t - BEGIN), atol=1e-4)


def test_what_files_last_together_switch_and_lack_is_that_of_the_recording(tmp_path):
    t = clock(100, 0, 2)
    table(tmp_path / "one" / "Arm.csv", ["x"], t, t[:, None].tolist())
    t = clock(50, 0, 2)
    values = np.column_stack([np.roll(turned(t).as_quat(), 1, axis=1), (t >= BEGIN + 1).astype(float)]).tolist()
    values[20][0] = values[98][0] = values[99][0] = float("nan")
    table(tmp_path / "one" / "Hand.csv", ["qw", "qx", "qy", "qz", "gripper"], t, values)
    t = clock(40, 0, 2)
    table(tmp_path / "one" / "Grip.csv", ["open"], t, (t >= BEGIN + 1)[:, None].astype(float).tolist())
    t = clock(25, 0.8, 2)
    table(tmp_path / "one" / "Head.csv", ["y"], t, t[:, None].tolist())
    t = clock(1000, 0.5, 0.6)  # more in a second than all others, but short
    table(tmp_path / "one" / "Burst.csv", ["z"], t, t[:, None].tolist())
    t = clock(25, 1.2, 2)
    table(tmp_path / "one" / "Late.csv", ["w"], t, t[:, None].tolist())
    read = kineme.read_recordings(tmp_path, join_files=True)
    (one,) = read.demonstrations
    assert {name.partition(".")[0] for name in read.demonstrations.dimensions} == {"Arm", "Hand", "Head"}
    assert {problem.file for problem in read.problems if not problem.samples} == {"one/Burst.csv", "one/Late.csv"}
    np.testing.assert_allclose(np.diff(one.times), 0.01, atol=1e-6)
    heads = [column for channel in one.channels for column in channel.columns]
    gripper = one.recorded[:, heads.index("Hand.gripper")]
    np.testing.assert_array_equal(gripper, one.times >= BEGIN + 1 - 1e-6)  # from that sample on
    assert {*one.recorded[:, heads.index("Grip.open")].tolist()} == {0.0, 1.0}
    q = one.recorded[:, [heads.index(f"Hand.q{part}") for part in "wxyz"]]
    got = Rotation.from_quat(q, scalar_first=True)
    assert np.max((got.inv() * turned(one.times)).magnitude()) < 1e-3
    source = read.sources[0]
    assert (source.filled, source.longest_gap, source.cropped) == (1, pytest.approx(0.04), pytest.approx(0.04))


@pytest.mark.parametrize(
    ("starts", "seconds", "heads", "joined"),
    [
        ((5, 5, 5), (2, 2, 2), ("x,y", "a,b", "c,d"), True),
        ((0, 0, 0), (2, 2, 2), ("x,y", "a,b", "c,d"), False),
        ((5, 5, 5), (2, 1.6, 1.8), ("x,y", "a,b", "c,d"), False),
        ((5, 5, 5), (2, 2, 2), ("x,y", "x,y", "x,y"), False),
        ((BEGIN,) * 3, (2, 1.6, 1.8), ("x,y", "a,b", "c,d"), True),
    ],
)
def test_files_lie_on_one_clock_if_they_begin_and_end_together_or_count_from_1970(
    tmp_path, starts, seconds, heads, joined
):
    for k, (start, duration, names) in enumerate(zip(starts, seconds, heads, strict=True)):
        rows = [f"{start + i / 50:.2f},{i * k},{i * i}" for i in range(int(50 * duration))]
        (tmp_path / f"{k}.csv").write_text("\n".join([f"time [s],{names}", *rows]))
    assert any("lie on one clock" in note for note in kineme.read_recordings(tmp_path).notes) is joined


def test_a_quaternion_that_is_no_rotation_stays_none_in_a_joined_recording(tmp_path):
    record(tmp_path / "one")
    (tmp_path / "one" / "Metadata.csv").unlink()
    t = clock(25, 0.1, 1.9)
    q = turned(t).as_quat()
    q[20] *= 0.5
    table(tmp_path / "one" / "Orientation.csv", ["qx", "qy", "qz", "qw"], t, q.tolist())
    with pytest.raises(kineme.errors.DataError, match=r"the first that is none: one: expected unit quaternions"):
        kineme.read_recordings(tmp_path, join_files=True)
    read = kineme.read_recordings(tmp_path, join_files=True, skip="sample")
    assert len(read) == 1
    assert read.problems[-1].samples == 7  # those between the samples before and after it


def test_files_that_last_elsewhere_are_problems_and_files_alone_stay_as_they_are(tmp_path):
    record(tmp_path / "wave" / "one")
    later = clock(50, 100, 102)
    table(tmp_path / "wave" / "one" / "Magnetometer.csv", ["z", "y", "x"], later, spatial(later).tolist())
    read = kineme.read_recordings(tmp_path, join_files=True)
    (odd,) = [one for one in read.problems if "Magnetometer" in one.file]
    assert "expected samples at the time of wave/one/Accelerometer.csv" in odd.reason
    assert [one.label for one in read.sources] == ["wave"]
    alone = tmp_path / "alone"
    table(alone / "nod" / "a.csv", ["x", "y", "z"], later, spatial(later).tolist())
    assert [one.path for one in kineme.read_recordings(alone, join_files=True).sources] == ["nod/a.csv"]


def test_columns_and_kinds_of_a_joined_recording_are_chosen_by_their_names(folder):
    read = kineme.read_recordings(folder, join_files=True, kinds={"Accelerometer.z": "discrete"})
    assert read.demonstrations.channels[0].kind == "discrete"
    with pytest.raises(kineme.errors.KinemeError):
        kineme.read_recordings(folder, join_files=True, kinds={"Barometer.z": "discrete"})


def test_columns_of_a_joined_recording_are_those_that_are_chosen_or_known(folder, tmp_path):
    def columns(*paths, **options):
        read = kineme.read_recordings(*paths, join_files=True, **options)
        return [column for one in read.demonstrations.channels for column in one.columns]

    both = columns(folder, columns=["Gyroscope.*", "Accelerometer.x"])
    assert both == ["Gyroscope.z", "Gyroscope.y", "Gyroscope.x", "Accelerometer.x"]
    assert columns(folder, columns="Gyroscope.y") == ["Gyroscope.y"]
    assert columns(folder, columns="Orientation.q*") == [f"Orientation.q{part}" for part in "xyzw"]
    left = columns(folder, exclude=["Orientation.*", "Gyroscope.z"])
    assert left == ["Accelerometer.z", "Accelerometer.y", "Accelerometer.x", "Gyroscope.y", "Gyroscope.x"]
    alone = kineme.read_recordings(folder / "nod", join_files=True, columns="Accelerometer.x").demonstrations
    assert len(alone.times) == len(clock(100, 0.05, 2))  # no file without chosen columns crops it
    with pytest.raises(kineme.errors.DataError, match=r"expected columns like 'Barometer.\*'"):
        columns(folder, columns="Barometer.*")
    alone = tmp_path / "alone" / "nod.csv"
    table(alone, ["x", "y", "z"], clock(50, 0, 2), spatial(clock(50, 0, 2)).tolist())
    assert columns(alone, columns=["y", "x"]) == ["y", "x"]
    layout = Layout(reference=Known(columns=("Gyroscope.y", "Accelerometer.x")))
    (one,) = read_paths([folder / "nod"], HowToRead(layout, NameRule(), join=True)).demonstrations
    assert [channel.name for channel in one.channels] == ["Gyroscope.y", "Accelerometer.x"]


def test_inspect_says_how_files_on_one_clock_are_joined(folder, tmp_path):
    text = commands.run("inspect", folder).stdout
    assert "lie on one clock, and so do files in 2 other folders; --join-files" in text
    done = commands.run("inspect", folder, "--join-files", "--json")
    data = json.loads(done.stdout)
    assert (data["movements"], {one["label"] for one in data["labels"]}) == (3, {"nod", "wave"})
    assert not any("one clock" in one for one in data["notes"])
    for k in range(4):  # repetitions that each begin at 0 are none
        rows = [f"{i / 100},{i * k},{i * i}" for i in range(50)]
        (tmp_path / f"{k}.csv").write_text("\n".join([("time,x,y", "time,y,x", "time,x [mm],y [mm]")[k % 3], *rows]))
    assert "one clock" not in commands.run("inspect", tmp_path).stdout


def test_a_symbol_is_found_in_recordings_that_are_joined(tmp_path):
    def waved(t):
        return np.column_stack([np.cos(5 * t), t, 0 * t])

    for name, movement in {"wave/one": waved, "wave/two": waved, "nod/one": spatial, "nod/two": spatial}.items():
        for sensor, rate in (("Accelerometer", 100), ("Gyroscope", 50)):
            t = clock(rate, 0, 2)
            values = movement(t) if sensor == "Accelerometer" else movement(t)[:, ::-1]
            table(tmp_path / "log" / name / f"{sensor}.csv", ["z", "y", "x"], t, values.tolist())
    t = clock(25, 5, 6)  # of none of the columns of the library: passed over
    table(tmp_path / "log" / "wave" / "one" / "Marks.csv", ["u"], t, t[:, None].tolist())
    actions, log = tmp_path / "actions", tmp_path / "log"
    commands.run("learn", log, "--join-files", "--library", actions)
    found = json.loads(commands.run("find", "wave", log, "--join-files", "--library", actions, "--json").stdout)
    assert sorted(hit["recording"] for hit in found["hits"]) == ["wave/one", "wave/two"]
    assert found["recordings"] == 4


def test_a_data_set_is_read_some_episodes_at_a_time_whether_files_are_joined_or_not(tmp_path):
    folder = write_v3(tmp_path / "set", (30, 40, 50))
    for options in ({}, {"join_files": True}):
        (piece,) = files_of([folder], options, None, places=["episode 1"])
        assert [source.place for source in piece.sources] == ["episode 1"]
