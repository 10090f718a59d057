"""Replanned movements go on where the robot is, exactly, at any time."""

from __future__ import annotations

import numpy as np
import pytest

import kineme

torch = pytest.importorskip("torch", reason="the extra torch is not installed")

from hypothesis import given, settings  # noqa: E402 - after the package that may be missing
from hypothesis import strategies as st  # noqa: E402
from tensor_movements import FORMULATIONS, RATE, learned, module, tensors  # noqa: E402
from torch.autograd import gradcheck  # noqa: E402
from torch.func import vmap  # noqa: E402


@pytest.mark.parametrize("damping", [None, 5.0, 60.0])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_movement_that_is_replanned_as_it_is_goes_on_as_planned(formulation, damping):
    """Under, at and over critical damping, at times between samples of the grid."""
    primitives = learned(formulation, damping=damping)
    mp = kineme.torch.Primitive.of(primitives, dtype=torch.float64)
    fine = primitives.rollout(n_samples=2001)
    for share in (0, 1, 777, 1999, 2000):
        at = torch.tensor(primitives.durations * share / 2000)
        x, v = torch.tensor(fine.positions[:, share]), torch.tensor(fine.velocities[:, share])
        desired = mp.state(at)
        assert torch.allclose(desired[0], x, atol=1e-11)
        assert torch.allclose(desired[1], v, atol=1e-10)
        first = int(np.ceil(share / 2000 * 49 - 1e-9))
        for k in (0, 1, 2):
            again, path = mp.replan(at=at, position=x, velocity=v, derivative=k), mp(derivative=k)
            assert torch.allclose(again[:, first:], path[:, first:], rtol=1e-9, atol=1e-9)
            held = x[:, None] if k == 0 else torch.zeros(1, dtype=x.dtype)
            assert torch.equal(again[:, :first], held.expand_as(again[:, :first]))


@given(
    st.sampled_from(FORMULATIONS),
    st.integers(0, 1000),
    st.sampled_from([(torch.float32, 1e-5), (torch.float64, 1e-10)]),
)
@settings(max_examples=6, deadline=None)
def test_ten_replans_are_continuous_in_position_and_velocity(formulation, seed, precision):
    """New weights and another goal each time."""
    dtype, tolerance = precision
    mp = module(formulation, dtype=dtype)
    numbers = tensors((11, 3, 2, 6), (3, 2), (11, 3, 2), seed=seed)
    weights, start, goals = (part.to(dtype) for part in numbers)
    path, rates = (mp(weights[0], start, goals[0], derivative=order) for order in (0, 1))
    for k in range(1, 11):
        first = 2 * k
        x, v = path[:, first], rates[:, first]
        plan = {"at": first / RATE, "position": x, "velocity": v, "goal": goals[k], "start": start}
        path, rates = (mp.replan(weights[k], **plan, derivative=order) for order in (0, 1))
        size = float(max(1.0, path.abs().max(), rates.abs().max()))
        assert (path[:, first] - x).abs().max() <= tolerance * size
        assert (rates[:, first] - v).abs().max() <= tolerance * size
        assert not torch.allclose(path[:, -1], mp.replan(weights[k - 1], **plan)[:, -1])


def test_without_a_start_the_shape_counts_from_where_the_robot_is():
    mp = module()
    weights, goal, x, v = tensors((3, 2, 6), (3, 2), (3, 2), (3, 2))
    at = 0.3
    assert torch.equal(
        mp.replan(weights, at=at, position=x, velocity=v, goal=goal),
        mp.replan(weights, at=at, position=x, velocity=v, goal=goal, start=x),
    )
    other = mp.replan(weights, at=at, position=x, velocity=v, goal=goal, start=x + 1)
    assert not torch.allclose(other[:, -1], mp.replan(weights, at=at, position=x, velocity=v, goal=goal)[:, -1])


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_gradients_go_through_replanning_in_its_time_too(formulation):
    mp = module(formulation)
    weights, x, v, goal, start = tensors((3, 2, 6), (3, 2), (3, 2), (3, 2), (3, 2), grad=True)
    at = torch.tensor([0.13, 0.3, 0.61], dtype=torch.float64, requires_grad=True)

    def again(w, at, x, v, g, x0):
        path = mp.replan(w, at=at, position=x, velocity=v, goal=g, start=x0)
        return path[:, -4:], mp.state(at, w, x0, g)

    def flat(*numbers):
        path, state = again(*numbers)
        return path, *state

    assert gradcheck(flat, (weights, at, x, v, goal, start), fast_mode=True)


@pytest.mark.soak
def test_replanning_is_mapped_and_compiled():
    mp = module()
    weights, x, v, goal = tensors((3, 2, 6), (3, 2), (3, 2), (3, 2))
    at = torch.tensor([0.13, 0.3, 0.61], dtype=torch.float64)

    def again(w, at, x, v, g):
        return mp.replan(w, at=at, position=x, velocity=v, goal=g)

    numbers = (weights, at, x, v, goal)
    assert torch.allclose(vmap(again)(*numbers), again(*numbers), atol=1e-14)
    compiled = torch.compile(again, backend="aot_eager", fullgraph=True)
    assert torch.equal(compiled(*numbers), again(*numbers))
