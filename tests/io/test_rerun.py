"""Files for the viewer of Rerun, read back by its own package."""

import re
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.errors import DataError
from kineme.io.writing.rerun import (
    Scene,
    Stretch,
    episode_scene,
    movement_scene,
    points_in,
    recording_scenes,
    write_rerun,
)
from kineme.movements.episodes import Episode

pytest.importorskip("rerun", reason="rerun-sdk writes and reads .rrd files")

T = 5.0 + np.arange(20) / 10
X = np.column_stack((np.sin(T), T**2, T))
NAMES = ("hand.x", "hand.y", "hand.z [mm]")


def scene(name="episode 0", **changes):
    fields = {
        "times": T,
        "signals": {"observation.state": X},
        "names": {"observation.state": NAMES},
        "paths": {"hand": X},
        "lanes": {"motion": [Stretch(5.0, 5.5, "reach"), Stretch(5.5, 6.0, "grasp"), Stretch(6.5, 6.9, "unknown")]},
    }
    return Scene(name, **(fields | changes))


def columns_in(path):
    """Entity -> what it has over time, its stamps [s] among them; and what it has once and for all."""
    from rerun.chunk import RrdReader

    over_time, static = {}, {}
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch().to_pydict()
        entries = {head.rpartition(":")[2]: values for head, values in batch.items() if ":" in head}
        if chunk.is_static:
            static.setdefault(chunk.entity_path, {}).update({head: values[0] for head, values in entries.items()})
        else:
            assert chunk.timeline_names == ["time"]
            stamps = [stamp.total_seconds() for stamp in batch["time"]]
            over_time[chunk.entity_path] = {"time": stamps} | entries
    return over_time, static


def test_curves_paths_and_states_come_back_on_one_clock(tmp_path):
    over_time, static = columns_in(write_rerun(tmp_path / "a.rrd", [scene()]))
    curves = over_time[r"/episode\ 0/signals/observation.state"]
    np.testing.assert_allclose(curves["time"], T - 5.0, atol=1e-9)
    np.testing.assert_array_equal(curves["scalars"], X)
    assert static[r"/episode\ 0/signals/observation.state"]["names"] == list(NAMES)
    moving = over_time[r"/episode\ 0/points/hand"]
    np.testing.assert_allclose(np.squeeze(moving["positions"], 1), X, rtol=1e-6)
    np.testing.assert_allclose(static[r"/episode\ 0/points/hand/path"]["strips"][0], X, rtol=1e-6)
    states = over_time[r"/episode\ 0/symbols/motion"]
    assert list(zip(np.round(states["time"], 6).tolist(), states["state"], strict=True)) == [
        (0.0, ["reach"]), (0.5, ["grasp"]), (1.0, [None]), (1.5, ["unknown"]), (1.9, [None])
    ]  # fmt: skip
    look = static[r"/episode\ 0/symbols/motion"]
    assert look["values"] == ["reach", "grasp", "unknown"]
    assert [f"#{color >> 8:06X}" for color in look["colors"]] == ["#0072B2", "#D55E00", "#777777"]


def test_a_blueprint_lays_out_a_tab_for_each_scene(tmp_path):
    from rerun.chunk import RrdReader

    read = RrdReader(str(write_rerun(tmp_path / "a.rrd", (scene(f"episode {k}") for k in range(3)))))
    (entry,) = read.blueprints()
    text = " ".join(str(chunk.to_record_batch().to_pydict()) for chunk in read.stream(store=entry))
    views = set(re.findall(r"'ViewBlueprint:class_identifier': \[\['(\w+)'", text))
    assert views == {"3D", "TimeSeries", "StateTimeline"}
    assert all(text.count(f"['episode {k}']") == 1 for k in range(3))


def test_paths_in_the_plane_are_looked_at_from_above(tmp_path):
    from rerun.chunk import RrdReader

    eyes = []
    for k, path in enumerate((X[:, :2], X)):
        read = RrdReader(str(write_rerun(tmp_path / f"{k}.rrd", [scene(paths={"hand": path})])))
        batches = [chunk.to_record_batch().to_pydict() for chunk in read.stream(store=read.blueprints()[0])]
        eyes.append([batch for batch in batches if "EyeControls3D:position" in batch])
    (eye,), nothing = eyes
    assert nothing == []
    x, y, z = eye["EyeControls3D:position"][0][0]
    np.testing.assert_allclose([x, y], (X.min(axis=0) + X.max(axis=0))[:2] / 2)
    assert z > np.ptp(X[:, 1])
    assert eye["EyeControls3D:eye_up"][0][0] == [0, 1, 0]


def test_names_are_text_in_the_tree_and_none_is_there_twice(tmp_path):
    odd = scene("a/b\n", signals={"x/y": X}, names={}, paths={"": X[:, :2]}, lanes={"m/n": [Stretch(5, 6, "\x1b[2J")]})
    over_time, _ = columns_in(write_rerun(tmp_path / "a.rrd", [odd, odd]))
    assert len(over_time) == 6
    assert r"/a\/b\\n/signals/x\/y" in over_time
    assert r"/a\/b\\n\ \(2\)/points/point" in over_time
    assert all(len(part["state"]) == 2 for place, part in over_time.items() if "symbols" in place)
    assert "\x1b" not in str(over_time)
    np.testing.assert_array_equal(np.squeeze(over_time[r"/a\/b\\n/points/point"]["positions"], 1)[:, 2], 0)


def test_what_is_missing_leaves_gaps(tmp_path):
    times, values = T.copy(), X.copy()
    times[3], values[7, 0], values[9] = np.nan, np.nan, np.nan
    over_time, static = columns_in(
        write_rerun(tmp_path / "a.rrd", [scene(times=times, signals={"a": values}, names={}, paths={"p": values})])
    )
    assert len(over_time[r"/episode\ 0/signals/a"]["time"]) == 19
    assert len(over_time[r"/episode\ 0/points/p"]["time"]) == 17
    assert len(static[r"/episode\ 0/points/p/path"]["strips"][0]) == 17
    nothing = np.full_like(X, np.nan)
    empty = scene(times=np.full(20, np.nan), paths={"p": nothing}, lanes={})
    unsampled = scene("no samples", times=T[:0], signals={"a": X[:0]}, paths={}, lanes={})
    over_time, _ = columns_in(write_rerun(tmp_path / "b.rrd", [empty, unsampled]))
    assert [part["time"] for part in over_time.values()] == [[], []]


@pytest.mark.parametrize(
    ("stamps", "shown"),
    [
        ([np.nan, 0.1, 0.2], [0.0, 0.1]),
        ([0.0, 1e12, 2e12], [0.0]),
        ([np.nan] * 3, []),
        ([1e12, 1e12 + 1, 1e12 + 2], [0.0, 1.0, 2.0]),
    ],
)
def test_stamps_that_are_none_cost_their_samples_alone(stamps, shown, tmp_path):
    """Missing ones, and ones centuries later, which the viewer cannot count."""
    lanes = {"rest": [Stretch(np.nan, np.nan, "idle"), Stretch(0.0, 1e12, "gap"), Stretch(0.0, 0.1, "idle")]}
    odd = Scene("episode 0", np.array(stamps), {"state": np.zeros((3, 2))}, {"state": ("a", "b")}, lanes=lanes)
    over_time, _ = columns_in(write_rerun(tmp_path / "a.rrd", [odd]))
    assert over_time[r"/episode\ 0/signals/state"]["time"] == pytest.approx(shown)
    rest = over_time.get(r"/episode\ 0/symbols/rest", {"state": []})
    assert rest["state"] == ([] if stamps[0] == 1e12 else [["idle"], [None]])


@given(st.lists(st.tuples(st.integers(0, 50), st.integers(0, 9), st.sampled_from("abc")), min_size=1, max_size=8))
def test_states_that_are_shown_are_those_of_the_stretches(tmp_path_factory, spans):
    stretches = [Stretch(5 + start / 10, 5 + (start + length) / 10, state) for start, length, state in spans]
    path = tmp_path_factory.mktemp("lanes") / "a.rrd"
    over_time, _ = columns_in(write_rerun(path, [scene(lanes={"m": stretches})]))
    lane = over_time[r"/episode\ 0/symbols/m"]
    for middle in np.arange(70) / 10 + 0.05:
        k = int(np.searchsorted(lane["time"], middle)) - 1
        shown = None if k < 0 else lane["state"][k][0]
        begun = [stretch for stretch in sorted(stretches) if stretch.start <= 5 + middle]
        expected = begun[-1].state if begun and begun[-1].end > 5 + middle else None
        assert shown == expected


def test_points_are_told_by_the_ends_of_names():
    names = ("x", "y", "left.x [mm]", "left.y [mm]", "left.z [mm]", "gripper", "q.w", "q.x", "q.y", "q.z", "v.x", "v.y")
    values = np.arange(24.0).reshape(2, 12)
    points = points_in(names, values)
    assert list(points) == ["", "left"]
    np.testing.assert_array_equal(points["left"], values[:, 2:5])
    assert points_in(("eef_rot.x", "eef_rot.y", "eef_rot.z", "z", "max"), values[:, :5]) == {}
    assert (
        points_in(("Accelerometer.x", "Accelerometer.y", "Accelerometer.z", "gravity x", "gravity y"), values[:, :5])
        == {}
    )


def test_episodes_and_movements_are_scenes():
    episode = Episode(3, T, {"observation.state": X}, {"observation.state": NAMES}, place="data/demo_3")
    whole = episode_scene(episode, {"motion": [Stretch(5, 6, "reach")]})
    assert (whole.name, list(whole.paths), list(whole.lanes)) == ("data/demo_3", ["observation.state hand"], ["motion"])
    plain = movement_scene("wave", {"times": T, "positions": X}, None)
    assert plain.names == {"positions": ("x", "y", "z")}
    np.testing.assert_array_equal(plain.paths[""], X)


def test_recordings_carry_their_annotations(tmp_path):
    from kineme.io.writing.annotations import Annotation

    rows = "\n".join(f"{t!r},{x!r},{y!r}" for t, (x, y) in zip(T.tolist(), X[:, :2].tolist(), strict=True))
    (tmp_path / "long.csv").write_text(f"t,x,y\n{rows}\n")
    recordings = kineme.read_recordings(tmp_path / "long.csv")
    notes = [Annotation("long.csv", "", 5.2, 6.0, "wave", 0.5, 0.9), Annotation("long.csv", "", 6.0, 6.4, None, 0, 1)]
    (only,) = recording_scenes(recordings, notes)
    assert only.lanes == {"symbols": [Stretch(5.2, 6.0, "wave"), Stretch(6.0, 6.4, "unknown")]}
    np.testing.assert_array_equal(only.times, T)
    np.testing.assert_array_equal(only.paths[""], X[:, :2])


def test_nothing_is_written_over_or_half(tmp_path):
    path = tmp_path / "a.rrd"
    path.write_text("mine")
    with pytest.raises(FileExistsError, match="expected a new file"):
        write_rerun(path, [scene()])
    assert path.read_text() == "mine"
    write_rerun(path, [scene()], replace=True)

    def broken():
        yield scene()
        raise RuntimeError("a reader failed")

    before = path.read_bytes()
    with pytest.raises(RuntimeError, match="a reader failed"):
        write_rerun(path, broken(), replace=True)
    assert path.read_bytes() == before
    assert [left.name for left in tmp_path.iterdir()] == ["a.rrd"]


def test_what_cannot_be_written_is_said(tmp_path, monkeypatch):
    with pytest.raises(DataError, match=r"ending in \.rrd"):
        write_rerun(tmp_path / "a.mcap", [scene()])
    with pytest.raises(DataError, match="got none"):
        write_rerun(tmp_path / "a.rrd", [])
    with monkeypatch.context() as patched:
        patched.setenv("RERUN", "off")
        with pytest.raises(DataError, match="variable RERUN"):
            write_rerun(tmp_path / "a.rrd", [scene()])
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(DataError, match=r"pip install 'kineme\[rerun\]'"):
        write_rerun(tmp_path / "a.rrd", [scene()])
    assert not list(tmp_path.iterdir())
