"""Angles of several recordings of one movement start whole turns apart, as each is unwrapped from its own start."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import DMP, Demonstrations
from kineme.dmp import Contextual
from kineme.dmp.recorded_as import RecordedAs
from kineme.movements.channels.channel import Channel
from kineme.movements.trajectories.movements import of_channels
from kineme.styles import average, learn_styles

TURNS = {"deg": 360.0, "rad": 2 * np.pi, None: 360.0}


def turning(starts, unit="deg", wrapped=True, by=30.0):
    """Movements of x and of a yaw that turns by 30 degrees from each start [deg], as a sensor reports it."""
    u = np.linspace(0, 1, 60)
    s, turn = u**3 * (10 - 15 * u + 6 * u**2), TURNS[unit]
    yaws = [(start + by * s) / 360.0 * turn for start in starts]
    yaws = [(yaw + turn / 2) % turn - turn / 2 if wrapped else yaw for yaw in yaws]
    paths = [np.column_stack((s + 0.1 * k**2 * np.sin(np.pi * u), yaw)) for k, yaw in enumerate(yaws)]
    plain = Demonstrations.from_arrays(paths, None, [u] * len(yaws))
    return Demonstrations.of_movements(
        of_channels(plain.movements, (Channel("x", "position", ("x",)), Channel("yaw", "angle", ("yaw",), unit)))
    )


@given(
    center=st.floats(-180.0, 180.0),
    away=st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=6),
    unit=st.sampled_from(["deg", "rad"]),
)
def test_averages_are_those_of_recordings_in_one_turn(center, away, unit):
    starts = center + np.array(away) - np.mean(away)
    turn = TURNS[unit]
    mean = average(DMP().learn(turning(starts, unit)))
    expected = average(DMP().learn(turning(starts, unit, wrapped=False)))
    apart = (mean.primitive.starts - expected.primitive.starts)[0, 1] / turn
    assert apart == pytest.approx(round(apart), abs=1e-9)
    np.testing.assert_allclose(mean.deviation(5), expected.deviation(5), atol=1e-6 * turn)
    assert mean.primitive.goals[0, 1] - mean.primitive.starts[0, 1] == pytest.approx(turn / 12, rel=1e-6)


def test_tasks_styles_and_likelihoods_take_them_in_one_turn_too():
    primitives = DMP().learn(turning([170.0, 175.0, 182.0, 178.0]))
    there = DMP().learn(turning([170.0, 175.0, 182.0, 178.0], wrapped=False))
    assert np.ptp(primitives.starts[:, 1]) > 300
    task = Contextual().fit(primitives, parameters=[0.0, 1.0, 2.0, 3.0])
    assert task.primitive(1.5).starts[0, 1] == pytest.approx(178.0, abs=3.0)
    assert learn_styles(primitives, n_styles=1).mean[1, -3] == pytest.approx(176.25, abs=1e-6)
    assert average(DMP().learn(turning([530.0, 540.0, 542.0, 538.0], wrapped=False))).primitive.starts[0, 1] > 500
    mean = average(primitives)
    np.testing.assert_allclose(
        mean.log_likelihood(primitives, 1.0), average(there).log_likelihood(there, 1.0), rtol=1e-6
    )


def test_small_angles_without_a_unit_may_be_degrees_and_stay():
    primitives = DMP().learn(turning([-3.2, 3.0], None, wrapped=False))
    assert average(primitives).primitive.starts[0, 1] == pytest.approx(-0.1, abs=1e-9)


@pytest.mark.parametrize("starts", [(11.0, 200.0), (-160.0, -60.0, 60.0, 160.0)])
def test_joints_with_limits_that_come_from_far_apart_are_averaged_as_they_stand(starts):
    mean = average(DMP().learn(turning(starts, wrapped=False)))
    assert mean.primitive.starts[0, 1] == pytest.approx(np.mean(starts), abs=1e-9)


def test_quaternions_before_an_angle_do_not_hide_it():
    channels = (
        Channel("tip", "orientation", ("qw", "qx", "qy", "qz"), None, "wxyz"),
        Channel("yaw", "angle", ("yaw",), "deg"),
    )
    about = RecordedAs(channels)
    of_a_library = np.array([[0.0, 0.0, 0.0, 175.0], [0.0, 0.0, 0.0, -175.0]])  # turns about x, y and z, and the angle
    assert about.periods(of_a_library).tolist() == [np.inf, np.inf, np.inf, 360.0]
    of_poses = np.array([[175.0, 1.0, 0.0, 0.0, 0.0], [-175.0, 1.0, 0.0, 0.0, 0.0]])
    assert about.periods(of_poses).tolist() == [360.0, *[np.inf] * 4]
