"""What the page on via points says was measured is of what the library does."""

import numpy as np

from bench.joining import met
from bench.via_points import PRIORS, STEPS, pairs, through
from kineme import DMP
from result_tables.modulation import tables


def test_the_first_prior_is_that_of_the_library():
    both = pairs(("GShape",), DMP())
    places = STEPS // 4 * np.arange(1, 4)
    via = [(k / STEPS, both.others[:, k]) for k in places]
    goals = both.plain.goals
    ours = both.movements.rollout(both.plain.starts, goals, via=via, n_samples=STEPS + 1).positions
    np.testing.assert_allclose(through(both, next(iter(PRIORS.values()))(DMP()), 3), ours, atol=1e-6 * 40)
    assert np.abs(through(both, PRIORS["small weights"](DMP()), 3) - ours).max() > 0.1


def test_what_is_shown_is_chosen():
    figures = np.array([row.split("|")[2:6] for row in tables()["priors"].splitlines()[2:]], dtype=float)
    assert (figures[0] == figures.min(axis=0)).all()


def test_parts_meet_with_a_common_velocity():
    parts = pairs(("GShape",), DMP()).movements
    before, after = met([parts[0], parts[6], parts[12]])[:2]
    speeds = ((before[-1] - before[-2]) / parts[0].durations, (after[1] - after[0]) / parts[6].durations)
    np.testing.assert_allclose(*speeds, atol=0.02 * np.abs(np.diff(before, axis=0)).max())
