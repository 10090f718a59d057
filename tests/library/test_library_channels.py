"""A library keeps what was recorded: names, quaternions and grippers come back, and are generated."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from dataclasses import replace
from itertools import chain

import numpy as np
import pandas as pd
import pytest

import kineme
from kineme import ActionLibrary, Demonstrations
from kineme.dmp.generation.generate import MovementOptions, generate
from kineme.errors import DataError, TrajectoryError
from kineme.library.grounding import learned_of
from kineme.library.recognize import LibraryRecognizer
from kineme.library.storage.channels import channels_of_text, other_columns
from kineme.library.storage.connection import FILE
from kineme.library.storage.read import movements
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import PoseDMP, exp, product

CHANNELS = (
    Channel("gripper", "discrete", ("gripper",)),
    *(Channel(f"tool.{axis}", "position", (f"tool.{axis}",), "m") for axis in "xyz"),
    Channel("tool.q", "orientation", ("tool.qx", "tool.qy", "tool.qz", "tool.qw"), None, "xyzw"),
)


def poses(n=6, channels=CHANNELS, seed=0):
    """Movements of two kinds, of unequal length, with a tool that turns and a gripper that opens."""
    random, blocks, labels = np.random.default_rng(seed), [], []
    for i in range(n):
        u = np.linspace(0, 1, 40 + i)
        s = u**3 * (10 - 15 * u + 6 * u**2)
        q = product(exp(np.outer(s, random.normal(size=3) + np.array([0, 0, 3 * (i % 2)]))), exp(random.normal(size=3)))
        xyz = np.outer(s, random.normal(size=3) + 5 * (i % 2)) + np.outer(np.sin(np.pi * u), random.normal(size=3))
        blocks.append(np.column_stack([u > 0.3 + 0.1 * (i % 3), xyz, q[:, [1, 2, 3, 0]]]))
        labels.append("ab"[i % 2])
    plain = Demonstrations.from_arrays(blocks, labels, [np.linspace(0, 2, len(block)) for block in blocks])
    return Demonstrations.of_movements(of_channels(plain.movements, channels))


@pytest.fixture
def library(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as actions:
        actions.learn(poses())
        yield actions


def test_what_was_recorded_comes_back_in_any_order(library, tmp_path):
    demos = poses()
    stored = movements(library.store, np.array([4, 1, 6]))
    chosen = demos[[3, 0, 5]]
    assert stored.channels == CHANNELS
    assert stored.dimensions == demos.dimensions
    np.testing.assert_allclose(stored.recorded, chosen.recorded, atol=1e-6)
    assert set(stored.recorded[:, 0]) == {0.0, 1.0}
    np.testing.assert_allclose(np.linalg.norm(stored.recorded[:, 4:], axis=1), 1, atol=1e-12)
    assert library.verify() == []
    with ActionLibrary.import_(library.export(tmp_path / "a.kineme-library"), tmp_path / "again") as again:
        np.testing.assert_array_equal(movements(again.store, np.array([4, 1, 6])).recorded, stored.recorded)
        assert again.verify() == []


def test_what_a_gripper_said_comes_back_exactly(tmp_path):
    """Single precision would say 0.0799999982, which no program finds equal to the 0.08 that was recorded."""
    t = np.linspace(0, 1, 20)
    shown = pd.DataFrame({"t": t, "x": t, "y": t**2, "gripper": np.where(t > 0.6, 0.08, -1.1e-3)})
    with ActionLibrary(tmp_path / "new", create=True) as actions:
        actions.learn(Demonstrations.of(shown), ["a"])
        np.testing.assert_array_equal(actions.movements("a")[0].recorded[:, 2], shown["gripper"])


def test_movements_that_differ_in_a_gripper_or_in_where_the_tool_points_are_two(library):
    same = poses()
    assert library.learn(same).added == 0
    columns = same.recorded.copy()
    columns[:, 0] = 1 - columns[:, 0]
    turned = replace(same.movements, recorded=columns)
    assert library.learn(Demonstrations.of_movements(turned)).added == len(same)


def test_a_symbol_generates_unit_quaternions_and_the_gripper_under_their_names(library):
    options = MovementOptions(goal=np.array([1.0, 2, 3, 0, 0, 0, 1]), settle=0.01)
    generated = generate(learned_of(library.store, "a"), options)
    names = [[f"{name} [{channel.unit}]" if channel.unit else name for name in channel.columns] for channel in CHANNELS]
    assert generated.names.positions == tuple(chain(*names))
    np.testing.assert_allclose(np.linalg.norm(generated.columns["positions"][:, 4:], axis=1), 1)
    np.testing.assert_allclose(generated.columns["positions"][-1, 1:4], [1, 2, 3], atol=0.05)
    assert abs(generated.columns["positions"][-1, 7]) > 0.99
    steps = np.abs(np.diff(generated.columns["positions"][:, 0]))
    assert sorted(set(steps)) == [0.0, 1.0]
    assert steps.sum() == 1


def test_other_channels_are_refused_by_name(library):
    other = tuple(
        channel if channel.kind != "discrete" else channel._replace(name="claw", columns=("claw",))
        for channel in CHANNELS
    )
    with pytest.raises(TrajectoryError, match=r"as all others of the library .*, got \['claw', 'tool.x'"):
        library.learn(poses(channels=other))
    with pytest.raises(TrajectoryError, match="got plain coordinates"):
        library.learn(Demonstrations.from_arrays(np.cumsum(np.random.default_rng(0).normal(size=(2, 30, 6)), axis=1)))


def test_names_of_plain_columns_bind_nobody(tmp_path):
    paths = np.cumsum(np.random.default_rng(0).normal(size=(3, 30, 2)), axis=1)
    channels = tuple(Channel(name, "position", (name,)) for name in ("a", "b"))
    named = Demonstrations.of_movements(of_channels(Demonstrations.from_arrays(paths).movements, channels))
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(named[:2])
        library.learn(paths[2:])
        assert movements(library.store, np.array([1, 2, 3])).channels == channels
        assert library.verify() == []


def test_angles_are_stored_once_with_the_positions():
    channels = (Channel("joint", "angle", ("joint",)), *CHANNELS)
    assert other_columns(channels) == [1, 5, 6, 7, 8]
    assert other_columns(channels[:1]) == []


def test_angles_beside_orientations_come_back_as_precisely_as_positions(tmp_path):
    random = np.random.default_rng(0)
    channels = (Channel("joint1", "angle", ("joint1",), "rad"), *CHANNELS)
    plain = poses()
    joint = np.cumsum(random.normal(size=len(plain.positions)))[:, None] * 1e-3 + 2.0
    columns = np.concatenate((joint, plain.recorded), axis=1)
    demos = of_channels(replace(plain.movements, positions=columns, recorded=None), channels)
    with ActionLibrary(tmp_path / "joints", create=True) as library:
        library.learn(Demonstrations.of_movements(demos))
        stored = movements(library.store, np.arange(1, 7))
        np.testing.assert_array_equal(stored.recorded[:, 0], stored.positions[:, 0])
        np.testing.assert_allclose(stored.recorded, demos.recorded, atol=1e-6)


@pytest.mark.parametrize("spoil", [lambda blob: blob[:-4], lambda blob: blob + blob[:4], lambda blob: b""])
def test_columns_of_another_size_are_refused(library, spoil):
    folder = library.store.folder
    library.close()
    with closing(sqlite3.connect(folder / FILE)) as connection, connection:
        from kineme.library.storage.rows import seal

        table = connection.execute("SELECT * FROM recorded WHERE movement = 1")
        names = [column[0] for column in table.description]
        row = dict(zip(names, table.fetchone(), strict=True))
        (blob,) = [name for name, value in row.items() if isinstance(value, bytes)]
        row[blob] = spoil(row[blob])
        crc = seal("recorded", tuple(value for name, value in row.items() if name != "crc"))
        connection.execute(f"UPDATE recorded SET {blob} = ?, crc = ? WHERE movement = 1", (row[blob], crc))
    with ActionLibrary(folder, read_only=True) as damaged, pytest.raises(DataError, match="recorded"):
        movements(damaged.store, np.array([1]))


def _spoiled(**changes):
    channels = [channel._asdict() for channel in CHANNELS]
    channels[changes.pop("at")] |= changes
    return json.dumps(channels)


@pytest.mark.parametrize(
    "text",
    [
        _spoiled(at=4, order="zyxw"),
        _spoiled(at=4, order=""),
        _spoiled(at=1, order="wxyz"),
        _spoiled(at=0, kind="angle"),
        _spoiled(at=4, columns=["a", "b", "c"]),
        _spoiled(at=1, columns=["a", "b"]),
        _spoiled(at=1, kind="color"),
        _spoiled(at=1, unit=5),
        _spoiled(at=1, name=None),
    ],
)
def test_a_channel_of_which_one_thing_is_wrong_is_refused(text, tmp_path):
    with pytest.raises(DataError, match="recorded as"):
        channels_of_text(text, 6, tmp_path)
    assert channels_of_text(json.dumps([channel._asdict() for channel in CHANNELS]), 6, tmp_path) == CHANNELS


@pytest.mark.parametrize("text", ["[]", "x", '[{"name": 1}]', "[" * 100_000])
def test_channels_that_are_none_are_refused(library, text):
    folder = library.store.folder
    library.close()
    with closing(sqlite3.connect(folder / FILE)) as connection, connection:
        from kineme.library.storage.rows import seal

        row = ("channels", text)
        connection.execute("UPDATE meta SET value = ?, crc = ? WHERE key = 'channels'", (text, seal("meta", row)))
    with ActionLibrary(folder, read_only=True) as damaged, pytest.raises(DataError, match="recorded as"):
        movements(damaged.store, np.array([1]))


def test_recognition_and_prediction_are_those_of_the_recognizer(library):
    questions = poses(seed=3)
    expected = kineme.Recognizer().fit(poses()).predict(questions)
    assert [answer.ranked[0] for answer in library.recognize(questions)] == expected.tolist()


def test_a_library_says_what_it_was_recorded_as_and_refuses_other_kinds(library):
    assert library.channels == CHANNELS
    plain = tuple(Channel(f"j{k}", "position", (f"j{k}",)) for k in range(6))
    walks = Demonstrations.from_arrays(np.cumsum(np.random.default_rng(0).normal(size=(2, 30, 6)), axis=1))
    with pytest.raises(TrajectoryError, match=r"expected movements recorded as gripper \(disc.* got j0 \(position\)"):
        library.recognize(Demonstrations.of_movements(of_channels(walks.movements, plain)))
    with pytest.raises(TrajectoryError, match=r"expected .* of the library in .*, or make another library$"):
        library.learn(Demonstrations.of_movements(of_channels(walks.movements, plain)))


def test_recorded_columns_without_channels_are_recognized_and_learned_as_those_of_the_library(library):
    questions = poses(seed=3)
    raw = [kineme.Trajectory(movement.times, movement.recorded, movement.label) for movement in questions]
    expected = [answer.ranked[0] for answer in library.recognize(questions)]
    assert [answer.ranked[0] for answer in library.recognize(raw)] == expected
    assert library.learn(questions).added == 6
    assert library.learn(raw).added == 0
    counted = tuple(Channel(f"x{k}", "position", (f"x{k}",)) for k in range(1, questions.recorded.shape[1] + 1))
    read = Demonstrations.of_movements(of_channels(Demonstrations.of(raw).movements, counted))  # as from an array file
    assert [answer.ranked[0] for answer in library.recognize(read)] == expected
    assert library.learn(read).added == 0
    assert library.verify() == []


def nameless(demos):
    """Poses as arrays: positions, and quaternions (w, x, y, z)."""
    blocks = np.split(demos.recorded[:, [1, 2, 3, 7, 4, 5, 6]], demos.offsets[1:-1])
    return Demonstrations.from_arrays(blocks, demos.labels, [movement.times for movement in demos])


@pytest.mark.parametrize("exhaustive", [0, 100])
@pytest.mark.parametrize("shown", [nameless, lambda demos: demos], ids=["nameless", "named"])
def test_generated_poses_are_recognized(library, exhaustive, shown):
    generated = PoseDMP().learn(shown(poses())).rollout(n_samples=100)
    recognizer = LibraryRecognizer(library.store, exhaustive=exhaustive)
    assert [answer.label for answer in recognizer.recognize(generated)] == list("ababab")


def test_generated_poses_are_learned_as_poses(tmp_path):
    generated = PoseDMP().learn(nameless(poses())).rollout(n_samples=100)
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(generated)
        assert library.n_dims == 6
        assert [channel.kind for channel in library.channels] == ["position"] * 3 + ["orientation"]
        assert library.learn(generated).added == 0
        assert library.verify() == []
    with ActionLibrary(tmp_path / "plain", create=True) as library:
        library.learn(generated.positions, labels=list(generated.labels))
        assert (library.n_dims, library.channels) == (7, None)
        assert library.learn(generated[:2]).added == 2, "of plain columns more of them"


def test_angles_of_a_stored_library_wrap_by_what_they_were_recorded_with(tmp_path):
    turns = np.cumsum(np.abs(np.random.default_rng(0).normal(size=(4, 60, 1))), axis=1) / 2
    angles = np.concatenate([(turns + np.pi) % (2 * np.pi) - np.pi, np.cos(turns)], axis=2)
    channels = (Channel("joint", "angle", ("joint",)), Channel("x", "position", ("x",)))
    raw = Demonstrations.from_arrays(angles, list("abab"))
    demos = Demonstrations.from_dataframe(
        [
            pd.DataFrame({"t": movement.times, "joint": movement.positions[:, 0], "x": movement.positions[:, 1]})
            for movement in raw
        ]
    )
    assert demos.channels == (channels[0]._replace(period=2 * np.pi), channels[1])
    assert np.ptp(demos.positions[:, 0]) > 13, "more than a turn, so that values alone would be degrees"
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(demos, labels=list("abab"))
    with ActionLibrary(tmp_path / "actions") as library:
        assert library.channels == demos.channels
        assert [answer.ranked[0] for answer in library.recognize(list(angles))] == list("abab")
        learned = LibraryRecognizer(library.store).current().model.comparison.checked(list(angles))
        np.testing.assert_allclose(learned.positions, demos.positions, atol=1e-9)


@pytest.mark.parametrize("first", ["in steps", "continuously"])
def test_columns_of_the_same_names_are_learned_as_the_library_has_them(tmp_path, first):
    t = np.linspace(0, 2, 60)

    def recorded(gripper, seed):
        x = np.sin(3 * t + 0.1 * seed)
        return Demonstrations.of(pd.DataFrame({"t": t, "x": x, "y": t, "gripper": gripper}))

    shown = {"in steps": recorded(np.round(t / 2), 0), "continuously": recorded(np.clip(t - 0.5, 0, 1), 1)}
    assert [channel.kind for channel in shown["in steps"].channels] != [
        channel.kind for channel in shown["continuously"].channels
    ]
    with ActionLibrary(tmp_path / "grips", create=True) as actions:
        actions.learn(shown.pop(first), ["grip"])
        before = actions.channels
        actions.learn(shown.popitem()[1], ["grip"])
        assert actions.channels == before
        assert len(actions) == 2
        assert {answer.label for answer in actions.recognize(recorded(np.round(t / 2), 0))} == {"grip"}


def frames(heads, columns):
    """Movements of two kinds as data frames."""
    u = np.linspace(0, 1, 50)
    shapes = [np.column_stack([u, bend * u**2, np.sin(bend * u)]) for bend in (0.5, 3.0, 0.6, 3.2)]
    tables = [pd.DataFrame(dict(zip(["t", *heads], np.column_stack([u, columns(x)]).T, strict=True))) for x in shapes]
    return Demonstrations.from_dataframe(tables)


OTHER_UNITS = {
    "millimeters": (("x [mm]", "y [mm]", "z [mm]"), lambda x: 1000 * x),
    "order": (("z [m]", "x [m]", "y [m]"), lambda x: x[:, [2, 0, 1]]),
    "both": (("Z [cm]", "x_mm", "y [m]"), lambda x: x[:, [2, 0, 1]] * [100, 1000, 1]),
}


@pytest.mark.filterwarnings("ignore:units are converted")
@pytest.mark.parametrize("other", OTHER_UNITS)
def test_columns_are_learned_and_recognized_by_name_in_the_unit_of_the_library(tmp_path, other):
    shown, question = frames(("x [m]", "y [m]", "z [m]"), lambda x: x), frames(*OTHER_UNITS[other])
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(shown, list("abab"))
        before = library.channels
        answers = library.recognize(question)
        assert [answer.label for answer in answers] == list("abab")
        np.testing.assert_allclose([answer.transform.scale[0] for answer in answers], 1.0, rtol=1e-3)
        assert library.learn(question).ids.tolist() == [1, 2, 3, 4], "they are the same movements"
        assert library.channels == before
        assert library.verify() == []


def test_degrees_and_radians_are_one_in_a_library(tmp_path):
    rad, deg = (
        frames([f"j{k} [{unit}]" for k in range(3)], lambda x, size=size: size * x)
        for unit, size in (("rad", 1.0), ("degrees", 180 / np.pi))
    )
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(rad, list("abab"))
        assert library.learn(deg).ids.tolist() == [1, 2, 3, 4], "they are the same movements"


@pytest.mark.parametrize(
    ("heads", "message"),
    [
        (("elbow_roll", "temp", "volt"), r"expected the columns \['x \[m\]', .* got \['elbow_roll', 'temp', 'volt'\]"),
        (("x [V]", "y [m]", "z [m]"), r"expected 'x \[V\]' in 'm', as the others have it, got 'V', which cannot be"),
        (("x", "y", "z"), r"expected 'x' in 'm', as the others have it, got no unit"),
    ],
)
def test_other_names_and_units_are_not_learned(tmp_path, heads, message):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(frames(("x [m]", "y [m]", "z [m]"), lambda x: x))
        with pytest.raises(TrajectoryError, match=message):
            library.learn(frames(heads, lambda x: x))
        assert len(library) == 4


@pytest.mark.parametrize("heads", [("x1", "x2", "x3"), ("hand_x", "hand_y", "hand_z")])
def test_columns_without_names_are_learned_by_their_count(tmp_path, heads):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(frames(("x", "y", "z"), lambda x: x))
        assert library.learn(frames(heads, lambda x: 2 * x)).added == 4


def test_a_name_that_was_learned_in_another_place_is_not_compared_in_order(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn(frames(("x", "y", "z"), lambda x: x), list("abab"))
        with pytest.raises(TrajectoryError, match=r"\['x', 'y', 'z'\], .*got \['w', 'z', 'y'\]"):
            library.recognize(frames(("w", "z", "y"), lambda x: x))
        counted = frames(("x2", "x3", "x4"), lambda x: x)
        with ActionLibrary(tmp_path / "joints", create=True) as joints:
            joints.learn(frames(("x1", "x2", "x3"), lambda x: x), list("abab"))
            with pytest.raises(TrajectoryError, match=r"\['x1', 'x2', 'x3'\], .*got \['x2', 'x3', 'x4'\]"):
                joints.recognize(counted)
        more = [
            pd.DataFrame(
                {"t": np.linspace(0, 1, 50), "load": np.arange(50.0) % 7, "y": 3 * u**2, "x": u, "z": np.sin(3 * u)}
            )
            for u in [np.linspace(0, 1, 50)]
        ]
        assert library.recognize(Demonstrations.from_dataframe(more))[0].label == "b"


@pytest.mark.parametrize(
    ("heads", "lost"),
    [
        (["battery", "hand.y", "hand.x"], None),
        (["battery", "hand.x", "elbow.x"], r"\['hand.y'\]"),
        (["hand.x"], r"\['hand.y'\]"),
    ],
)
def test_columns_are_taken_by_name_from_recordings_with_more_and_a_missing_one_is_named(tmp_path, heads, lost):
    u = np.linspace(0, 1, 40)
    columns = {"hand.x": np.sin(3 * u), "hand.y": np.cos(2 * u), "battery": 99 - u, "elbow.x": u**2}
    for name, chosen in (("a", ["hand.x", "hand.y"]), ("more", heads)):
        pd.DataFrame({"t": u} | {head: columns[head] for head in chosen}).to_csv(tmp_path / f"{name}.csv", index=False)
    with ActionLibrary(tmp_path / "library", create=True) as actions:
        actions.learn([kineme.read_recording(tmp_path / "a.csv")], ["wave"])
        recording = kineme.read_recording(tmp_path / "more.csv")
        if lost is None:
            assert actions.recognize(recording).nearest[0].similarity == pytest.approx(1.0)
        else:
            with pytest.raises(TrajectoryError, match=f"with the columns {lost} too, which were learned, got .*--col"):
                actions.recognize(recording)


def test_a_grounding_has_the_units_of_the_recordings_and_no_others(library, tmp_path):
    assert library.ground("a")["units"]["position"] == ["m"] * 6  # turns are lengths beside positions
    assert library.ground("a", units="meters")["units"]["position"] == ["meters"] * 6
    with pytest.raises(TrajectoryError, match=r"expected m as the unit of tool\.x, as it was recorded, got mm"):
        library.ground("a", units="mm")
    with pytest.raises(TrajectoryError, match=r"expected m as the unit of tool\.q\.rz"):
        library.ground("a", units=["m", "m", "m", "m", "m", "rad"])
    some = tuple(channel._replace(unit=None) if channel.name == "tool.y" else channel for channel in CHANNELS)
    with ActionLibrary(tmp_path / "some", create=True) as other:
        other.learn(poses(channels=some))
        assert other.ground("a")["units"]["position"] is None
        assert other.ground("a", units="m")["units"]["position"] == ["m"] * 6
