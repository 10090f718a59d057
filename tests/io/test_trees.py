"""Movements by name, by line and by sample in JSON, NPZ and NPY."""

import io
import json

import numpy as np
import pytest

from kineme.errors import DataError
from kineme.io.reading.recordings import read_recordings
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

T = np.arange(10) / 10
X = np.column_stack((np.sin(T), T**2))
SAMPLES = [{"t": t, "x": x, "y": y} for t, (x, y) in zip(T.tolist(), X.tolist(), strict=True)]


def read(data, name, **options):
    data = data if isinstance(data, bytes) else data.encode()
    return read_recordings_from_bytes(data, name, Layout(**options))


def read_json(value, **options):
    return read(json.dumps(value), "a.json", **options)


def npz(**arrays):
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def where(recordings):
    return [(source.place, source.label) for source in recordings.sources]


def test_samples_with_names_are_a_table():
    recordings = read_json(SAMPLES)
    np.testing.assert_array_equal(recordings.demonstrations.times, T)
    np.testing.assert_array_equal(recordings.demonstrations.positions, X)
    assert recordings.demonstrations.dimensions == ("x", "y")
    assert read_json(SAMPLES, columns="y").demonstrations.dimensions == ("y",)
    lines = "\n".join(map(json.dumps, SAMPLES))
    np.testing.assert_array_equal(read(lines, "a.jsonl").demonstrations.positions, X)


def test_a_head_as_kineme_writes_it_is_that_of_times():
    columns = {"time [s]": T, "x": X[:, 0], "y": X[:, 1]}
    samples = [dict(zip(columns, row, strict=True)) for row in np.column_stack([*columns.values()]).tolist()]
    lines, records = "\n".join(map(json.dumps, samples)), np.zeros(len(T), [(name, float) for name in columns])
    for name, column in columns.items():
        records[name] = column
    for data, name in ((npz(**columns), "a.npz"), (npy(records), "a.npy"), (lines, "a.jsonl")):
        recordings = read(data, name)
        np.testing.assert_array_equal(recordings.demonstrations[0].times, T)
        np.testing.assert_array_equal(recordings.demonstrations[0].positions, X)
        assert recordings.detected[0][0].time == "time [s]"


def test_a_frame_without_its_index_and_lines_that_end_in_json_are_tables():
    split = {"columns": ["t", "x", "y"], "data": np.column_stack((T, X)).tolist()}
    for data in (json.dumps(split), "\n".join(map(json.dumps, SAMPLES))):
        recordings = read(data, "a.json")
        np.testing.assert_array_equal(recordings.demonstrations.times, T)
        np.testing.assert_array_equal(recordings.demonstrations.positions, X)
    with pytest.raises(DataError, match="truncated or damaged"):
        read(json.dumps(SAMPLES, indent=1) + "\n]", "a.json")


def test_samples_may_carry_labels_movements_vectors_and_objects():
    long = [sample | {"demo": k // 5, "label": "wave"} for k, sample in enumerate(SAMPLES)]
    recordings = read_json(long)
    assert where(recordings) == [("0", "wave"), ("1", "wave")]
    nested = [{"t": sample["t"], "q": [1, sample["x"]], "pose": {"position": {"x": sample["y"]}}} for sample in SAMPLES]
    assert read_json(nested).demonstrations.dimensions == ("q.0", "q.1", "pose.position.x")
    assert read_json(nested, columns="q").demonstrations.dimensions == ("q.0", "q.1")


def test_lists_and_names_of_movements():
    assert where(read_json([SAMPLES, SAMPLES[:7]])) == [("0", None), ("1", None)]
    assert where(read_json({"wave": SAMPLES, "nod": SAMPLES})) == [("wave", "wave"), ("nod", "nod")]
    several = {"wave": [SAMPLES, SAMPLES], "nod": [SAMPLES]}
    assert where(read_json(several)) == [("wave/0", "wave"), ("wave/1", "wave"), ("nod/0", "nod")]
    counted = {"demo_0": X.tolist(), "demo_1": X[:7].tolist()}  # numbers of movements are no labels
    assert where(read_json(counted)) == [("demo_0", None), ("demo_1", None)]


def test_a_movement_in_each_line():
    lines = [{"label": "wave", "times": T[:n].tolist(), "positions": X[:n].tolist()} for n in (5, 6)]
    recordings = read("\n".join(map(json.dumps, lines)), "a.jsonl")
    assert where(recordings) == [("0", "wave"), ("1", "wave")]
    assert recordings.demonstrations.lengths.tolist() == [5, 6]
    assert recordings.demonstrations.dimensions == ("x", "y")


def test_a_missing_number_costs_its_movement_or_its_sample():
    broken = [dict(sample) for sample in SAMPLES]
    broken[3]["x"] = None
    del broken[4]["y"]
    with pytest.raises(DataError, match="got nothing in 10 % of the samples, 10 % of 'y'"):
        read_json(broken, fill_gaps=0)
    assert read_json(broken, skip="sample", fill_gaps=0).demonstrations.lengths.tolist() == [8]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[]", "got a list"),
        ("[1, 2, 3]", "got a list"),
        ('"x"', "got a str"),
        ("[[1, 2], [3]]", "differ in length"),
        (
            '[{"t": 0, "x": 1, "side": ["a", "b"]}, {"t": 1, "x": 2, "side": ["a", "b"]}]',
            "of one length in 'side', each",
        ),
        ('[{"t": 1, "x": 2}, 3]', "objects beside other values"),
        ('{"a": {"b": 1}}', "got no entry 'positions' but"),
        ("[[0, 1], [1, 2], [2, 3], [3, 4]]", "the seconds between two samples with units="),
    ],
)
def test_other_json_is_refused(text, words):
    with pytest.raises(DataError, match=words):
        read(text, "a.json")


def test_a_damaged_line_is_named():
    with pytest.raises(DataError, match=r"expected JSON in line 2, got '{.t.:'"):
        read('{"t": 1, "x": 2}\n{"t": \n', "a.jsonl")


def test_an_npy_file_is_one_movement_or_many():
    np.testing.assert_allclose(read(npy(X), "a.npy", units=0.1).demonstrations.times, T)
    assert len(read(npy(np.stack((X, X))), "a.npy").demonstrations) == 2
    assert read(npy(X), "a.npy", units=0.1, columns="y").demonstrations.dimensions == ("y",)
    with pytest.raises(DataError, match="say the seconds between two samples with units="):
        read(npy(X), "a.npy")
    with pytest.raises(DataError, match="foreign, truncated or damaged"):
        read(npy(X)[:-3], "a.npy")


def test_arrays_by_name_are_movements_and_their_times_stand_beside():
    recordings = read(npz(wave=X, nod=X[:7]), "a.npz")
    assert where(recordings) == [("wave", "wave"), ("nod", "nod")]
    assert recordings.detected[0][0].units_from == "no times: one second each"
    recordings = read(npz(wave_1=X, wave_1_t=T, wave_2=X[:5], times_wave_2=2 * T[:5]), "a.npz")
    assert where(recordings) == [("wave_1", None), ("wave_2", None)]
    np.testing.assert_allclose(recordings.demonstrations.durations, [0.9, 0.8])
    recordings = read(npz(**{"demo_0/q": X, "demo_0/t": T, "demo_1/q": X, "demo_1/t": T}), "a.npz")
    assert where(recordings) == [("demo_0", None), ("demo_1", None)]
    with pytest.raises(DataError, match=r"first axis of 'tip', got shape \(2, 10\) beside 10 times; save tip.T"):
        read(npz(time=T, tip=X.T), "a.npz")
    rated = read(npz(wave=X, fps=np.array(50)), "a.npz")
    np.testing.assert_allclose(np.diff(rated.demonstrations.times), 0.02)


def test_arrays_beside_times_are_columns_and_several_vectors_must_be_chosen():
    recordings = read(npz(t=T, q=X, gripper=X[:, 0]), "a.npz")
    assert recordings.demonstrations.dimensions == ("q.0", "q.1", "gripper")
    both = npz(t=T, q=X, action=X)
    with pytest.raises(DataError, match=r"got q \(2\), action \(2\); say which with columns="):
        read(both, "a.npz")
    assert read(both, "a.npz", columns="action").demonstrations.dimensions == ("action.0", "action.1")


def test_objects_are_refused_with_the_reason_and_what_to_do():
    objects = np.empty(2, dtype=object)
    objects[:] = [X, X[:5]]
    for data, name in ((npz(a=objects), "a.npz"), (npy(objects), "a.npy")):
        with pytest.raises(DataError, match=r"cannot be loaded without executing what they say; save .* under its own"):
            read(data, name)


def test_a_movement_that_lacks_an_array_costs_itself_alone():
    recordings = read(npz(**{"a/q": X, "a/t": T, "b/q": X, "b/t": T, "c/t": T, "c/p": X}), "a.npz")
    assert [source.place for source in recordings.sources] == ["a", "b"]
    assert "c: expected an array 'q' as others have, got none" in str(recordings.problems[0])


def test_movements_of_other_dimensions_cost_themselves_alone():
    recordings = read(npz(wave=X, nod=X[:7], bow=np.ones((6, 3))), "a.npz")
    assert [source.place for source in recordings.sources] == ["wave", "nod"]
    assert "movement bow: 3 dimensions where most have 2" in str(recordings.problems[0])


def test_a_named_movement_with_its_own_times_is_one_movement_however_few_there_are(tmp_path):
    t, x = np.linspace(0, 3, 20), np.random.default_rng(0).normal(size=(20, 3))
    np.savez(tmp_path / "one.npz", wave=x, wave_t=t)
    np.savez(tmp_path / "two.npz", wave=x, wave_t=t, nod=x + 1, nod_t=2 * t)
    first, two = (read_recordings(tmp_path / f"{name}.npz") for name in ("one", "two"))
    assert (list(first.labels), list(two.labels)) == (["wave"], ["wave", "nod"])
    assert first.demonstrations.dimensions == two.demonstrations.dimensions == ("x", "y", "z")
    assert [round(float(each.times[-1]), 9) for each in [*first, *two]] == [3.0, 3.0, 6.0]


def test_columns_of_a_movement_beside_times_of_their_own_name_stay_together(tmp_path):
    t, x = np.linspace(0, 3, 20), np.random.default_rng(0).normal(size=(20, 3))
    np.savez(tmp_path / "a.npz", t=t, q=x, gripper=np.round(t / 3))
    (movement,) = read_recordings(tmp_path / "a.npz")
    assert [channel.name for channel in movement.channels] == ["q.0", "q.1", "q.2", "gripper"]


def test_one_file_that_cannot_be_read_is_named_once(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros((20, 3)))
    with pytest.raises(DataError) as caught:
        read_recordings(tmp_path / "a.npy")
    assert str(caught.value).count("a.npy") == 1
    assert "got positions of shape (20, 3) alone" in str(caught.value)


def test_columns_that_are_always_null_are_left_aside_and_named():
    nulls = [sample | {"effort": None, "label": None, "force": [None, None]} for sample in SAMPLES]
    for recordings in (read_json(nulls), read("\n".join(map(json.dumps, nulls)), "a.jsonl")):
        assert recordings.demonstrations.dimensions == ("x", "y")
        assert recordings.detected[0][0].ignored == ("effort", "force")
        assert where(recordings) == [("", None)]
    with pytest.raises(DataError, match=r"got the columns .* there are no numbers in"):
        read_json([{"t": sample["t"], "x": None} for sample in SAMPLES])


def test_a_movement_with_nulls_where_others_have_numbers_costs_itself_alone():
    with_effort = [[sample | {"effort": 1.0} for sample in SAMPLES]] * 2
    recordings = read_json([*with_effort, [sample | {"effort": None} for sample in SAMPLES]])
    assert len(recordings) == 2
    assert "expected numbers in 'effort', got none" in str(recordings.problems[0])


def test_columns_without_any_number_are_left_aside_in_tables_too():
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"time": T, "x": X[:, 0], "effort": np.nan, "y": X[:, 1]})
    buffer = io.BytesIO()
    frame.to_parquet(buffer)
    for data, name in ((frame.to_csv(index=False), "a.csv"), (buffer.getvalue(), "a.parquet")):
        recordings = read(data, name)
        assert recordings.demonstrations.dimensions == ("x", "y")
        assert recordings.detected[0][0].ignored == ("effort",)
        with pytest.raises(DataError, match=r"expected (a number|finite)"):
            read(data, name, columns=["x", "effort"])


def test_a_rate_is_known_by_its_words_and_holds_for_all_below_it():
    x = X.tolist()
    for name, value in (("fs", 20), ("sampling_rate_hz", 20.0), ("interval_ms", 50), ("period", 0.05), ("dt", 50)):
        for tree in ({"values": x, name: value}, {"a": {"values": x}, "b": [x], name: str(value)}):
            times = read_json(tree).demonstrations[-1].times
            np.testing.assert_allclose(times, np.arange(len(x)) / 20, err_msg=name)
    for value in ({"heart_rate": 20}, {}):
        with pytest.raises(DataError, match="the seconds between two samples"):
            read_json({"values": x} | value)
    with pytest.raises(DataError, match=r"expected one rate, got fs \(20 Hz\), fps \(30 Hz\)"):
        read_json({"values": x, "fs": 20, "fps": 30})
    assert read_json({"values": x, "fs": 20, "fps": 30}, units=0.05).demonstrations.durations[0] == pytest.approx(0.45)
    with pytest.raises(DataError, match=r"got shape \(2, 10\), .* save np.moveaxis"):
        read_json({"values": X.T.tolist(), "fs": 20})


@pytest.mark.parametrize(("unit", "taken"), [("mm", "mm"), ("deg", "deg"), ("ms", None), ("nothing", None)])
def test_the_unit_beside_the_data_is_theirs(unit, taken):
    x = X.tolist()
    for content in ({"fps": 50, "data": x}, {"times": T.tolist(), "positions": x}, {"data": SAMPLES}):
        (one,) = read_json({"unit": unit, **content}).demonstrations
        assert [channel.unit for channel in one.channels or ()] == [taken] * 2


@pytest.mark.parametrize("y", [np.array(["a", "b", "a"]), np.array([2, 0, 2]), np.array([2.0, 0.0, 2.0])])
def test_sets_of_movements_have_the_labels_beside_them(y):
    sets = np.stack([X, X + 1, X + 2])
    recordings = read(npz(X=sets, y=y, fs=20), "a.npz")
    assert recordings.labels.tolist() == (["a", "b", "a"] if y.dtype.kind == "U" else ["2", "0", "2"])
    np.testing.assert_array_equal(recordings.demonstrations[2].positions, X + 2)
    np.testing.assert_allclose(recordings.demonstrations.durations, 9 / 20)
    parts = read(npz(X_train=sets, y_train=y, X_test=sets[:2], y_test=y[:2]), "a.npz")
    assert parts.labels.tolist() == [*recordings.labels.tolist(), *recordings.labels.tolist()[:2]]
    assert read(npz(X_train=sets), "a.npz").labels.tolist() == [None] * 3


def test_points_of_a_body_in_each_sample_are_columns():
    hands = [[{"x": x, "y": y, "z": 0}, {"x": y, "y": x, "z": 1}] for x, y in X.tolist()]
    timed = [{"timestamp": t, "landmarks": hand} for t, hand in zip(T.tolist(), hands, strict=True)]
    recordings = read_json(timed)
    assert recordings.demonstrations.dimensions == tuple(f"landmarks.{k}.{axis}" for k in (0, 1) for axis in "xyz")
    np.testing.assert_array_equal(recordings.demonstrations[0].positions[:, :2], X)
    numbered = [{"frame": k, "landmarks": [[*point.values()] for point in hand]} for k, hand in enumerate(hands)]
    np.testing.assert_array_equal(
        read_json({"fps": 10, "frames": numbered}).demonstrations[0].positions, recordings.demonstrations[0].positions
    )
    names = [{"score": 0.5, "keypoints": [{"name": "nose", "x": x, "score": 1}]} for x, _ in X.tolist()]
    assert read_json(names, units=0.1).demonstrations.dimensions == ("score", "keypoints.nose.x")


def test_parts_of_a_sample_are_told_by_their_names_and_not_by_their_places():
    def sample(t, x, *sides):
        return {"t": t, "hands": [{"handedness": side, "x": x + (side == "Left")} for side in sides]}

    pairs = list(zip(T.tolist(), X[:, 0].tolist(), strict=True))
    sides = [("Left", "Right"), ("Right", "Left")]
    demos = read_json([sample(t, x, *sides[k % 2]) for k, (t, x) in enumerate(pairs)]).demonstrations
    assert demos.dimensions == ("hands.Left.x", "hands.Right.x")
    np.testing.assert_array_equal(demos[0].positions, np.column_stack([X[:, 0] + 1, X[:, 0]]))
    with pytest.raises(DataError, match=r"expected parts of 'hands' with different names in each sample"):
        read_json([sample(t, x, "Left", "Left") for t, x in pairs])
    with pytest.raises(DataError, match=r"expected as many 'points' in each sample, .* got 1 to 2; give each a name"):
        read_json([{"t": t, "points": [{"x": x}] * (1 + k % 2)} for k, (t, x) in enumerate(pairs)])
    named = [{"label": label, "samples": SAMPLES} for label in ("wave", "nod")]
    assert read_json([{"session": 1, "gestures": named}]).labels.tolist() == ["wave", "nod"]
    assert read_json([{"session": 1, "gestures": [{"samples": SAMPLES}]}]).labels.tolist() == [None]


@pytest.mark.parametrize(
    ("key", "ids", "names"),
    [
        *((key, (7, 12), "01") for key in ("id", "tracking_id", "trackingId", "body_id", "person_id", "track_id")),
        ("type", ("left", "right"), ("left", "right")),
        ("marker_id", (7, 12), ("7", "12")),
    ],
)
def test_bodies_are_told_apart_by_their_ids(key, ids, names):
    """What a device numbers anew is counted; hands of a Leap also have a type, which says more than their id."""
    of_leap = {"left": {"id": 5}, "right": {"id": 9}}

    def sample(k):
        parts = [
            {key: i, **of_leap.get(i, {}), "position": {"x": x, "y": y}}
            for i, (x, y) in zip(ids, X[:2].tolist(), strict=True)
        ]
        return {"t": k / 10, "bodies": [{**part, "age": 1.0 * k} for part in parts[:: -1 if k % 7 > 3 else 1]]}

    demos = read_json([sample(k) for k in range(10)]).demonstrations
    heads = ("position.x", "position.y", "age")
    assert {*demos.dimensions} == {f"bodies.{name}.{head}" for name in names for head in heads}
    places = [demos.dimensions.index(f"bodies.{name}.position.x") for name in names]
    np.testing.assert_array_equal(demos[0].positions[:, places], np.tile(X[:2, 0], (10, 1)))


def test_a_body_that_is_found_again_has_its_place_and_is_noted():
    def frame(k, *ids):
        return {"t": k / 10, "hands": [{"id": i, "palm": [1.0 * k, i % 10, 1.0]} for i in ids]}

    recordings = read_json([frame(k, *((13, 12) if k < 4 else (13,) if k < 5 else (22, 13))) for k in range(10)])
    assert recordings.demonstrations.dimensions == tuple(f"hands.{k}.palm.{i}" for k in (1, 0) for i in range(3))
    np.testing.assert_array_equal(recordings.demonstrations[0].positions[:, [1, 4]], [[3, 2]] * 10)
    assert recordings.notes == (
        "hands.0 had the ids 12, 22 one after the other, and is read as one; look whether it is the same",
    )


def test_steps_of_rlds_have_flags_and_what_was_told():
    def steps(told):
        return [
            {
                "observation": {"state": x},
                "gripper": k > 5,
                "is_first": k == 0,
                "reward": 1.0,
                "language_instruction": told,
            }
            for k, x in enumerate(X.tolist())
        ]

    recordings = read_json([{"steps": steps("pick")}, {"steps": steps("put")}], units=0.1)
    assert recordings.labels.tolist() == ["pick", "put"]
    assert recordings.detected[0][0].columns == ("observation.state.0", "observation.state.1", "gripper")
    assert read_json([{"steps": steps("")}], units=0.1).labels.tolist() == [None]
    recordings = read_json(
        [sample | {"is_first": k == 0} for k, sample in enumerate(SAMPLES)], columns=["x", "is_first"]
    )
    assert recordings.detected[0][0].columns == ("x", "is_first")


def test_times_that_are_null_are_left_aside_and_those_in_quotes_are_named():
    nulls = [sample | {"t": None} for sample in SAMPLES]
    assert read_json({"fps": 10, "frames": nulls}).demonstrations[0].times.tolist() == T.tolist()
    assert read_json(nulls, units=0.1).demonstrations.n_dims == 2
    with pytest.raises(DataError, match=r"in 't', got the text '0\.0'; write numbers without quotes"):
        read_json([sample | {"t": str(sample["t"])} for sample in SAMPLES])


def test_an_axis_that_is_a_list_runs_over_time():
    rows = [{"label": label, "x": (X[:, 0] + k).tolist(), "y": X[:, 1].tolist()} for k, label in enumerate("ab")]
    recordings = read("\n".join(map(json.dumps, rows)), "a.jsonl", units=0.1)
    assert (recordings.labels.tolist(), recordings.demonstrations.dimensions) == (["a", "b"], ("x", "y"))
    np.testing.assert_array_equal(recordings.demonstrations[1].positions, X + np.array([1, 0]))


def test_tables_of_records_have_their_columns():
    records = np.rec.fromarrays([T, *X.T], names="t,x,y")
    np.testing.assert_array_equal(read(npy(records), "a.npy").demonstrations[0].positions, X)
    days = [f"2026-05-04T10:00:0{t}" for t in T]
    texts = np.rec.fromarrays([days, *X.T, [b"wave"] * 5 + [b"nod"] * 5, ["ok"] * 10], names="time,x,y,label,note")
    recordings = read(npy(texts), "a.npy")
    assert recordings.labels.tolist() == ["wave", "nod"]
    np.testing.assert_allclose(recordings.demonstrations.durations, 0.4, atol=1e-6)
    assert recordings.detected[0][0].ignored == ("note",)


def _points(rise, upper=True, first=0, last=30):
    points = [{"X": float(k), "Y": rise * k * k, "T": 1000 + 16 * k} for k in range(first, last)]
    return points if upper else [{key.lower(): value for key, value in point.items()} for point in points]


@pytest.mark.parametrize(
    ("content", "labels"),
    [
        ({"Name": "circle", "Points": _points(1.0)}, ["circle"]),
        ({"name": "circle", "points": _points(1.0, upper=False)}, ["circle"]),
        ({"gestures": [{"name": name, "points": _points(k + 1.0, False)} for k, name in enumerate("ab")]}, ["a", "b"]),
        ([{"Name": name, "Points": _points(k + 1.0)} for k, name in enumerate("ab")], ["a", "b"]),
        ({"Name": "x", "Strokes": [_points(1.0, last=12), _points(1.0, first=12)]}, ["x"]),
        ({"Name": "circle_07", "Points": _points(1.0)}, [None]),
    ],
)
def test_drawn_gestures_are_labeled_by_their_names(tmp_path, content, labels):
    """As the $1 and $N recognizers keep them; a name that ends in a number only counts."""
    (tmp_path / "a.json").write_text(json.dumps(content))
    recordings = read_recordings(tmp_path / "a.json")
    assert recordings.labels.tolist() == labels
    for k, movement in enumerate(recordings.demonstrations):
        np.testing.assert_array_equal(movement.positions, [[j, (k + 1.0) * j * j] for j in range(30)])
        np.testing.assert_allclose(np.diff(movement.times), 0.016, atol=1e-9)


def _landmarks(k, n=5):
    return [{"x": np.sin(k / 9) + 0.1 * i, "y": 0.2 * i, "z": 0.01 * k, "visibility": 1.0} for i in range(n)]


@pytest.mark.parametrize(
    "content",
    [
        [{"landmark": _landmarks(k)} for k in range(20)],
        [_landmarks(k) for k in range(20)],
        {"fps": 30, "frames": [{"landmarks": _landmarks(k)} for k in range(20)]},
        {"fps": 30, "frames": [{"left": _landmarks(k), "right": _landmarks(k)} for k in range(20)]},
    ],
)
def test_landmarks_of_frames_are_no_movements(tmp_path, content):
    (tmp_path / "a.json").write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"one movement of 20 samples of 5 points.* every=20 .*--every"):
        read_recordings(tmp_path / "a.json", units=0.03)
    (movement,) = read_recordings(tmp_path / "a.json", units=0.03, every=20).demonstrations
    expected = [[[mark[axis] for axis in "xyz"] for mark in _landmarks(k)] for k in range(20)]
    hands = 1 + ("right" in str(content))
    np.testing.assert_array_equal(movement.positions, np.tile(np.reshape(expected, (20, 15)), hands))


@pytest.mark.parametrize("key", ["categoryName", "category_name"])
@pytest.mark.parametrize("stamp", [lambda k: {"timestamp": 33 * k}, lambda k: {}])
def test_hands_of_a_frame_are_told_apart_by_what_they_are_held_for(tmp_path, key, stamp):
    """As MediaPipe's tasks answer: of each frame a list of hands, each a list of points, in any order."""
    held = [[{"index": 0, "score": 0.9, key: "Left"}], [{"index": 1, "score": 0.8, key: "Right"}]]
    frames = [
        {**stamp(k), "landmarks": [_landmarks(k), _landmarks(k + 1)], "handedness": held, "pose": [_landmarks(k)]}
        for k in range(20)
    ]
    for frame in frames[5:9]:
        frame |= {"landmarks": frame["landmarks"][::-1], "handedness": held[::-1]}

    def read():
        (tmp_path / "a.json").write_text(json.dumps({"fps": 30, "frames": frames}))
        return read_recordings(tmp_path / "a.json").demonstrations

    demos = read()
    assert demos.dimensions == tuple(
        f"{hand}.{k}.{axis}"
        for hand in ("landmarks.Left", "landmarks.Right", "pose.0")
        for k in range(5)
        for axis in "xyz"
    )
    np.testing.assert_array_equal(demos[0].positions[1:, 0], demos[0].positions[:-1, 15])
    frames[3]["handedness"] = [held[0], held[0]]
    with pytest.raises(DataError, match=r"another side of each of the 2 'landmarks' .* got \['Left', 'Left'\]; corr"):
        read()
    for frame in frames:
        frame |= {"landmarks": [_landmarks(0)], "handedness": held[:1]}
    assert read().dimensions[0] == "landmarks.0.0.x"  # there is no other hand
    frames = [{"frame": k, "landmarks": [_landmarks(k), _landmarks(k + 1)][: 1 + k]} for k in range(20)]
    with pytest.raises(DataError, match="as many 'landmarks' in each sample"):
        read()


@pytest.mark.parametrize(
    ("hands", "held", "names"),
    [
        # The older solutions, as protobuf's MessageToDict writes them, and in JavaScript.
        (
            lambda points: {"landmark": points},
            lambda side: {"classification": [{"index": 0, "score": 0.9, "label": side}]},
            ("multi_hand_landmarks", "multi_handedness", ".landmark"),
        ),
        (list, lambda side: {"index": 0, "score": 0.9, "label": side}, ("multiHandLandmarks", "multiHandedness", "")),
        (list, str, ("landmarks", "handedness", "")),
    ],
)
def test_older_answers_say_which_hand_it_is(hands, held, names):
    def frames(sides):
        return [
            {
                "timestamp": 33 * k,
                "gestures": [[{"index": -1, "score": 0.5, "categoryName": "fist"}] for _ in sides(k)],
                names[0]: [hands(_landmarks(k + (side == "Right"))) for side in sides(k)],
                names[1]: [*map(held, sides(k))],
            }
            for k in range(20)
        ]

    demos = read_json(frames(lambda k: ["Left", "Right"][:: -1 if k % 7 > 3 else 1])).demonstrations
    assert demos.dimensions == tuple(
        f"{names[0]}.{side}{names[2]}.{k}.{axis}" for side in ("Left", "Right") for k in range(5) for axis in "xyz"
    )
    np.testing.assert_array_equal(demos[0].positions[1:, 0], demos[0].positions[:-1, 15])
    recordings = read_json(frames(lambda k: ["Left" if k < 9 else "Right"]))
    assert recordings.demonstrations.dimensions[0] == f"{names[0]}.0{names[2]}.0.x"
    assert recordings.notes == ("one hand is Left and Right in turns, and read as one; look whether it is",)


def test_bodies_of_frames_are_read_beside_the_bones_between_their_joints(tmp_path):
    """As Azure Kinect's offline processor writes them."""
    frames = [
        {
            "frame_id": k,
            "timestamp_usec": 33_333 * k,
            "bodies": [{"body_id": 1, "joint_positions": [[k, i, k * i]] * 4}],
        }
        for k, i in zip(range(20), range(20), strict=True)
    ]
    content = {"bone_list": [["HIP", "KNEE"]], "joint_names": ["HIP", "KNEE", "HEAD", "HAND"], "frames": frames}
    (tmp_path / "a.json").write_text(json.dumps(content))
    demos = read_recordings(tmp_path / "a.json").demonstrations
    assert demos.dimensions == tuple(f"bodies.0.joint_positions.{k}.{axis}" for k in range(4) for axis in "xyz")
    assert demos.durations == pytest.approx([19 * 0.033333])


@pytest.mark.parametrize("several", [False, True])
def test_frames_of_openpose_are_refused_by_name(tmp_path, several):
    frame = {"version": 1.3, "people": [{"person_id": [-1], "pose_keypoints_2d": [float(k) for k in range(75)]}]}
    (tmp_path / "a.json").write_text(json.dumps([frame] * 9 if several else frame))
    with pytest.raises(DataError, match=r"as OpenPose writes it.*a table with a line for each frame"):
        read_recordings(tmp_path / "a.json", units=0.03)
