"""Arrays by name, from NPZ, JSON and MATLAB files: the natural layouts, and what does not fit together."""

import io
import json

import numpy as np
import pytest
from scipy.io import savemat

import kineme
from kineme.io.arrays.arrays import arrays_movements
from kineme.io.reading.recordings import read_recordings
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

T = np.arange(5) / 10
X = np.column_stack((T, T**2, 1 - T))


def read(arrays, **options):
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return read_recordings_from_bytes(buffer.getvalue(), "a.npz", Layout(**options))


@pytest.mark.parametrize(
    ("arrays", "places", "layout"),
    [
        ({"times": T, "positions": X}, [""], "single"),
        ({"t": T, "x": X}, [""], "single"),
        ({"time": T, "pos": X, "velocities": X, "note": np.array("text")}, [""], "single"),
        ({"t": T, "x": X[:, 0], "y": X[:, 1], "z": X[:, 2]}, [""], "single"),
        ({"times": T, "positions": np.stack((X, X))}, ["0", "1"], "(n, T, d)"),
        ({"times": np.stack((T, T)), "positions": np.stack((X, X))}, ["0", "1"], "(n, T, d)"),
        ({"x": np.stack((X, X)), "t": T, "y": np.array([3, 4])}, ["0", "1"], "(n, T, d)"),
        ({"positions_0": X, "times_0": T, "positions_1": X, "times_1": T}, ["0", "1"], "numbered"),
        ({"x_0": X, "t_0": T}, ["0"], "numbered"),
        ({"x_0": X, "t_0": T, "x_2": X, "t_2": T, "x_10": X, "t_10": T}, ["0", "2", "10"], "numbered"),
        ({"positions_01": X, "times_01": T, "positions_02": X, "times_02": T}, ["01", "02"], "numbered"),
        ({"positions": np.concatenate((X, X)), "times": np.append(T, T), "offsets": [0, 5, 10]}, ["0", "1"], "offsets"),
    ],
)
def test_natural_layouts(arrays, places, layout):
    recordings = read(arrays)
    assert [source.place for source in recordings.sources] == places
    assert recordings.detected[0][0].layout == layout
    for movement in recordings.demonstrations:
        np.testing.assert_array_equal(movement.times, T)
        np.testing.assert_array_equal(movement.positions, X)


def test_columns_without_names_are_no_joints_and_do_not_wrap_where_they_jump():
    t = np.arange(60) / 30
    fingers = np.column_stack((np.where(t < 1, 300, 10), t, t, 1 - t))  # in pixels
    demos = read({"times": t, "positions": fingers}).demonstrations
    np.testing.assert_array_equal(demos.positions, fingers)
    assert demos.dimensions == ("x1", "x2", "x3", "x4")
    named = read({"times": t, "positions": fingers, "columns": np.array(["q1", "q2", "q3", "q4"])}).demonstrations
    assert {channel.kind for channel in named.channels} == {"angle"}


SKELETON = np.sin(np.linspace(0, 3, 40))[:, None, None] + np.random.default_rng(0).normal(size=(7, 3))  # (40, 7, 3)


def _saved(folder, kind):
    path = folder / f"a.{kind.partition(' ')[0]}"
    match kind:
        case "npy":
            np.save(path, SKELETON)
        case "npz":
            np.savez(path, positions=SKELETON)
        case "npz other":
            np.savez(path, skeleton=SKELETON)
        case "npz rate":
            np.savez(path, skeleton=SKELETON, fps=30)
        case "json":
            path.write_text(json.dumps({"positions": SKELETON.tolist()}))
        case "json list":
            path.write_text(json.dumps(SKELETON.tolist()))
        case "h5":
            with pytest.importorskip("h5py").File(path, "w") as file:
                file["positions"] = SKELETON
        case "mat":
            savemat(path, {"skeleton": SKELETON})
    return path


@pytest.mark.parametrize("kind", ["npy", "npz", "npz other", "npz rate", "json", "json list", "h5", "mat"])
def test_joints_over_time_are_no_movements_of_joints(tmp_path, kind):
    path = _saved(tmp_path, kind)
    with pytest.raises(
        kineme.errors.DataError, match=r"shape \(40, 7, 3\), which may be one .* say every=40 if it is, every=7 if"
    ):
        read_recordings(path, units=0.02)
    (skeleton,) = read_recordings(path, units=0.02, every=40).demonstrations
    np.testing.assert_array_equal(skeleton.positions, SKELETON.reshape(40, 21))
    assert [(channel.name, channel.kind) for channel in skeleton.channels] == [
        (f"{k}.{axis}", "position") for k in range(7) for axis in "xyz"
    ]
    assert skeleton.duration == pytest.approx(39 * 0.02)
    many = read_recordings(path, units=0.02, every=7).demonstrations
    np.testing.assert_array_equal([movement.positions for movement in many], SKELETON)


def test_movements_of_one_coordinate_are_no_points(tmp_path):
    alike = np.random.default_rng(0).normal(size=20) + np.linspace(0, 0.1, 9)[:, None]
    np.save(tmp_path / "a.npy", alike[:, :, None])
    assert len(read_recordings(tmp_path / "a.npy")) == 9


@pytest.mark.parametrize("name", ["positions", "skeleton"])
@pytest.mark.parametrize("kind", ["npz", "json"])
def test_times_say_which_axis_of_three_is_time(tmp_path, kind, name):
    path, times = tmp_path / f"a.{kind}", np.arange(40) / 50
    if kind == "npz":
        np.savez(path, **{name: SKELETON, "times": times})
    else:
        path.write_text(json.dumps({name: SKELETON.tolist(), "times": times.tolist()}))
    (movement,) = read_recordings(path).demonstrations
    np.testing.assert_array_equal(movement.positions, SKELETON.reshape(40, 21))
    np.testing.assert_array_equal(movement.times, times)
    if name == "positions":
        np.savez(path.with_suffix(".npz"), positions=np.moveaxis(SKELETON, 1, 0), times=times)
        assert len(read_recordings(path.with_suffix(".npz"))) == 7


def write(path, arrays):
    """Write arrays in the format that the ending of the path says."""
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    elif path.suffix == ".mat":
        savemat(
            path, {name: array.astype(object) if array.dtype.kind == "U" else array for name, array in arrays.items()}
        )
    elif path.suffix == ".json":
        path.write_text(json.dumps(arrays, default=np.ndarray.tolist))
    else:
        with pytest.importorskip("h5py").File(path, "w") as file:
            file.update(
                {name: array.astype("S") if array.dtype.kind == "U" else array for name, array in arrays.items()}
            )


@pytest.mark.parametrize("shape", [(40,), (1, 40), (40, 1), (4, 40)])
@pytest.mark.parametrize("name", ["times", "timestamps"])
@pytest.mark.parametrize("kind", ["npz", "json", "mat", "h5"])
def test_times_of_many_movements_are_never_one_second_each(tmp_path, kind, name, shape):
    t, path = np.arange(40) / 50, tmp_path / f"a.{kind}"
    sets = np.stack([np.column_stack((np.sin(t + k), (k + 1) * t)) for k in range(4)])
    arrays = {"positions": sets, name: np.tile(t, (4, 1)) if shape == (4, 40) else t.reshape(shape)}
    write(path, arrays | {"labels": np.array(["wave", "nod"] * 2)})
    recordings = read_recordings(path)
    np.testing.assert_allclose(recordings.demonstrations.durations, [0.78] * 4)
    assert recordings.labels.tolist() == ["wave", "nod"] * 2
    np.testing.assert_array_equal(recordings.demonstrations[1].positions, sets[1])
    square = {name: np.arange(1, 5)[:, None] * np.arange(4.0), "positions": sets[:, :4]}  # of as many as their samples
    if kind != "mat":  # in which the samples of matrices lie along the longer axis
        write(path, square)
        np.testing.assert_allclose(read_recordings(path).demonstrations.durations, [3, 6, 9, 12])
    write(path, arrays | {name: t[:30]})
    with pytest.raises(kineme.errors.DataError, match=r"expected times of (the 4 movements of 40 samples|shape)"):
        read_recordings(path)


def test_a_cell_of_times_is_that_of_a_cell_of_movements(tmp_path):
    cells = np.empty((2, 2), dtype=object)
    for k, length in enumerate((10, 20)):
        cells[0, k], cells[1, k] = np.random.default_rng(k).normal(size=(length, 2)), np.arange(length) / 50
    write(tmp_path / "a.mat", {"data": cells[0], "times": cells[1], "labels": np.array(["wave", "nod"])})
    recordings = read_recordings(tmp_path / "a.mat")
    np.testing.assert_allclose(recordings.demonstrations.durations, [0.18, 0.38])
    assert recordings.labels.tolist() == ["wave", "nod"]


@pytest.mark.parametrize(
    ("labels", "expected"), [([b"a", b"b"], ("a", "b")), (["a", "b"], ("a", "b")), ([1, 2], ("1", "2"))]
)
def test_labels_become_text(labels, expected):
    assert tuple(read({"positions": np.stack((X, X)), "labels": np.array(labels)}).labels) == expected


def test_without_times_each_movement_takes_a_second_unless_the_step_is_given():
    recordings = read({"x_0": X, "x_1": X[:4]})
    np.testing.assert_array_equal(recordings.demonstrations.durations, [1, 1])
    assert recordings.detected[0][0].units_from == "no times: one second each"
    assert recordings.detected[0][0].time is None
    stepped = read({"x_0": X, "x_1": X[:4]}, units=0.1)
    np.testing.assert_allclose(stepped.demonstrations.durations, [0.4, 0.3])


def test_whole_milliseconds_are_recognized_and_a_given_unit_wins():
    assert read({"times": T * 1000, "positions": X}).detected[0][0].units == "ms"
    np.testing.assert_array_equal(read({"times": T * 1000, "positions": X}).demonstrations.times, T)
    assert read({"times": T * 1000, "positions": X}, units="s").demonstrations.durations.tolist() == [400]


def test_dates_and_durations_keep_their_unit():
    dates = np.datetime64("2024-05-06T07:08:09", "ms") + np.arange(5) * 100
    assert read({"times": dates, "positions": X}).demonstrations.times[0] == 1714979289
    np.testing.assert_allclose(read({"times": dates - dates[0], "positions": X}).demonstrations.times, T)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"times": T}, r"expected arrays times and positions, got no entry 'positions' but \['times'\]"),
        ({"positions": X}, r"expected times beside the positions, got positions of shape \(5, 3\) alone"),
        ({"positions": X, "times": T[:4]}, r"each of the 5 samples, got times of shape \(4,\)"),
        ({"positions": np.zeros((2, 2, 5, 3)), "times": T}, r"of shape \(T, d\) or \(n, T, d\), got \(2, 2, 5, 3\)"),
        ({"positions": np.stack((X, X)), "times": T[:4]}, r"times of shape \(5,\) or \(2, 5\), got \(4,\)"),
        ({"positions": np.stack((X, X)), "labels": ["a"]}, r"one label for each of the 2 movements, .* \(1,\)"),
        ({"x_0": X, "x_1": X[:, :2]}, r"movements of the same dimensions, at least one, got \[2, 3\]"),
        ({"positions": np.zeros((3, 5, 0))}, r"at least one, got \[0\]"),
        ({"positions": np.zeros((0, 5, 2))}, r"at least one, got \[\]"),
        ({"positions": X * 1j, "times": T}, "expected real numbers, got complex128"),
        ({"x_0": X, "t_0": T, "x_1": X}, "times for each of the 2 movements, got no entry 't_1'"),
        ({"x_0": X, "t_0": T[:3]}, "expected one time stamp per sample, got 3 for 5 in movement 0"),
        ({"x_0": np.zeros((2, 2, 2))}, r"positions of shape \(T, d\), got \(2, 2, 2\)"),
        ({"positions": X, "times": T, "offsets": [0, 4]}, "expected offsets from 0 to 5, got 0 to 4"),
        ({"positions": X, "times": T, "offsets": [0, 6, 5]}, "expected offsets as whole numbers"),
        ({"positions": X, "times": T, "offsets": [0.0, 5.0]}, "expected offsets as whole numbers"),
        ({"positions": np.array([["1", "a"]]), "times": T}, "expected numbers in times and positions, got 'a'$"),
        ({"positions": np.array([{}, {}]), "times": T}, "Object arrays cannot be loaded"),
    ],
)
def test_arrays_that_do_not_fit_together(arrays, words):
    with pytest.raises(kineme.errors.DataError, match=words):
        read(arrays)


def test_a_bad_movement_among_arrays_costs_itself_alone():
    bad = X.copy()
    bad[2, 1] = np.nan
    recordings = read({"x_0": X, "x_1": bad, "x_2": X[:2], "t_0": T, "t_1": T, "t_2": T[:2]}, fill_gaps=0)
    assert [source.place for source in recordings.sources] == ["0"]
    lacking, short = [problem.reason for problem in recordings.problems]
    assert lacking.startswith("movement 1: expected a number in 'y', got nothing in ")
    assert short == "movement 2: expected at least 4 samples, got 2"


@pytest.mark.parametrize("shape", [(9, 6, 40), (6, 40)])
def test_arrays_of_more_dimensions_than_samples_say_which_axis_to_move(shape):
    with pytest.raises(kineme.errors.DataError, match=r"got shape \(6, 40\), .* save np.moveaxis\(array, 1, 2\)"):
        read({"positions_0": np.ones(shape)} if len(shape) == 2 else {"positions": np.ones(shape)})
    right = np.cumsum(np.ones((9, 6, 40)), axis=1)
    assert read({"positions": right}, units=0.02).demonstrations.lengths.tolist() == [6] * 9


def test_the_arrays_of_the_caller_are_left_alone():
    x, t = X.copy(), T.copy() * 1000
    x.setflags(write=False)
    t.setflags(write=False)
    parsed = arrays_movements({"positions": x, "times": t}, Layout(), "NPZ")
    assert not np.shares_memory(parsed.block.times, t)


def test_json_knows_the_same_layouts(tmp_path):
    movements = {"x_0": X.tolist(), "t_0": T.tolist(), "x_1": X[:4].tolist(), "t_1": T[:4].tolist()}
    (tmp_path / "a.json").write_text(json.dumps({**movements, "labels": ["a", "b"]}))
    assert tuple(read_recordings(tmp_path / "a.json").labels) == ("a", "b")


def test_json_nested_without_end_is_a_problem():
    with pytest.raises(kineme.errors.DataError, match=r"a\.json: expected times and positions, got lists within lists"):
        read_recordings_from_bytes(b"[" * 10**6, "a.json", Layout())


@pytest.mark.parametrize(
    ("positions", "words"),
    [
        ("[[0, 1], [1], [2, 3], [3, 4]]", "rows that differ in length or depth; name movements"),
        ("[{}, 1, 2, 3]", r"expected numbers in times and positions, got \{\}$"),
        ('[0, 1, "soon", 3]', "expected numbers in times and positions, got 'soon'$"),
        ("[0, null, 2, 3]", "expected a number in 'x', got nothing in 25 % of the samples"),
    ],
)
def test_entries_of_json_that_are_no_numbers_are_named(positions, words):
    with pytest.raises(kineme.errors.KinemeError, match=words):
        read_recordings_from_bytes(b'{"times": [0, 1, 2, 3], "positions": %s}' % positions.encode(), "a.json", Layout())


def test_a_reason_is_one_line():
    with pytest.raises(kineme.errors.DataError, match=r"got no entry 'positions' but \['a b', 'c\\nd'\]$") as caught:
        read_recordings_from_bytes(b'{"a b": 1, "c\\nd": 2}', "a.json", Layout())
    assert "\n" not in str(caught.value)


def matlab(path, content):
    savemat(path, content)
    return path


def demos(n, transpose=False):
    ragged = np.empty(n, dtype=object)
    for k in range(n):
        ragged[k] = {"pos": X[:, :2].T, "t": T[None], "vel": X[:, :2].T}
    return ragged


@pytest.mark.parametrize("n", [1, 3])
def test_demos_of_any_number_labeled_by_the_file_or_by_the_name_in_it(tmp_path, n):
    (tmp_path / "kept").mkdir()
    plain = read_recordings(matlab(tmp_path / "kept" / "Spiral.mat", {"demos": demos(n)}).parent)
    assert tuple(plain.labels) == ("Spiral",) * n
    np.testing.assert_array_equal(plain.demonstrations[0].positions, X[:, :2])
    named = read_recordings(matlab(tmp_path / "b.mat", {"demos": demos(n), "name": "Curl"}))
    assert tuple(named.labels) == ("Curl",) * n


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"other": X}, r"expected a MATLAB file with 'demos', got none of that name"),
        ({"demos": X}, "expected a MATLAB file with 'demos', got something else than structures in it"),
        ({"demos": {"pos": X.T, "t": T[:3]}}, r"got t of shape \(3,\) and pos of shape \(3, 5\)"),
        ({"demos": {"pos": "a text", "t": T}}, "expected a MATLAB file with 'demos', got something else than numbers"),
        ({"demos": {"t": T}}, r"got structures without 'pos', but with \['t'\]"),
        ({"demos": {"pos": X.T + 1j, "t": T}}, "with 'demos', got complex numbers"),
    ],
)
def test_other_matlab_files_are_refused(tmp_path, content, words):
    with pytest.raises(kineme.errors.DataError, match=words):
        read_recordings(matlab(tmp_path / "a.mat", content))


def test_newer_matlab_files_are_named():
    with pytest.raises(kineme.errors.DataError, match=r"7\.2 or earlier, got 7\.3; save it with -v7"):
        read_recordings_from_bytes(b"MATLAB 7.3 MAT-file" + b" " * 200, "a.mat", Layout())
