"""In the middle of a motion nothing raises: the last good state goes on, and the status says what was wrong."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.dmp.control.plan import MESSAGES, State, Status

NAN, INF = np.nan, np.inf


class Broken:
    def __array__(self, *_, **__):
        raise RuntimeError("the driver died")

    def __float__(self):
        raise RuntimeError("the driver died")


BAD_VECTORS = {
    "NaN": [NAN, 0.0, 0.0],
    "infinite": [0.0, -INF, 0.0],
    "too short": [1.0, 2.0],
    "too long": np.ones(4),
    "two rows": np.ones((2, 3)),
    "a number": 1.0,
    "nothing": [],
    "words": "left",
    "ragged": [[1.0], [2.0, 3.0], 4.0],
    "an object": object(),
    "a driver that raises": Broken(),
    "out of range": [1e300, 0.0, 0.0],
}
BAD_NUMBERS = {
    "NaN": NAN,
    "infinite": INF,
    "negative": -1.0,
    "huge": 1e30,
    "word": "fast",
    "None": [],
    "raises": Broken(),
}
STATUS = {
    "position": Status.MEASUREMENT_REJECTED,
    "velocity": Status.MEASUREMENT_REJECTED,
    "goal": Status.GOAL_REJECTED,
    "coupling": Status.COUPLING_REJECTED,
}


def assert_goes_on(bio, told, status):
    """With these inputs a controller does what another does without, but for the status."""
    controller, undisturbed = bio.controller(0.02), bio.controller(0.02)
    for k in range(30):
        state, expected = controller.step(**(told if k % 3 == 1 else {})), undisturbed.step()
        for one, other in zip(state[:-1], expected[:-1], strict=True):
            np.testing.assert_array_equal(one, other)
        assert state.status == (Status.MOVING | status if k % 3 == 1 else Status.MOVING)
        assert state.status.rejected is (k % 3 == 1 and bool(status))


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("name", STATUS)
@pytest.mark.parametrize("value", BAD_VECTORS.values(), ids=BAD_VECTORS.keys())
def test_a_bad_vector_is_left_out(bio, name, value):
    assert_goes_on(bio, {name: value}, STATUS[name])


@pytest.mark.parametrize("value", BAD_NUMBERS.values(), ids=BAD_NUMBERS.keys())
def test_a_bad_tempo_or_dt_is_left_out(bio, value):
    assert_goes_on(bio, {"tempo": value}, Status.TEMPO_REJECTED)
    assert_goes_on(bio, {"dt": value}, Status.DT_REJECTED)


@pytest.mark.parametrize("value", [0.0, 1e-300, 2.5], ids=str)
def test_a_dt_of_nothing_or_more_than_the_duration_is_left_out(bio, value):
    assert_goes_on(bio, {"dt": value}, Status.DT_REJECTED)


@pytest.mark.parametrize(
    "value",
    [v for k, v in BAD_VECTORS.items() if k not in ("two rows", "nothing")],
    ids=lambda value: type(value).__name__,
)
def test_bad_obstacles_are_left_out(bio, value):
    assert_goes_on(bio, {"obstacles": value}, Status.OBSTACLES_REJECTED)


@pytest.mark.parametrize(
    "told",
    [
        {"obstacles": np.ones((2, 3)), "obstacle_velocities": np.ones((3, 3))},
        {"obstacles": np.ones((2, 3)), "obstacle_velocities": [[NAN, 0, 0], [0, 0, 0]]},
        {"obstacle_velocities": np.ones((2, 3))},
        {"obstacles": np.ones((2, 2, 3))},
    ],
)
def test_obstacles_that_do_not_fit_their_velocities_are_left_out(bio, told):
    assert_goes_on(bio, told, Status.OBSTACLES_REJECTED)


def test_no_obstacles_are_no_obstacles(bio):
    assert_goes_on(bio, {"obstacles": []}, Status(0))
    assert_goes_on(bio, {"obstacles": np.zeros((0, 3))}, Status(0))


def test_one_dimension_has_no_way_around(learn):
    state = learn(n_dims=1).controller(0.02).step(obstacles=[[1.0]])
    assert state.status == Status.MOVING | Status.OBSTACLES_REJECTED


def test_the_last_good_goal_tempo_and_obstacles_stay_in_force(bio):
    told = {"goal": bio.goals[0] + 1, "tempo": 0.5, "obstacles": bio.goals + 0.2}
    nonsense = {"goal": [NAN] * 3, "tempo": NAN, "obstacles": [[NAN] * 3]}
    one, other = bio.controller(0.02), bio.controller(0.02)
    one.step(**told), other.step(**told)
    for _ in range(20):
        np.testing.assert_array_equal(one.step(**told).position, other.step(**nonsense).position)


def test_of_a_measurement_the_good_half_is_used(bio):
    one, other = bio.controller(0.02), bio.controller(0.02)
    state = one.step([1.0, 2.0, 3.0], [NAN, 0, 0])
    np.testing.assert_array_equal(state.position, other.step([1.0, 2.0, 3.0]).position)
    assert state.status == Status.MOVING | Status.MEASUREMENT_REJECTED


def test_a_goal_the_original_formulation_cannot_reach_is_rejected(make_movement):
    from kineme import DMP

    u = np.linspace(0, 1, 60)
    primitive = DMP("original", n_basis=10, n_points=60).learn([np.column_stack((u, np.sin(np.pi * u)))])[0]
    controller = primitive.controller(0.01)
    state = controller.step(goal=[2.0, 1.0])
    assert state.status == Status.MOVING | Status.GOAL_REJECTED
    np.testing.assert_array_equal(state.goal, primitive.goals[0])
    assert controller.step(goal=[2.0, primitive.goals[0, 1]]).status == Status.MOVING


@pytest.mark.parametrize("told", [{"position": [9e149, 0, 0]}, {"goal": [0, -9e149, 0]}, {"coupling": [0, 9e149, 0]}])
def test_out_of_range_the_last_good_state_is_kept(bio, twin, told):
    controller = bio.controller(0.02)
    before = controller.step()
    state = controller.step(**told)
    assert state.status & Status.STATE_KEPT
    np.testing.assert_array_equal(state.position, before.position)
    assert state.progress == before.progress
    after = controller.step(goal=bio.goals[0])
    assert after.status == Status.MOVING
    assert np.isfinite(after.position).all()


def test_inputs_are_used_and_never_written_to(bio, twin):
    """Read-only arrays: who wrote to one would reject it."""
    arrays = {"position": np.ones(3), "velocity": np.ones(3), "goal": np.ones(3), "coupling": np.ones(3)}
    arrays |= {"obstacles": np.ones((2, 3)), "obstacle_velocities": np.ones((2, 3))}
    for array in arrays.values():
        array.setflags(write=False)
    controller = bio.controller(0.02, goal_filter=0.1)
    for _ in range(3):
        state = controller.step(**arrays)
        assert not state.status.rejected
        assert np.isfinite(np.concatenate(state[2:6])).all()
    for name in arrays:  # each of them counts
        if name != "obstacle_velocities":
            one, other = (bio.controller(0.02, goal_filter=0.1) for _ in range(2))
            told = {name: arrays[name]}
            assert (one.step(**told).position != other.step().position).any(), name
    assert all((array == 1.0).all() for array in arrays.values())


def test_several_things_at_once_are_all_reported(bio):
    state = bio.controller(0.02, velocity_limit=1e-9, acceleration_limit=1e-9).step([NAN] * 3, goal="x", tempo=NAN)
    expected = Status.MOVING | Status.MEASUREMENT_REJECTED | Status.GOAL_REJECTED | Status.TEMPO_REJECTED
    assert state.status == expected | Status.VELOCITY_LIMIT | Status.ACCELERATION_LIMIT
    assert len(state.status.messages) == 6
    assert "last good tempo" in " ".join(state.status.messages)


def test_every_status_has_a_message():
    assert list(MESSAGES) == list(Status)
    assert State._fields[-1] == "status"
