"""Columns that are no coordinates: derivatives and confidences of positions, and numbers that stand for no value."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import kineme
from kineme.io.inspection.inspect import inspect
from kineme.io.reading.column_order import notes_on_aside
from kineme.io.reading.merge_files import notes_on_gaps
from kineme.io.writing.write_movement import write_movement
from kineme.movements.tables.layout import Layout
from recordings_in_bytes import read_recordings_from_bytes

T = 40
U = np.linspace(0, 1, T)


def _written(path, heads, values=None):
    columns = {head: np.sin((k + 1) * U) for k, head in enumerate(heads)}
    pd.DataFrame({"t": U} | columns | (values or {})).to_csv(path, index=False)
    return path


@pytest.mark.parametrize(
    ("positions", "others"),
    [
        (["x", "y"], ["x_vel", "y_velocity", "vx", "dy", "x_dot", "x_acc", "ay", "a_x"]),
        (["x [mm]", "y [mm]"], ["x_velocity [mm/s]", "vy [mm/s]"]),
        (["pos_x", "pos_y"], ["vel_x", "acc_y", "xVel"]),
        (["joint1_position", "elbow"], ["joint1_velocity", "joint1_effort", "elbow_vel"]),
        (["nose_x", "nose_y"], ["nose_likelihood"]),
        (["x0", "y0", "Hand.X", "Hand.Y"], ["score0", "Hand.Visibility"]),
        (["x", "y"], ["confidence", "residual"]),
        (["pos_x", "y_position"], ["pos_x_vel", "a_y_position", "pos_confidence"]),
        (["q[0]", "actual_q_0"], ["dq[0]", "actual_qd_0", "qdot[0]"]),
        (["HandRight_X", "HandRight_Y"], ["HandRight_State", "HandRight_TrackingState"]),
        (["norm_pos_x", "norm_pos_y", "observation.state.x"], ["confidence", "Status (hex)"]),
    ],
)
def test_derivatives_and_confidences_are_left_aside_beside_their_positions(tmp_path, positions, others):
    path = _written(tmp_path / "a.csv", [*positions, *others])
    read = kineme.read_recordings(path)
    assert read.detected[0][0].columns == tuple(positions)
    (note,) = notes_on_aside(how for how, _ in read.detected)
    assert all(head in note for head in others[:6])
    assert "--columns" in note
    assert note in inspect(read).notes
    recordings = kineme.read_recordings(path, columns=[*positions, *others])
    assert recordings.demonstrations.n_dims == len(positions) + len(others)


@pytest.mark.parametrize(
    "heads",
    [
        ("vx", "vy"), ("acc_x", "acc_y", "gyro_x"), ("score", "x2"), ("ear_score", "nose_x"), ("x", "state"),
        ("observation.state.0", "observation.state.x"), ("hand_x", "gripper_status"), ("thumb", "right_index"),
    ],
)  # fmt: skip
def test_the_same_words_without_such_positions_are_coordinates(tmp_path, heads):
    read = kineme.read_recordings(_written(tmp_path / "a.csv", heads))
    assert read.detected[0][0].columns == heads
    assert notes_on_aside(how for how, _ in read.detected) == []


def test_counters_and_clocks_of_devices_are_left_aside_if_they_count(tmp_path):
    counters = {"world_index": np.arange(T) // 2 + 40, "RDTSequence": 4000 + np.arange(T), "SampleTimeFine": 333.0 * U}
    path = _written(tmp_path / "a.csv", ["x", "goal_index"], counters)
    for demos in (kineme.read_recordings(path).demonstrations, kineme.Demonstrations.of(pd.read_csv(path))):
        assert demos.dimensions == ("x", "goal_index")
    notes = inspect(kineme.read_recordings(_written(tmp_path / "b.csv", ["x"], {"ticks": 10 * np.arange(T)}))).notes
    assert "ticks counts in steps of 10; if it is no coordinate, --exclude leaves it out" in notes


@pytest.mark.parametrize(
    "heads",
    [
        "x,y", "x [mm],y [mm]", "hand_x_m,hand_y_m", "tcp_x,tcp_y", "a,b", "a_x,a_y", "q1,q2", "column 1,column 2",
        "pos", "pos_x,pos_y", "pose.position.x,pose.position.y", "joint1_position,joint2_position",
        "position_x,position_y", "x position,y position", "Pos X (mm),Pos Y (mm)", "Position X,Position Y",
        "Position (x),Position (y)",
        "/pose/position/x,/pose/position/y", "position[0],position[1]", "posX,posY", "x_pos,y", "position,angle",
        "shoulder_pan.pos,elbow_flex.pos", "left pos x,left pos y,right pos x,right pos y", "pos_x_mm,pos_y_mm",
        "vx,vy", "v_x,v_y", "velocity_x,velocity_y", "acc_x,acc_y,acc_z", "speed", "confidence", "dx,dy", "pos_vel,x",
    ],
)  # fmt: skip
def test_what_is_generated_has_the_columns_of_its_demonstration_whatever_their_names(tmp_path, heads):
    demos = kineme.read_recordings(_written(tmp_path / "a.csv", heads.split(","))).demonstrations
    path = write_movement(tmp_path / "new.csv", kineme.DMP().learn(demos).rollout())
    assert path.read_text().splitlines()[0].count(",") == 3 * demos.n_dims
    read = kineme.read_recordings(path).demonstrations.channels
    assert [channel.columns for channel in read] == [channel.columns for channel in demos.channels]
    assert [channel.kind for channel in read] == [channel.kind for channel in demos.channels]


def test_counters_numbers_of_things_and_other_clocks_are_no_coordinates(tmp_path):
    clocks = ["epoc (ms)", "motionTimestamp_sinceReboot(s)"]
    others = ["PacketCounter", "loggingSample(N)", "stroke_id", "TrackingId", "__index_level_0__", *clocks]
    counted = dict.fromkeys(others[:2], np.arange(T))
    read = kineme.read_recordings(
        _written(tmp_path / "a.csv", [*(own := ["x", "low (min)", "GSR [uS]", "EDA (mS)"]), *others], counted)
    )
    assert [*read.detected[0][0].columns] == own
    assert {*read.detected[0][0].ignored} == {*others}
    sessions = np.repeat([0.0, 1.0], T // 2)
    read = kineme.read_recordings(_written(tmp_path / "a.csv", ["x"], {"session": sessions}))
    assert (read.demonstrations.dimensions, len(read)) == (("x",), 2)


COUNT = np.arange(T)


@pytest.mark.parametrize("to", ["csv", "parquet", "json", "frame"])
@pytest.mark.parametrize(
    ("columns", "aside"),
    [
        ({"thumb": U, "index": np.sin(U), "ring": U}, set()),
        ({"thumb": U, "index": np.rint(9 * np.sin(3 * U)), "ring": U}, set()),
        ({"index_1": np.sin(U), "index_2": U}, set()),
        ({"row": np.full(T, 5), "col": U}, set()),
        ({"index": COUNT, "thumb_x": U, "index_x": np.sin(U)}, {"index"}),
        ({"frame": COUNT // 10, "sub frame": COUNT % 10, "x": U}, {"frame", "sub frame"}),
        ({"packet": (COUNT + 65_530) % 65_536, "num_bodies": COUNT % 3, "x": U}, {"packet", "num_bodies"}),
        ({"frame": COUNT + (COUNT > 9), "task_index": 0 * COUNT, "x": U}, {"frame", "task_index"}),
        ({"demo": COUNT // 20, "frame": np.where(COUNT < 20, COUNT, COUNT - 15), "x": U}, {"demo", "frame"}),
    ],
)  # fmt: skip
def test_columns_that_are_named_as_counters_are_left_aside_if_they_count(tmp_path, columns, aside, to):
    frame, path = pd.DataFrame({"t": U} | columns), tmp_path / f"a.{to}"
    if to == "frame":
        read = kineme.Demonstrations.of(frame).dimensions
    else:
        path.write_text(frame.to_json(orient="records")) if to == "json" else getattr(frame, f"to_{to}")(
            path, index=False
        )
        read = kineme.read_recordings(path).detected[0][0].columns
    assert read == tuple(head for head in columns if head not in aside)


def test_dates_that_are_not_understood_are_no_names_before_the_times():
    for stamp in ("01/05/2024 10:00:01.000", "5.1.2024 9:00", "10:00:01.000 ->"):
        text = "\n".join(f"{stamp},{u},{np.sin(u)}" for u in U)
        with pytest.raises(
            kineme.errors.DataError, match=r"expected times such as .* in the first column, got .* write them so"
        ):
            read_recordings_from_bytes(text.encode(), "a.csv", Layout())
    text = "\n".join(f"arm2,{u},{np.sin(u)}" for u in U)
    assert read_recordings_from_bytes(text.encode(), "a.csv", Layout()).demonstrations.durations.tolist() == [1.0]


@pytest.mark.parametrize("sentinel", [-9999, 999, -99999.0, 1e20, 3.4028234663852886e38, -32768])
def test_a_number_that_stands_for_no_value_is_missing_and_said(tmp_path, sentinel):
    lost = np.where((U > 0.4) & (U < 0.5), sentinel, np.sin(U))
    read = kineme.read_recordings(_written(tmp_path / "a.csv", ["y"], {"x": lost}))
    np.testing.assert_allclose(read.demonstrations.positions[:, 1], np.sin(U), atol=1e-4)
    assert f"{sentinel:g} in x counts as no value" in notes_on_gaps(read)[0]
    assert read.sources[0].filled == 4


@pytest.mark.parametrize("reach", [600, 2000])
def test_a_number_within_reach_of_the_others_is_a_value(tmp_path, reach):
    x = np.where(U > 0.9, 999, reach * U)
    read = kineme.read_recordings(_written(tmp_path / "a.csv", ["y"], {"x": x, "z": np.full(T, 999)}))
    np.testing.assert_allclose(read.demonstrations.positions[:, 1:], np.column_stack([x, np.full(T, 999)]))
    assert notes_on_gaps(read) == []


def test_long_stretches_of_such_a_number_are_refused_as_gaps(tmp_path):
    lost = np.where((U > 0.2) & (U < 0.8), -9999, np.sin(U))
    with pytest.raises(kineme.errors.KinemeError, match=r"got nothing in .*--fill-gaps"):
        kineme.read_recordings(_written(tmp_path / "a.csv", ["y"], {"x": lost}))


@pytest.mark.parametrize("to", ["csv", "parquet", "json", "rated", "frame"])
@pytest.mark.parametrize(("step", "skips"), [(1, True), (2, False)])
def test_samples_that_a_counter_skips_take_their_time(tmp_path, to, step, skips):
    frames = step * np.array([*range(20), *range(30, 60)])
    table, path = pd.DataFrame({"frame": frames, "x": np.sin(frames)}), tmp_path / f"a.{to}"
    if to == "frame":
        movement = kineme.Demonstrations.from_dataframe(table, units=0.1)[0]
    elif to == "rated":
        path = tmp_path / "a.json"
        path.write_text(f'{{"fps": 10, "frames": {table.to_json(orient="records")}}}')
        movement = kineme.read_recordings(path).demonstrations[0]
    else:
        write = {"csv": table.to_csv, "parquet": table.to_parquet}.get(to)
        write(path, index=False) if write else table.to_json(path, orient="records")
        movement = kineme.read_recordings(path, units=0.1).demonstrations[0]
    np.testing.assert_allclose(movement.times - movement.times[0], 0.1 * (frames if skips else np.arange(50)))
