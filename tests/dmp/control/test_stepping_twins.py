"""The compiled twin does what plain NumPy says, whatever happens."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from kineme.dmp.control.plan import ObstacleAvoidance
from kineme.dmp.discrete.specification import FORMULATIONS


def script(primitive, n):
    """What happens to a movement in n steps: everything a step can be told, at random."""
    random, x0 = np.random.default_rng(5), primitive.starts[0]
    d = len(x0)
    for _ in range(n):
        obstacles = x0 + random.normal(size=(random.integers(0, 4), d))
        chances = {
            "position": x0 + random.normal(size=d),
            "velocity": random.normal(size=d),
            "goal": primitive.goals[0] + random.normal(size=d),
            "coupling": 10 * random.normal(size=d),
            "tempo": random.uniform(0, 3),
            "dt": random.uniform(0.001, 0.2),
        }
        told = {name: value for name, value in chances.items() if random.random() < 0.2}
        if random.random() < 0.5:
            told |= {"obstacles": obstacles, "obstacle_velocities": random.normal(size=obstacles.shape)}
        yield told


def both(monkeypatch, primitive, **options):
    controllers = []
    for choice in ("always", "never"):
        monkeypatch.setenv("KINEME_COMPILED", choice)
        controllers.append(primitive.controller(0.02, **options))
    return controllers


def test_twins_agree_step_by_step(primitive, monkeypatch, agree):
    options = {"goal_filter": 0.1, "avoidance": ObstacleAvoidance(reach=2.0), "velocity_limit": 3.0}
    compiled, plain = both(monkeypatch, primitive, **options)
    for told in script(primitive, 60):
        one, other = compiled.step(**told), plain.step(**told)
        assert one.status == other.status
        for a, b in zip(one[:-1], other[:-1], strict=True):
            agree(a, np.array(b), 1e-8)
        plain.step(one.position, one.velocity, dt=1e-6)  # chaos would grow the rounding
        compiled.step(one.position, one.velocity, dt=1e-6)


def test_degenerate_obstacles_have_the_same_side(straight, monkeypatch):
    for d, axis in ((2, 0), (2, 1), (3, 0), (3, 1), (5, 2)):
        primitive = straight(d, axis)
        compiled, plain = both(monkeypatch, primitive)
        for o in (0.5 * np.eye(d)[[axis]], primitive.starts):
            one, other = compiled.step(obstacles=o), plain.step(obstacles=o)
            np.testing.assert_allclose(one.acceleration, other.acceleration, rtol=1e-9, atol=1e-12)
            assert one.acceleration[np.arange(d) != axis].any()


def test_a_formulation_of_ones_own_works_in_both(learn, monkeypatch, agree):
    own = replace(FORMULATIONS["bio-inspired"], name="own", coupling=lambda K, s: -K * np.sin(1.5 * s) ** 2)
    monkeypatch.setitem(FORMULATIONS, "own", own)
    primitive = learn("own")
    compiled, plain = both(monkeypatch, primitive)
    expected = primitive.rollout(n_samples=101).positions[0]
    for k in range(1, 101):
        agree(compiled.step().position, expected[k], 1e-10)
        agree(plain.step().position, expected[k], 1e-10)


@pytest.mark.parametrize(("choice", "compiled"), [(None, True), ("always", True), ("never", False)])
def test_the_choice_is_made_once(bio, monkeypatch, choice, compiled):
    if choice is None:
        monkeypatch.delenv("KINEME_COMPILED", raising=False)
    else:
        monkeypatch.setenv("KINEME_COMPILED", choice)
    controller = bio.controller(0.02)
    monkeypatch.setenv("KINEME_COMPILED", "no such choice")
    controller.step()
    controller.reset()
    assert (type(controller._advance).__name__ == "function") is compiled


def test_plain_numpy_needs_no_numba(bio, monkeypatch):
    monkeypatch.setenv("KINEME_COMPILED", "never")
    monkeypatch.setitem(sys.modules, "numba", None)
    assert bio.controller(0.02).step().time == 0.02
