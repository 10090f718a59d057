"""What is said about recordings, against a plain loop over movements."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kineme.io.inspection.figure import draw_recordings
from kineme.io.inspection.inspect import as_data, as_words, duplicates_among, inspect, notes_on_samples
from kineme.io.reading.merge_files import GAP, sampling_of
from kineme.io.reading.recordings import read_recordings
from kineme.io.writing.write_movement import write_movement
from kineme.movements.tables.layout import Layout
from kineme.movements.trajectories.demonstrations import Demonstrations
from kineme.reporting.figures import encode_figure
from recordings_in_bytes import read_recordings_from_bytes


def ragged(seed, n=12):
    rng = np.random.default_rng(seed)
    times, arrays = [], []
    for _ in range(n):
        steps = rng.uniform(0.8, 1.2, rng.integers(3, 60)) / rng.uniform(20, 200)
        steps[rng.random(len(steps)) < 0.05] *= 10
        times.append(np.append(0, np.cumsum(steps)) + rng.normal())
        arrays.append(rng.normal(size=(len(times[-1]), 2)))
    return Demonstrations.from_arrays(arrays, times=times)


@pytest.mark.parametrize("seed", range(8))
def test_sampling_agrees_with_a_loop_over_movements(seed):
    demos = ragged(seed)
    sampling = sampling_of(demos)
    for i, movement in enumerate(demos):
        steps = np.diff(movement.times)
        median = np.median(steps)
        even = steps[steps <= GAP * median]
        assert sampling.rates[i] == pytest.approx(1 / median)
        assert sampling.jitters[i] == pytest.approx(np.sqrt(np.mean((even / median - 1) ** 2)))
        assert sampling.gaps[i] == len(steps) - len(even)
        assert sampling.longest[i] == pytest.approx(steps.max())


def test_even_sampling_has_no_jitter_and_no_gaps(make_movement):
    t, x = make_movement(3)
    sampling = sampling_of(Demonstrations.from_arrays([x, x], times=[t, t + 7]))
    np.testing.assert_allclose(sampling.rates, (len(t) - 1) / 2.0)
    np.testing.assert_allclose(sampling.jitters, 0, atol=1e-9)
    assert sampling.gaps.tolist() == [0, 0]


def test_equal_movements_are_found_wherever_they_start_in_time(make_movement):
    movements = [make_movement(seed, n_samples=50) for seed in range(6)]
    nudged = movements[2][1].copy()
    nudged[[10, 20]] += [[1e-3], [-1e-3]]  # the same ends and sum
    slower = (movements[3][0] * 2, movements[3][1])
    listed = [
        *movements,
        (movements[1][0] + 5, movements[1][1]),
        (movements[2][0], nudged),
        slower,
        movements[1],
        movements[5],
    ]
    demos = Demonstrations.from_arrays([x for _, x in listed], times=[t for t, _ in listed])
    assert duplicates_among(demos) == [[1, 6, 9], [5, 10]]


def recordings(folder, make_movement, n_dims=2, labels=("wave", "nod", "wave", None)):
    for k, label in enumerate(labels):
        t, x = make_movement([k, n_dims], n_dims, n_samples=40 + k)
        (folder / (label or "")).mkdir(exist_ok=True)
        write_movement(folder / (label or "") / f"{k}.csv", {"times": t, "positions": x})
    (folder / "bad.csv").write_text("time,x\n0,1\n")
    return read_recordings(folder)


def test_an_inspection_counts_and_measures(tmp_path, make_movement):
    inspection = inspect(recordings(tmp_path, make_movement))
    assert (inspection.movements, inspection.files, inspection.dimensions) == (4, 4, 2)
    assert [(label.label, label.movements) for label in inspection.labels] == [("nod", 1), ("wave", 2), (None, 1)]
    wave = inspection.labels[1]
    assert wave.samples == (40, 41, 42)
    assert wave.duration == pytest.approx((2, 2, 2))
    assert wave.rate == pytest.approx((39 / 2, 20, 41 / 2), rel=0.01)
    sides = [np.ptp(make_movement([k, 2], 2, n_samples=40 + k)[1], axis=0).max() for k in (0, 2)]
    assert (wave.extent.least, wave.extent.greatest) == pytest.approx((min(sides), max(sides)))
    assert [problem.file for problem in inspection.problems] == ["bad.csv"]
    assert inspection.notes == (
        "only one movement labeled nod",
        "1 movements have no label: their files lie in no folder of their own",
    )


def test_words_and_data_say_the_same(tmp_path, make_movement):
    inspection = inspect(recordings(tmp_path, make_movement))
    words, data = as_words(inspection), json.loads(json.dumps(as_data(inspection), allow_nan=False))
    assert words.splitlines()[0] == "4 movements of 2 dimensions in 4 files"
    assert "CSV, wide: time 'time' in s (assumed); coordinates x, y (4 files)" in words
    assert "bad.csv: expected at least 4 samples, got 1" in words
    assert data["labels"][1]["samples"] == {"least": 40, "median": 41, "greatest": 42}
    assert data["problems"] == [{"file": "bad.csv", "line": None, "reason": "expected at least 4 samples, got 1"}]
    assert data["detected"][0]["files"] == 4


def test_gaps_and_odd_rates_are_noticed():
    text = "time,x\n" + "".join(f"{k},{k}\n" for k in (0, 1, 2, 3, 9, 10))
    inspection = inspect(read_recordings_from_bytes(text.encode(), "a.csv", Layout()))
    assert (inspection.labels[0].gaps, inspection.labels[0].longest_gap) == (1, 6)
    odd, pause = inspection.notes
    assert odd == "1 samples per second are unusual; if the unit of time is another, give --units"
    assert pause.startswith("1 movement without samples for up to 6 s, the first a.csv; if these are several movements")
    assert "1 (to 6 s)" in as_words(inspection)


def test_guesses_that_differ_between_files_are_noticed(tmp_path):
    for name, step in (("a", 0.4), ("b", 6)):
        (tmp_path / f"{name}.csv").write_text("time,x\n" + "".join(f"{k * step},{k}\n" for k in range(9)))
    inspection = inspect(read_recordings(tmp_path))
    assert "time counts in ms here, in s there, to judge by its size; give --units" in inspection.notes
    assert inspect(read_recordings(tmp_path, units="ms")).notes == ()


def spans(**spans):
    """The notes on a recording whose columns go so far."""
    rows = "".join(f"{k / 20}," + ",".join(f"{k / 20 * far}" for far in spans.values()) + "\n" for k in range(21))
    return inspect(read_recordings_from_bytes(f"time,{','.join(spans)}\n{rows}".encode(), "a.csv", Layout())).notes


def test_a_column_beside_which_the_others_hardly_count_is_noticed():
    (note,) = spans(j1=1, j2=2, gripper=85)
    assert note.startswith("gripper spans up to 85, the other columns up to 2, which hardly count")
    assert note.endswith("or choose some with --columns, or say --kind gripper=discrete")
    assert spans(j1=1, j2=2, gripper=19) == ()
    (note,) = spans(**{"x": 300, "y": 20, "pressure": 0.4})
    assert note.startswith("x, y span up to 300, the other columns up to 0.4")
    assert note.endswith("with --columns")


@pytest.mark.parametrize(
    "columns",
    [
        {"x": 50, "y": 1, "z": 1},
        {"joint1": 0.01, "elbow_angle": 2},
        {"wrist.x [mm]": 400, "thumb [mm]": 8},
        {"dim_0": 30, "dim_1": 1},
        {"force": 30, "level": 0},
    ],
)
def test_columns_of_one_kind_may_move_alone(columns):
    assert spans(**columns) == ()


U = np.linspace(-1, 1, 60)[:, None]
DOWN = Rotation.from_euler("xy", np.hstack((0.3 * U, 0.2 * U))) * Rotation.from_rotvec([np.pi, 0, 0])  # it flips


def on_rotations(heads, turned):
    """The notes on rotation vectors of a recording of a tool: its place, and three columns more."""
    table = np.hstack((U + 1, 0.1 * U, 0.2 * U**2, 0.3 * U, turned))
    rows = "".join(",".join(map(repr, row)) + "\n" for row in table.tolist())
    recordings = read_recordings_from_bytes(f"time,{','.join(heads)}\n{rows}".encode(), "a.csv", Layout())
    return [note for note in (*recordings.notes, *notes_on_samples(recordings)) if "rotation vector" in note]


@pytest.mark.parametrize(
    "head", ["{}", "tcp_{}", "TCP.{}", "pose.{}", "{} [rad]", "actual_TCP_pose_{}", "target_TCP_pose[{}]"]
)
def test_a_rotation_vector_near_half_a_turn_is_noticed_with_what_to_do(head):
    ends = [*range(6)] if "TCP_pose" in head else ["x", "y", "z", "rx", "ry", "rz"]
    heads = [head.format(end).removesuffix(" [rad]" if k < 3 else "-") for k, end in enumerate(ends)]
    (note,) = on_rotations(heads, DOWN.as_rotvec())
    assert note.startswith(f"{', '.join(heads[3:])} look like a rotation vector: near half")
    assert note.endswith("qx, qy, qz, qw instead, in Python scipy.spatial.transform.Rotation.from_rotvec(r).as_quat()")


def test_degrees_of_a_rotation_vector_are_said():
    (note,) = on_rotations(["tx", "ty", "tz", "rx [deg]", "ry [deg]", "rz [deg]"], DOWN.as_rotvec(degrees=True))
    assert note.endswith("from_rotvec(r, degrees=True).as_quat()")
    (note,) = on_rotations(["a", "b", "c", *(f"eef_rot_axis_angle.{k}" for k in range(3))], DOWN.as_rotvec())
    assert note.startswith("eef_rot_axis_angle.0, eef_rot_axis_angle.1, ")


@pytest.mark.parametrize(
    ("heads", "factor"),
    [
        ("a,b,c,rx,ry,rz", 1), ("x,y,z,fx,fy,fz", 1), ("x,y,z,rx,ry,rz", 0.3), ("x,y,z,rx,ry,rz", 9),
        ("x,y,z,rx [N],ry [N],rz [N]", 1), ("vel_x,vel_y,vel_z,vel_rx,vel_ry,vel_rz", 1),
        ("q_0,q_1,q_2,q_3,q_4,q_5", 1), (",".join(f"joint_pose_{k}" for k in range(6)), 1),
        ("x,y,z,roll,pitch,yaw", 1), ("x,y,z,hand_rx,hand_ry,hand_rz", 1),
    ],
)  # fmt: skip
def test_forces_joints_and_small_rotations_are_no_rotation_vector(heads, factor):
    assert on_rotations(heads.split(","), factor * DOWN.as_rotvec()) == []


def test_long_lists_are_cut_in_words_only_and_a_reason_of_many_files_is_said_once(tmp_path, make_movement):
    recordings(tmp_path, make_movement)
    for k in range(30):
        (tmp_path / f"a.{k:02}").write_text("")
    inspection = inspect(read_recordings(tmp_path))
    assert "  and 11 more" in as_words(inspection)
    for k in range(30):
        (tmp_path / f"a.{k:02}").rename(tmp_path / f"{k:02}.md")
    inspection = inspect(read_recordings(tmp_path))
    assert "  00.md, 01.md, 02.md and 27 more: expected a file ending in" in as_words(inspection)
    assert "  and " not in as_words(inspection)
    assert len(as_data(inspection)["problems"]) == 31


def test_many_columns_are_said_in_few_lines_and_those_that_never_move_are_named():
    t = np.linspace(0, 1, 20)
    moving = [f"joint_{k}" for k in range(30)]
    heads = ["time", *moving, "fixed_1", "fixed_2"]
    rows = [",".join(map(repr, [at, *(float(np.sin(at + k)) for k in range(30)), 1.5, 0.25])) for at in t.tolist()]
    inspection = inspect(read_recordings_from_bytes("\n".join([",".join(heads), *rows]).encode(), "a.csv", Layout()))
    words = as_words(inspection)
    assert "joint_22, joint_23 and 8 more" in words
    assert "  joint_0, joint_1, joint_2, joint_3" in words.partition("kinds:")[2]
    assert "joint_11 and 18 more: angle; wraps are taken away" in words
    assert "2 of 32 channels never move: fixed_1, fixed_2; --exclude leaves them out" in inspection.notes
    assert len(words.splitlines()) < 20
    assert as_data(inspection)["detected"][0]["columns"] == tuple(heads[1:])


@pytest.mark.parametrize("n_dims", [1, 2, 3, 5])
def test_the_picture_has_a_panel_per_label(tmp_path, make_movement, n_dims):
    read = recordings(tmp_path, make_movement, n_dims, ("wave", "a $very$ long name_of an action", "wave", None))
    figure = draw_recordings(read)
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert [title.rsplit(" ", 1)[1] for title in titles] == ["(1)", "(2)", "(1)"]
    assert titles[0] == r"a \$very\$ long name_of… (1)"
    if n_dims == 2:
        assert encode_figure(figure, "png") == encode_figure(draw_recordings(read), "png")


def test_more_labels_than_panels_are_told(make_movement):
    t, x = make_movement(0, n_samples=6)
    rows = "".join(f"l{k:02},{a},{b},{c}\n" for k in range(40) for a, (b, c) in zip(t, x, strict=True))
    read = read_recordings_from_bytes(f"label,time,x,y\n{rows}".encode(), "a.csv", Layout())
    figure = draw_recordings(read)
    assert len([axes for axes in figure.axes if axes.get_title()]) == 30
    assert "the first 30 of 40 labels" in figure.legends[0].get_texts()[2].get_text()
