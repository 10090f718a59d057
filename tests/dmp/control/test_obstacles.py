"""Steering around obstacles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kineme.dmp.control.plan import ObstacleAvoidance, steering

GENTLE = ObstacleAvoidance(gamma=60.0, beta=3.0)


def term(avoidance, x, v, obstacles, velocities=None):
    obstacles = np.atleast_2d(np.asarray(obstacles, dtype=float))
    still = np.zeros_like(obstacles)
    return steering(avoidance, np.array([x, v], dtype=float), obstacles, still if velocities is None else velocities)


def printed(avoidance, x, v, o):
    """Hoffmann et al. with the rotation matrix and the angle by arccos."""
    r = o - x
    axis = np.cross(r, v)
    R = Rotation.from_rotvec(0.5 * np.pi * axis / np.linalg.norm(axis))
    phi = np.arccos(r @ v / np.linalg.norm(r) / np.linalg.norm(v))
    return avoidance.gamma * R.apply(v) * phi * np.exp(-avoidance.beta * phi)


@pytest.mark.parametrize("seed", range(10))
def test_it_is_the_printed_formula_summed_over_obstacles(seed):
    random = np.random.default_rng(seed)
    x, v, obstacles = random.normal(size=3), random.normal(size=3), random.normal(size=(4, 3))
    expected = sum(printed(GENTLE, x, v, o) for o in obstacles)
    np.testing.assert_allclose(term(GENTLE, x, v, obstacles), expected, rtol=1e-10)
    flat = obstacles * [1, 1, 0]
    expected = sum(printed(GENTLE, x * [1, 1, 0], v * [1, 1, 0], o) for o in flat)
    np.testing.assert_allclose(term(GENTLE, x[:2], v[:2], flat[:, :2]), expected[:2], rtol=1e-10)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("d", [2, 3, 7])
def test_it_is_perpendicular_and_away(d, seed):
    random = np.random.default_rng(seed)
    x, v, o = random.normal(size=(3, d))
    push = term(GENTLE, x, v, o)
    assert push @ v == pytest.approx(0.0, abs=1e-10 * np.linalg.norm(push))
    assert push @ (o - x) < 0


def test_only_the_relative_velocity_counts():
    random = np.random.default_rng(0)
    x, v, o, w = random.normal(size=(4, 3))
    np.testing.assert_allclose(term(GENTLE, x, v, o, w[None]), term(GENTLE, x, v - w, o), rtol=1e-12)


def test_reach_fades_with_the_distance():
    near, far = ([1.0, 0.2], [0.0, 0.0]), ([10.0, 2.0], [0.0, 0.0])
    faded = ObstacleAvoidance(gamma=60.0, beta=3.0, reach=0.5)
    for o, x in (near, far):
        share = np.exp(-np.linalg.norm(np.subtract(o, x)) / 0.5)
        np.testing.assert_allclose(term(faded, x, [1, 0], o), share * term(GENTLE, x, [1, 0], o), rtol=1e-12)


@pytest.mark.parametrize("d", [2, 3, 5])
def test_where_there_is_no_side_one_is_chosen(d):
    x, v, ahead = np.zeros(d), np.eye(d)[0], 2 * np.eye(d)[0]
    for o in (ahead, x):
        push = term(GENTLE, x, v, o)
        assert np.linalg.norm(push) == pytest.approx(60.0 * 1e-4, rel=1e-3)
        assert push @ v == 0
        np.testing.assert_array_equal(push, term(GENTLE, x, v, o))
    if d == 2:
        assert term(GENTLE, x, v, ahead)[1] > 0  # left
    assert not term(GENTLE, x, 0 * v, ahead).any()
    assert not term(GENTLE, x, v, ahead, v[None]).any()  # it goes along with the obstacle


@pytest.mark.parametrize("d", [2, 3])
def test_what_rounding_leaves_of_a_distance_has_no_direction(d):
    x, v = np.full(d, 0.1), np.eye(d)[0]
    state, still = np.array([x, v]), np.zeros((1, d))
    at = steering(GENTLE, state, x[None], still)
    for noise in np.random.default_rng(0).normal(scale=1e-16, size=(20, d)):
        np.testing.assert_allclose(steering(GENTLE, state, x + noise[None], still, 1e-15), at, rtol=1e-9, atol=1e-15)
        behind = (x - v + noise[1] * np.eye(d)[1])[None]
        assert np.abs(steering(ObstacleAvoidance(beta=0.0), state, behind, still, 1e-15)).max() < 1e-10


def rotation(d, seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(d, d)))
    return q if np.linalg.det(q) > 0 else q[:, ::-1]


@pytest.mark.parametrize("d", [2, 3, 5])
@pytest.mark.parametrize("seed", range(3))
def test_the_path_turns_with_the_world(learn, steps, d, seed):
    primitive, R = learn(n_dims=d), rotation(d, seed)
    x0, g, v0 = primitive.starts[0], primitive.goals[0], primitive.velocities[0]
    obstacles = x0 + np.random.default_rng(seed).normal(size=(3, d))
    turned = type(primitive)(
        primitive.dmp,
        (R @ primitive.scaled_weights[0])[None],
        *(one[None] @ R.T for one in (x0, g, v0)),
        primitive.durations,
        primitive.extents,
    )
    path, _, _ = steps(primitive.controller(0.02, avoidance=GENTLE), 100, obstacles=obstacles)
    other, _, _ = steps(turned.controller(0.02, avoidance=GENTLE), 100, obstacles=obstacles @ R.T)
    np.testing.assert_allclose(other, path @ R.T, rtol=0, atol=1e-8)


@pytest.mark.parametrize("d", [2, 3])
def test_behind_or_out_of_reach_an_obstacle_has_no_effect(straight, steps, d):
    primitive, there = straight(d), np.full((1, d), 0.1)
    free, _, _ = steps(primitive.controller(0.01), 100)
    controller = primitive.controller(0.01)
    steps(controller, 20)  # at the very start a fitted movement may set out backwards
    behind, _, _ = steps(controller, 60, obstacles=there - 5 * np.eye(d)[:1])
    np.testing.assert_allclose(behind, free[20:81], rtol=0, atol=1e-6)
    brief = primitive.controller(0.01, avoidance=ObstacleAvoidance(reach=0.1))
    far, _, _ = steps(brief, 100, obstacles=there + 5 * np.eye(d)[:1])
    np.testing.assert_allclose(far, free, rtol=0, atol=1e-9)


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("aside", [0.0, 0.02])
def test_it_goes_around_an_obstacle_on_its_path_and_reaches_the_goal(straight, twin, steps, d, aside):
    primitive = straight(d)
    obstacle = 0.5 * np.eye(d)[:1] + aside * np.eye(d)[1:2]
    path, _, _ = steps(primitive.controller(0.005), 400, obstacles=obstacle)
    assert np.linalg.norm(path - obstacle, axis=1).min() > 0.05
    np.testing.assert_allclose(path[-1], primitive.goals[0], rtol=0, atol=2e-3)


def test_many_obstacles(bio, twin, steps):
    obstacles = bio.rollout(n_samples=200).positions[0] + 0.02
    controller = bio.controller(0.02)
    assert np.isfinite(steps(controller, 300, obstacles=obstacles)).all()
    steps(controller, 200)
    assert controller.state.status.name == "SETTLED"


@pytest.mark.soak("combinations")
@pytest.mark.parametrize("moving", [False, True])
def test_the_error_falls_with_the_square_of_dt(learn, twin, witness, moving):
    primitive = learn(n_dims=2)
    tau, end = primitive.durations[0], 1.6
    obstacles = primitive.rollout(n_samples=5).positions[0, 2:4] + [[0.3, 0.1], [-0.1, -0.4]]
    velocities = np.array([[0.4, -0.3], [0.1, 0.2]]) * moving

    def added(t, x, v):
        state = np.array([x, tau * v])
        return steering(GENTLE, state, obstacles + t * velocities, tau * velocities) / tau**2

    expected, speed = witness(primitive, np.array([end]), goal=primitive.goals[0], added=added)
    errors = []
    for n in (80, 160, 320):
        controller, dt = primitive.controller(end / n, avoidance=GENTLE), end / n
        for k in range(n):
            now = obstacles + k * dt * velocities
            state = controller.step(obstacles=now, obstacle_velocities=velocities if moving else None)
        errors.append((np.abs(state.position - expected[-1]).max(), np.abs(state.velocity - speed[-1]).max()))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.25)
    assert errors[-1][0] < 1e-4


def test_around_obstacles_at_rest_the_path_is_the_same_at_every_tempo(bio, steps, agree):
    obstacles = bio.rollout(n_samples=5).positions[0, 1:4] + 0.1
    path, _, _ = steps(bio.controller(0.02), 100, obstacles=obstacles)
    fast, _, _ = steps(bio.controller(0.005), 100, obstacles=obstacles, tempo=4.0)
    agree(fast, path, 1e-9)
