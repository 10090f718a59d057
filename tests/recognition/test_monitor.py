"""Executions of a movement, inside what was shown or not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kineme
from kineme import ActionLibrary, Demonstrations
from kineme.errors import SpecificationError, TrajectoryError
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.orientation import exp, product
from kineme.recognition import Monitor
from kineme.recognition.early.live_state import LiveStatus
from kineme.recognition.monitor import N_PHASES, corridor, jitter
from soaking import slow

TIMES = np.linspace(0.0, 2.0, 120)


def draw(n, seed=0, d=3, spread=0.03, kind=0):
    """Movements of one kind: a curve of size 1 to 2, and smooth deviations from it that vanish at the start."""
    u = np.linspace(0, 1, len(TIMES))
    random, shape = np.random.default_rng(seed), np.random.default_rng(100 + kind)
    waves = np.sin(np.pi * u[:, None] * np.arange(0.5, 4))
    mean = waves @ shape.normal(size=(waves.shape[1], d)) / np.sqrt(d)
    arrays = mean + spread * np.einsum("tk,nkd->ntd", waves, random.normal(size=(n, waves.shape[1], d)))
    return Demonstrations.from_arrays(arrays, [f"kind {kind}"] * n, [TIMES] * n)


def pushed(positions, begin=0.2, end=0.5, size=0.5):
    """A movement that is pushed aside from 20 to 50 % of its time."""
    u = np.linspace(0, 1, len(positions))
    bump = np.sin(np.pi * np.clip((u - begin) / (end - begin), 0, 1)) ** 2
    aside = np.cross(positions[-1] - positions[0], [0.3, 0.5, 0.9])
    return positions + size * bump[:, None] * aside / np.linalg.norm(aside)


@pytest.fixture(scope="module")
def monitor():
    return Monitor.of(draw(24))


@pytest.fixture
def fresh(monitor):
    monitor.reset()
    return monitor


def distances(monitor, times, positions):
    monitor.reset()
    return [monitor.update(t, x).distance for t, x in zip(times, positions, strict=True)]


@pytest.mark.soak
def test_about_the_stated_share_of_such_movements_is_called_outside():
    watching, outside = [Monitor.of(draw(39, seed), error_rate=0.1) for seed in range(4)], []
    for k, monitor in enumerate(watching):
        for movement in draw(50, 50 + k):
            monitor.reset()
            outside.append(not np.isnan(monitor.update(movement.times, movement.positions).since))
    assert monitor.shown.calibrated
    assert 0.04 < np.mean(outside) < 0.17  # 0.1 +- 2 standard errors, of four calibrations too


def test_a_push_is_noticed_while_it_lasts_and_stays_noted(fresh):
    movement = draw(1, 7)[0]
    states = [fresh.update(t, x) for t, x in zip(movement.times, pushed(movement.positions), strict=True)]
    assert states[20].inside
    assert np.isnan(states[20].since)
    assert 0.2 * 2.0 < states[-1].since < 0.5 * 2.0
    assert states[-1].inside  # it came back
    assert states[-1].largest == max(state.distance for state in states) > states[-1].threshold
    assert any(state.deviation > 0.3 for state in states)
    phases = [state.phase for state in states]
    assert phases[0] == 0.0
    assert phases[-1] > 0.95
    assert f"inside what was shown, first left at {states[-1].since:.2f} s" in states[-1].in_words
    assert not fresh.finish().inside
    assert fresh.finish().ended


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(1e-3, 1e3), min_size=120, max_size=120), st.integers(0, 119), st.integers(0, 30))
def test_pace_and_waiting_are_no_alarm(monitor, steps, at, pause):
    """Property: the distances depend on the path, whatever the times of its samples."""
    movement = draw(1, 8)[0].positions
    waiting = np.concatenate((movement[:at], np.repeat(movement[at : at + 1], pause, axis=0), movement[at:]))
    times = np.cumsum([*steps, *np.ones(pause)])
    expected = distances(monitor, TIMES, movement)
    assert distances(monitor, times, waiting)[-1] == expected[-1]
    state = monitor.update(times[-1] + 1, movement[-1])
    assert (state.time, state.largest) == (times[-1] + 1, max(expected))


def test_blocks_of_samples_give_what_samples_one_by_one_give(fresh):
    movement = draw(1, 9)[0]
    last = distances(fresh, movement.times, movement.positions)[-1]
    finished = fresh.finish()
    fresh.reset()
    assert fresh.update(movement.times, movement.positions).distance == last
    assert fresh.finish() == finished


def test_few_samples_and_many_are_much_alike(fresh):
    movement = draw(1, 10)[0]
    many = np.linspace(0, 2, 4000)
    dense = np.column_stack([np.interp(many, TIMES, x) for x in movement.positions.T])
    largest = []
    for every in (1, 40, 200):
        fresh.reset()
        largest.append(fresh.update(many[::every], dense[::every]).largest)
        assert fresh.finish().ended
    assert np.ptp(largest) < 0.35 * max(largest)


def test_where_it_begins_does_not_matter(fresh):
    movement = draw(1, 11)[0].positions
    expected = distances(fresh, TIMES, movement)
    np.testing.assert_allclose(distances(fresh, TIMES, np.add(movement, [5.0, -3.0, 1.0])), expected, atol=1e-9)


@pytest.mark.parametrize("end", [20, 60, 100])
def test_a_movement_that_stops_early_did_not_end(fresh, end):
    movement = draw(1, 12)[0]
    fresh.update(movement.times[:end], movement.positions[:end])
    execution = fresh.finish()
    assert execution.inside
    assert not execution.ended
    assert execution.end_deviation == pytest.approx(np.linalg.norm(movement.positions[end - 1] - _mean_end()), rel=0.1)
    assert "did not end where such movements end" in execution.in_words
    fresh.update(movement.times[end:], movement.positions[end:])
    assert fresh.finish().ended
    assert fresh.finish().in_words.startswith("ended where such movements end")


def _mean_end():
    return np.mean([movement.positions[-1] - movement.positions[0] for movement in draw(24)], axis=0)


def test_a_movement_to_another_goal_is_outside_and_did_not_end(fresh):
    movement = draw(1, 13)[0].positions
    late = np.clip(np.linspace(-1, 1, len(movement)), 0, None)[:, None]
    state = fresh.update(TIMES, movement + late * [0.0, 0.5, 0.5])
    assert state.since > 1.0
    assert not state.inside
    assert "outside what was shown" in state.in_words
    assert not fresh.finish().ended


def test_what_cannot_be_used_is_skipped_and_flagged(fresh):
    movement = draw(1, 14)[0].positions
    expected = distances(fresh, TIMES, movement)
    fresh.reset()
    for k, (t, x) in enumerate(zip(TIMES, movement, strict=True)):
        state = fresh.update(t, x)
        if k == 50:
            for status, bad in (
                (LiveStatus.NOT_FINITE, (t + 1e-3, [np.nan, 0, 0])),
                (LiveStatus.TIME_NOT_INCREASING, (t, x + 1)),
                (LiveStatus.TIME_NOT_INCREASING, (t - 1, x + 1)),
                (LiveStatus.WRONG_SHAPE, (t + 1e-3, [1.0, 2.0])),
            ):
                after = fresh.update(*bad)
                assert status in after.status
                assert after[:8] == state[:8]
            assert after.skipped == 4
    assert (state.skipped, state.status, state.distance) == (4, LiveStatus(0), expected[-1])


def test_a_jump_far_away_is_outside_and_takes_no_time(fresh):
    fresh.update(0.0, [0.0, 0.0, 0.0])
    state = fresh.update(0.1, [1e9, 0.0, 0.0])
    assert state.since == 0.1
    assert np.isfinite(state.distance)


def test_a_monitor_that_is_reset_knows_nothing_of_what_was(fresh):
    movement = draw(1, 15)[0].positions
    expected = distances(fresh, TIMES, movement)
    fresh.reset()
    fresh.update(TIMES, pushed(movement) + 3.0)
    fresh.reset()
    assert fresh.update([], np.empty((0, 3))).in_words == "nothing yet"
    with pytest.raises(TrajectoryError, match="expected at least one sample"):
        fresh.finish()
    assert distances(fresh, TIMES, movement) == expected


@pytest.mark.soak
@pytest.mark.parametrize("d", [1, 2, 7, slow(63)])
def test_in_any_number_of_dimensions(d):
    monitor, movement = Monitor.of(draw(20, d=d)), draw(1, 16, d=d)[0].positions
    assert monitor.update(TIMES, movement).largest < 1.2 * monitor.shown.threshold
    assert monitor.finish().ended
    monitor.reset()
    assert not monitor.update(TIMES, -movement).inside


@pytest.mark.parametrize("n", [1, 2, 18, 19])
def test_from_nineteen_demonstrations_on_the_threshold_is_calibrated(n):
    monitor, movement = Monitor.of(draw(n)), draw(1, 17)[0].positions
    state = monitor.update(TIMES, movement)
    assert state.calibrated == (n >= 19) == ("uncalibrated" not in state.in_words)
    assert state.inside
    assert monitor.finish().ended
    monitor.reset()
    assert not np.isnan(monitor.update(TIMES, pushed(movement, size=1.0)).since)


def test_the_guess_of_few_is_half_as_far_again_as_any_went():
    few = draw(18)
    farthest = Monitor.of(few, error_rate=1 / 19).shown
    assert farthest.calibrated
    assert Monitor.of(few).shown.threshold == pytest.approx(1.5 * farthest.threshold)


def test_a_closed_movement_of_which_only_the_end_was_executed_did_not_end():
    angles, random = np.linspace(0, 2 * np.pi, 200), np.random.default_rng(0)
    circle = np.column_stack((np.cos(angles), np.sin(angles)))
    circles = circle * (1 + 0.02 * random.normal(size=(20, 1, 1)))
    monitor = Monitor(corridor(circles, relative=False))
    monitor.update(angles[170:], circle[170:])
    assert monitor.finish().end_distance < monitor.shown.end_threshold
    assert not monitor.finish().ended
    monitor.reset()
    monitor.update(angles, circle)
    assert monitor.finish().ended


def test_those_of_one_group_are_left_out_together():
    """Two people who differ: one who shows nothing is expected to differ as much."""
    movements = [movement for k in (0, 1) for movement in draw(12, k, spread=0.02 + 0.01 * k)]
    other = [movement.positions * 1.3 for movement in movements[12:]]
    demos = [*[movement.positions for movement in movements[:12]], *other]
    alone, by_people = Monitor.of(demos), Monitor.of(demos, ["a"] * 12 + ["b"] * 12)
    assert by_people.shown.threshold > 1.5 * alone.shown.threshold
    with pytest.raises(SpecificationError, match="expected a group for each of 24 movements, got 2"):
        Monitor.of(demos, ["a", "b"])


def test_noise_widens_what_is_inside():
    demos, movement = draw(24), draw(1, 18)[0].positions
    silent, noisy = Monitor.of(demos, noise=0.0), Monitor.of(demos, noise=0.1)
    far = pushed(movement)
    assert noisy.update(TIMES, far).largest < 0.8 * silent.update(TIMES, far).largest
    for options in ({"noise": -1.0}, {"error_rate": 0.0}, {"error_rate": 1.0}):
        with pytest.raises(SpecificationError):
            Monitor.of(demos, **options)


def test_jitter_is_the_deviation_of_the_noise():
    random = np.random.default_rng(0)
    demos = [movement.positions + 0.01 * random.normal(size=(120, 3)) for movement in draw(5)]
    assert jitter(demos) == pytest.approx(0.01, rel=0.15)


def test_what_is_shown_is_checked():
    with pytest.raises(TrajectoryError, match="at least one demonstration"):
        corridor(np.empty((0, 10, 2)))
    shown = corridor(np.stack([movement.positions for movement in draw(3)]))
    assert shown.spread.mean.shape == (N_PHASES, 6)


def test_the_picture_shows_distances_and_threshold(fresh):
    movement = draw(1, 19)[0]
    fresh.update(movement.times, movement.positions)
    threshold, execution = fresh.plot().axes[0].lines
    assert set(threshold.get_ydata()) == {fresh.shown.threshold}
    assert max(execution.get_ydata()) == fresh._state.largest
    assert execution.get_xdata()[-1] == fresh._state.phase


def test_a_recognizer_tells_which_other_movement_it_is(fresh):
    kinds = [draw(6, 1), draw(6, 2, kind=1), draw(6, 3, kind=2)]
    recognizer = kineme.Recognizer().fit([movement for demos in kinds for movement in demos])
    monitor = Monitor.of(kinds[0], stream=recognizer.stream)
    for seed, kind in ((4, 1), (5, 0)):
        monitor.reset()
        movement = draw(1, seed, kind=kind)[0]
        assert monitor.update(movement.times, movement.positions).inside == (kind == 0)
        assert monitor.recognize().ranked[0].label == f"kind {kind}"
    with pytest.raises(SpecificationError, match=r"pass stream=recognizer\.stream"):
        fresh.recognize()


@pytest.fixture
def library(tmp_path):
    with ActionLibrary(tmp_path / "actions", create=True) as library:
        library.learn([*draw(20), *draw(3, 1, kind=1)], groups=[*"abcde" * 4, None, None, None])
        yield library


def test_a_library_monitors_its_symbols_wherever_they_begin(library):
    monitor, movement = library.monitor("kind 0"), draw(1, 20)[0]
    assert monitor.shown.calibrated
    assert monitor.shown.relative
    assert monitor.update(movement.times, movement.positions + 1.0).inside
    assert monitor.finish().ended
    assert monitor.recognize().ranked[0].label == "kind 0"
    assert not library.monitor("kind 1").shown.calibrated
    with pytest.raises(SpecificationError):
        library.monitor("kind 7")


def test_a_library_leaves_out_people_where_it_was_told_them(library):
    demos = library.movements("kind 0")
    expected = Monitor.of(demos, [*"abcde" * 4]).shown.threshold
    assert library.monitor("kind 0").shown.threshold == pytest.approx(expected)
    assert Monitor.of(demos).shown.threshold != pytest.approx(expected)


def test_an_execution_at_another_start_and_goal_is_compared_with_demonstrations_carried_there(library):
    start, goal = np.array([2.0, 2.0, 2.0]), np.array([2.5, 3.0, 1.0])
    path = library.primitives("kind 0")[0].rollout(start, goal).trajectories[0]
    monitor = library.monitor("kind 0", start, goal)
    assert monitor.update(path.times, path.positions).inside
    assert monitor.finish().inside
    assert monitor.finish().ended
    monitor.reset()
    state = monitor.update(path.times, np.add(path.positions, [0.0, 0.0, 1.0]))  # here positions count as they are
    assert state.since == path.times[0]
    assert not monitor.finish().ended
    monitor = library.monitor("kind 0", goal=np.add(goal, [0.0, 0.0, 1.0]))
    assert not monitor.update(path.times, path.positions).inside
    for options in ({"start": [0.0, 0.0]}, {"goal": [np.nan, 0.0, 0.0]}):
        with pytest.raises(TrajectoryError):
            library.monitor("kind 0", **options)


def test_a_symbol_without_movements_cannot_be_monitored(library):
    library.release(library.ids("kind 1"))
    if "kind 1" in library:
        with pytest.raises(SpecificationError, match="without any"):
            library.monitor("kind 1")


def test_poses_are_taken_as_they_were_recorded(tmp_path):
    random, u = np.random.default_rng(0), np.linspace(0, 1, 50)
    channels = (
        *(Channel(axis, "position", (axis,)) for axis in "xyz"),
        Channel("q", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz"),
    )

    def pose(turn=1.0):
        xyz = np.outer(u, [1.0, 0.2, 0.1]) + np.outer(np.sin(np.pi * u), 0.3 + 0.02 * random.normal(size=3))
        return np.column_stack((xyz, product(exp(np.outer(u, [0, 0.3, turn])), exp(random.normal(size=3)))))

    recorded = Demonstrations.from_arrays([pose() for _ in range(20)], ["turn"] * 20)
    demos = Demonstrations.of_movements(of_channels(recorded.movements, channels))
    with ActionLibrary(tmp_path / "poses", create=True) as library:
        library.learn(demos)
        monitor = library.monitor("turn")
    for turn, inside in ((1.0, True), (-1.0, False)):
        monitor.reset()
        for t, x in zip(u, pose(turn), strict=True):
            state = monitor.update(t, x)
        assert (state.inside, state.skipped) == (inside, 0)
    assert LiveStatus.NOT_UNIT in monitor.update(2.0, 2.0 * pose()[0]).status
