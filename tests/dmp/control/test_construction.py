"""What a controller is made of is checked at once, with an error that says what to do."""

from __future__ import annotations

import numpy as np
import pytest

from kineme.dmp.control.plan import ObstacleAvoidance
from kineme.errors import DegenerateMovementError, SpecificationError

WRONG = {
    "dt zero": ({"dt": 0.0}, r"expected dt to be a number above 0, got 0\.0"),
    "dt NaN": ({"dt": np.nan}, "expected dt to be a number above 0, got nan"),
    "dt word": ({"dt": "fast"}, "expected dt to be a number above 0, got 'fast'"),
    "dt long": ({"dt": 2.5}, r"expected dt of at most the duration, 2 s, got 2\.5 s"),
    "start": ({"start": [1.0, 2.0]}, r"expected start to be 3 finite numbers, one per dimension, got \[1\.0, 2\.0\]"),
    "goal": ({"goal": [np.nan] * 3}, r"expected goal to be 3 finite numbers, one per dimension, got \[nan"),
    "goals": ({"goal": np.zeros((2, 3))}, "expected goal to be 3 finite numbers"),
    "velocity": ({"velocity": "fast"}, "expected velocity to be numbers, got 'fast'"),
    "duration": ({"duration": -1.0}, r"expected duration to be a number above 0, got -1\.0"),
    "feedback": ({"feedback": "none"}, r"expected feedback to be one of \['state', 'phase'\], got 'none'"),
    "gain alone": ({"phase_stopping": 2.0}, r"and only then, got feedback='state' and phase_stopping=2\.0"),
    "phase alone": ({"feedback": "phase"}, "and only then, got feedback='phase' and phase_stopping=None"),
    "gain": ({"feedback": "phase", "phase_stopping": -2.0}, r"phase_stopping to be a number of at least 0, got -2\.0"),
    "filter": ({"goal_filter": 0}, "expected goal_filter to be a number above 0, got 0"),
    "settle": ({"settle": -1}, "expected settle to be a number above 0, got -1"),
    "limit": (
        {"velocity_limit": [1.0, 2.0]},
        r"velocity_limit to be a number above 0, or 3 of them, got \[1\.0, 2\.0\]",
    ),
    "limit NaN": (
        {"acceleration_limit": np.nan},
        "expected acceleration_limit to be a number above 0, or 3 of them, got nan",
    ),
    "avoidance": ({"avoidance": 1000.0}, r"expected avoidance to be an ObstacleAvoidance, got 1000\.0"),
}


@pytest.mark.parametrize(("wrong", "message"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_option_is_refused(bio, wrong, message):
    with pytest.raises(SpecificationError, match=message):
        bio.controller(**({"dt": 0.02} | wrong))


def test_an_unknown_option_is_refused(bio):
    with pytest.raises(TypeError, match="unexpected keyword argument 'position_limit'"):
        bio.controller(0.02, position_limit=3.0)


def test_more_than_one_primitive_is_refused(bio, make_movement):
    both = bio.dmp.learn([make_movement(1, 3)[1], make_movement(2, 3)[1]])
    with pytest.raises(SpecificationError, match=r"expected one primitive to control, got 2; choose one: prim"):
        both.controller(0.02)


def test_a_closed_movement_of_the_original_formulation_stays_where_it_ends(make_movement):
    from kineme import DMP

    u = np.linspace(0, 1, 60)
    primitive = DMP("original", n_basis=10, n_points=60).learn([np.column_stack((u, np.sin(np.pi * u)))])[0]
    with pytest.raises(DegenerateMovementError, match="expected a demonstration with g != x0 in dimension 1"):
        primitive.controller(0.02, goal=[1.0, 1.0])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"gamma": -1}, "expected gamma to be a number of at least 0, got -1"),
        ({"beta": np.inf}, "expected beta to be a number of at least 0, got inf"),
        ({"reach": 0}, "expected reach to be a number above 0, got 0"),
    ],
)
def test_obstacle_avoidance_checks_its_parameters(wrong, message):
    with pytest.raises(SpecificationError, match=message):
        ObstacleAvoidance(**wrong)
