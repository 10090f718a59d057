"""Primitives and rollouts say what was recorded, and go back to it: names, quaternions in their order, grippers."""

from pathlib import Path

import numpy as np
import pytest

import kineme
from kineme import Demonstrations
from kineme.dmp.recorded_as import DiscreteSteps, RecordedAs
from kineme.dmp.rhythmic.rhythmic_dmp import RhythmicPrimitives
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import PoseDMP, PosePrimitives, exp, product

GRIPPER = Channel("gripper", "discrete", ("gripper",))
TWO_HANDS = (
    GRIPPER,
    *(
        channel
        for hand, order in (("left", "xyzw"), ("right", "wxyz"))
        for channel in (
            Channel(f"{hand}.q", "orientation", tuple(f"{hand}.q{part}" for part in order), None, order),
            *(Channel(f"{hand}.{axis}", "position", (f"{hand}.{axis}",), "m") for axis in "xyz"),
        )
    ),
)
JOINTS = (
    *(Channel(f"joint{k}", "angle", (f"joint{k}",), "rad") for k in range(2)),
    Channel("tool", "orientation", tuple(f"tool.{part}" for part in "xyzw"), None, "xyzw"),
    GRIPPER,
    Channel("button", "discrete", ("button",)),
)
PLAIN = (*(Channel(name, "position", (name,), "mm") for name in ("elbow", "wrist")), GRIPPER)


def recordings(channels, n=3):
    """Movements of unequal length and duration; each discrete channel steps once, in each movement later."""
    blocks = []
    for i in range(n):
        u = np.linspace(0, 1, 60 + i)
        s = u**3 * (10 - 15 * u + 6 * u**2)
        columns = []
        for k, one in enumerate(channels):
            if one.kind == "orientation":
                q = product(exp(np.outer(s, [0.3 * k, 1 - k, 2.0 + i])), [0.0, 0.6, -0.8, 0.0])
                columns.append(q[:, ["wxyz".index(part) for part in one.order]])
            elif one.kind == "discrete":
                columns.append(2.0 * (u[:, None] > 0.3 + 0.1 * i))
            else:
                columns.append(np.sin((k + 1) * s + i)[:, None])
        blocks.append(np.concatenate(columns, axis=1))
    times = [np.linspace(5, 7 + i, len(block)) for i, block in enumerate(blocks)]
    plain = Demonstrations.from_arrays(blocks, ["a"] * n, times, [f"{i}.csv" for i in range(n)])
    return Demonstrations.of_movements(of_channels(plain.movements, channels))


LEARNED = {"two hands": (PoseDMP(), TWO_HANDS), "joints": (PoseDMP(), JOINTS), "plain": (kineme.DMP(), PLAIN)}
each = pytest.mark.parametrize("case", LEARNED)


def learned(case):
    dmp, channels = LEARNED[case]
    demos = recordings(channels)
    return dmp.learn(demos), demos


@each
def test_a_rollout_is_what_a_recording_of_the_movement_would_be(case):
    primitives, demos = learned(case)
    assert primitives.channels == demos.channels
    replay = primitives.rollout(n_samples=300)
    assert replay.channels == demos.channels
    again = replay.demonstrations
    assert (again.channels, again.dimensions) == (demos.channels, demos.dimensions)
    moving = [k for k, one in enumerate(demos.channels) for _ in one.columns]
    still = np.array([demos.channels[k].kind == "discrete" for k in moving])
    for made, was in zip(again, demos, strict=True):
        at = (was.times - was.times[0]) / was.duration
        shares = made.times / made.times[-1]
        for k in np.flatnonzero(~still):  # with the sign of the recorded quaternion
            np.testing.assert_allclose(np.interp(at, shares, made.recorded[:, k]), was.recorded[:, k], atol=2e-3)
        np.testing.assert_allclose(np.interp(at, shares, made.positions[:, 0]), was.positions[:, 0], atol=2e-3)
        for k in np.flatnonzero(still):
            stepped = np.searchsorted(was.recorded[:, k], 1.0)
            assert set(made.recorded[:, k]) == {0.0, 2.0}
            assert 0 <= shares[np.searchsorted(made.recorded[:, k], 1.0)] - at[stepped] <= 1 / 299


@each
def test_indexing_files_and_concatenation_keep_it(case, tmp_path):
    primitives, demos = learned(case)
    expected = primitives.rollout(n_samples=300).demonstrations
    loaded = type(primitives).load(primitives.save(tmp_path / "x.kineme"))
    assert loaded.channels == demos.channels
    for some in (loaded, primitives):
        chosen = some[[2, 0]].rollout(n_samples=300)
        np.testing.assert_allclose(chosen[1].recorded, expected[0].recorded, atol=1e-12)
        np.testing.assert_allclose(chosen[:1][0].recorded, expected[2].recorded, atol=1e-12)
        joined = type(some).concatenate([some[1:], some[:1]]).rollout(n_samples=300)
        np.testing.assert_allclose(joined[2].recorded, expected[0].recorded, atol=1e-12)
        np.testing.assert_allclose(joined[[2, 1]][1].recorded, expected[2].recorded, atol=1e-12)
    assert type(primitives).concatenate([primitives, primitives]).channels == demos.channels


@each
def test_one_primitive_moves_to_many_goals_with_its_steps(case):
    primitives, _ = learned(case)
    many = primitives[1].rollout(goal=np.tile(primitives[0].goals, (4, 1)), settle=0.01)
    assert many.channels == primitives.channels
    for one in many[1:]:
        np.testing.assert_allclose(one.recorded, many[0].recorded, atol=1e-12)
    k = [one.kind for one in many.channels for _ in one.columns].index("discrete")
    assert many[3].times[np.argmax(many[3].recorded[:, k])] == pytest.approx(1.25, abs=0.02)


def test_several_orientations_step_as_they_roll_out():
    primitives, _ = learned("two hands")
    goal = np.concatenate((np.arange(6.0), exp([0, 0.5, 2]), exp([1.0, 0, 1])))
    path = primitives[0].rollout(goal=goal, n_samples=101, duration=3.0)
    controller = primitives[0].controller(0.03, goal=goal, duration=3.0)
    states = [controller.step() for _ in range(100)]
    for name, made in (("position", "positions"), ("velocity", "velocities"), ("acceleration", "accelerations")):
        stepped = np.array([getattr(state, name) for state in states])
        np.testing.assert_allclose(stepped, getattr(path, made)[0, 1:], atol=1e-9)
    assert states[-1].orientation.shape == (8,)
    np.testing.assert_array_equal(path.positions[0, :, 6:], path.orientations[0])
    np.testing.assert_allclose(np.linalg.norm(path.orientations.reshape(-1, 4), axis=1), 1)
    controller.step(goal=primitives.goals[1], position=path.positions[0, -1], velocity=np.zeros(12))
    np.testing.assert_allclose(controller.state.goal[:6], primitives.goals[1, :6], atol=1e-12)
    turned = controller.state.goal[6:].reshape(2, 4), primitives.goals[1, 6:].reshape(2, 4)
    np.testing.assert_allclose(np.abs((turned[0] * turned[1]).sum(axis=1)), 1)


def test_an_orientation_learned_as_its_rotation_has_channels_and_no_way_back(tmp_path):
    primitives = kineme.DMP().learn(recordings(TWO_HANDS))
    assert primitives.channels == TWO_HANDS
    assert kineme.dmp.Primitives.load(primitives.save(tmp_path / "x.kineme")).channels == TWO_HANDS
    assert primitives.rollout().channels == TWO_HANDS
    assert primitives.rollout().demonstrations.channels is None


def test_trimming_moves_the_steps_too():
    demos = recordings(PLAIN, 1)
    held = np.concatenate((np.tile(demos.recorded[0], (40, 1)), demos.recorded))
    longer = of_channels(Demonstrations.from_arrays([held], times=[np.linspace(0, 5, len(held))]).movements, PLAIN)
    resting = Demonstrations.of_movements(longer)
    kept = Demonstrations.of_movements(kineme.TrimRest().apply(resting))[0]
    made = kineme.DMP(preprocessing=(kineme.TrimRest(), kineme.Smooth(15.0))).learn(resting).rollout(n_samples=300)[0]
    stepped = kept.times[np.argmax(kept.recorded[:, 2])] - kept.times[0]
    assert kept.duration < 4
    assert made.times[np.argmax(made.recorded[:, 2])] == pytest.approx(stepped, abs=0.02)


def test_rhythms_keep_names(tmp_path):
    t = np.linspace(0, 4, 400)
    waves = np.column_stack([np.sin(3 * np.pi * t), np.cos(3 * np.pi * t), t > 1])
    demos = of_channels(Demonstrations.from_arrays([waves], times=[t]).movements, PLAIN)
    primitives = kineme.RhythmicDMP().learn(Demonstrations.of_movements(demos))
    assert RhythmicPrimitives.load(primitives.save(tmp_path / "x.kineme"))[:1].channels == PLAIN
    assert primitives.rollout(n_periods=2).demonstrations.channels is None


def test_batches_of_other_channels_lose_them():
    a, b = learned("plain")[0], kineme.DMP().learn(recordings((PLAIN[1], PLAIN[0], GRIPPER)))
    with pytest.raises(kineme.errors.TrajectoryError, match="their order differs"):
        kineme.dmp.Primitives.concatenate([a, b])
    others = tuple(Channel(name, "position", (name,)) for name in ("hip", "knee"))
    assert kineme.dmp.Primitives.concatenate([a, kineme.DMP().learn(recordings((*others, GRIPPER)))]).channels is None


def test_files_of_before_channels_are_read():
    old = PosePrimitives.load(Path(__file__).parent / "pose_without_channels.kineme")
    assert (old.labels.tolist(), old.names, old.channels) == (["turn"], ("old",), None)
    np.testing.assert_allclose(old.goals[0], [1, 2, 3, *exp([0.2, 0.5, 1.0])])
    assert old.rollout()[0].positions.shape == (200, 7)


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("step_shares", lambda steps: steps + 0.5),
        ("step_shares", lambda steps: steps[::-1].copy()),
        ("step_offsets", lambda steps: steps * 0),
        ("step_offsets", lambda steps: steps[:-1]),
        ("step_values", lambda steps: steps[:, :0]),
    ],
)
def test_steps_that_are_none_are_refused(tmp_path, name, spoil):
    path = learned("plain")[0].save(tmp_path / "x.npz")
    with np.load(path) as archive:
        arrays = dict(archive)
    arrays[name] = spoil(arrays[name])
    np.savez(path, **arrays)
    with pytest.raises(kineme.errors.DataError, match=name):
        kineme.dmp.Primitives.load(path)


def test_what_is_made_of_primitives_knows_what_was_recorded():
    """Averages, variants, tasks between those that were shown: the columns keep names, kinds and units."""
    joints = PLAIN[:2]
    primitives = kineme.DMP().learn(recordings(joints, 5))
    average = kineme.styles.average(primitives)
    point = average.primitive.rollout(n_samples=5).positions[0, 2]
    better = kineme.improve(primitives[:1], lambda rollout: rollout.positions[:, 3, 0], updates=1)
    made = (
        average.primitive,
        average.sample(3, seed=0),
        average.condition(t=0.5, position=point).primitive,
        average.blend(average, 0.5).primitive,
        kineme.dmp.Contextual().fit(primitives, parameters=np.arange(5.0)).primitive([0.5, 1.5]),
        better.primitive,
    )
    for one in made:
        assert one.channels == joints
        assert one.rollout().demonstrations.channels == joints
    stepping = kineme.styles.average(kineme.DMP().learn(recordings(PLAIN, 5))).primitive
    assert stepping.channels == PLAIN  # when the gripper of an average steps nobody has shown
    assert stepping.to_recording is None


def test_a_join_keeps_the_gripper_of_each_part():
    primitives = kineme.DMP().learn(recordings(PLAIN, 4))
    for overlap in (0.0, 0.5):
        both = kineme.join([primitives[:2], primitives[2:]], shift=True, overlap=overlap)
        assert both.channels == PLAIN
        for i, made in enumerate(both.rollout(n_samples=4001)):
            begin = primitives.durations[i] - overlap
            since = primitives.recorded_as.steps.shares.reshape(4, 2)[:, 1]
            expected = [since[i] * primitives.durations[i], begin, begin + since[i + 2] * primitives.durations[i + 2]]
            found = made.times[np.flatnonzero(np.diff(made.recorded[:, -1])) + 1] - made.times[0]
            np.testing.assert_allclose(found, expected, atol=1.1 * made.duration / 4000)
    turning = kineme.blend(primitives[0], primitives[1], (0.4, 0.6))
    assert turning.channels == PLAIN
    assert turning.to_recording is not None
    other = kineme.DMP().learn([np.random.default_rng(0).normal(size=(50, 2)).cumsum(axis=0)])
    assert kineme.join([primitives[0], other], shift=True).channels is None


def test_a_batch_of_which_some_steps_are_unknown_has_none():
    primitives = kineme.DMP().learn(recordings(PLAIN, 4))
    average = kineme.styles.average(primitives).primitive
    some = kineme.dmp.Primitives.concatenate([average, primitives])
    assert some.channels == PLAIN
    assert some.to_recording is None
    assert len(some.rollout().positions) == 5


def test_a_step_is_at_its_share_but_for_rounding():
    steps = DiscreteSteps(np.array([[0.0], [1.0]]), np.array([0.0, 0.3]), np.array([0, 2]))
    shares = np.array([0.0, 0.3 - 1e-6, 0.3 - 1e-12, 0.3, 2.0])
    np.testing.assert_array_equal(steps.at(0, shares)[:, 0], [0, 0, 1, 1, 1])


def test_rates_are_put_into_the_order_of_the_recording():
    """Three of an orientation before two positions: the order there is not its own inverse."""
    about = RecordedAs((*JOINTS[2:3], *PLAIN[:2]))
    assert about.rate_names == ("elbow", "wrist", "tool.rx", "tool.ry", "tool.rz")
    assert [about.rate_names[k] for k in about.rates_in_order] == ["tool.rx", "tool.ry", "tool.rz", "elbow", "wrist"]
