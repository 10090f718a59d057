"""What a primitive does not depend on, and how it turns and grows with its movement."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kineme import Demonstrations, Trajectory

any_movement = given(seed=st.integers(0, 10**6), n_dims=st.integers(1, 4), even=st.booleans())


@any_movement
def test_features_do_not_depend_on_the_place(dmp, make_movement, features, agree, seed, n_dims, even):
    t, x = make_movement(seed, n_dims, even=even)
    moved = x + np.random.default_rng(seed).normal(scale=10, size=n_dims)
    here, there = features(dmp.learn(Trajectory(t, x))), features(dmp.learn(Trajectory(t, moved)))
    for name, feature in here.items():
        agree(there[name], feature, 1e-7)


@any_movement
def test_features_do_not_depend_on_the_duration(dmp, make_movement, features, agree, seed, n_dims, even):
    t, x = make_movement(seed, n_dims, even=even)
    slow = features(dmp.learn(Trajectory(t, x)))
    for name, feature in features(dmp.learn(Trajectory(0.013 * t, x))).items():
        agree(feature, slow[name], 1e-8)


@any_movement
def test_primitives_do_not_depend_on_when_the_clock_started(dmp, make_movement, agree, seed, n_dims, even):
    t, x = make_movement(seed, n_dims, even=even)
    for origin in (5.0, 1.7e9):  # the second one is a ROS stamp, rounded to 0.24 microseconds
        stamps = origin + t
        late, early = dmp.learn(Trajectory(stamps, x)), dmp.learn(Trajectory(t if even else stamps - origin, x))
        agree(late.weights, early.weights, 1e-8)
        agree(late.velocities, early.velocities, 1e-6)
        agree(late.durations, early.durations, 1e-6)


@any_movement
def test_original_features_grow_with_each_axis_or_not_at_all(
    dividing_dmp, make_movement, features, agree, seed, n_dims, even
):
    t, x = make_movement(seed, n_dims, even=even)
    factors = np.random.default_rng(seed).uniform(0.1, 10, n_dims) * np.resize([1, -1], n_dims)
    plain = features(dividing_dmp.learn(Trajectory(t, x)))
    scaled = features(dividing_dmp.learn(Trajectory(t, x * factors)))
    agree(scaled["weights"], plain["weights"])
    agree(scaled["forcing"], plain["forcing"])
    agree(scaled["shape-attractor"], plain["shape-attractor"] * factors)


@any_movement
def test_features_of_eq_4_grow_with_the_movement(turning_dmp, make_movement, features, agree, seed, n_dims, even):
    t, x = make_movement(seed, n_dims, even=even)
    plain = features(turning_dmp.learn(Trajectory(t, x)))
    for name, feature in features(turning_dmp.learn(Trajectory(t, -7.3 * x))).items():
        agree(feature, -7.3 * plain[name])


@any_movement
def test_features_of_eq_4_turn_with_the_movement(turning_dmp, make_movement, features, agree, seed, n_dims, even):
    t, x = make_movement(seed, n_dims, even=even)
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(n_dims, n_dims)))[0]
    plain = features(turning_dmp.learn(Trajectory(t, x)))
    for name, feature in features(turning_dmp.learn(Trajectory(t, x @ turn.T))).items():
        agree(feature, plain[name] @ turn.T)


@given(seed=st.integers(0, 10**6), n_dims=st.integers(1, 4))
def test_a_batch_is_its_movements_one_by_one(dmp, make_movement, features, agree, seed, n_dims):
    movements = [Trajectory(*make_movement(seed + i, n_dims, even=i % 2 == 0)) for i in range(5)]
    batch = features(dmp.learn(movements))
    for i, one in enumerate(movements):
        for name, feature in features(dmp.learn(one)).items():
            agree(batch[name][i], feature[0], 1e-8)


@given(seed=st.integers(0, 10**6))
def test_the_order_of_a_batch_is_the_order_of_its_primitives(dmp, make_movement, features, seed):
    demos = Demonstrations([Trajectory(*make_movement(seed + i, even=False)) for i in range(6)])
    order = np.random.default_rng(seed).permutation(6)
    learned, shuffled = features(dmp.learn(demos)), features(dmp.learn(demos[order]))
    for name, feature in shuffled.items():
        np.testing.assert_allclose(feature, learned[name][order], rtol=1e-10, atol=1e-10)


def test_a_list_a_block_and_demonstrations_are_learned_alike(dmp, make_movement):
    block = np.stack([make_movement(seed, n_samples=50)[1] for seed in range(4)])
    from_block = dmp.learn(block).weights
    np.testing.assert_array_equal(dmp.learn(list(block)).weights, from_block)
    np.testing.assert_array_equal(dmp.learn(Demonstrations.from_arrays(block)).weights, from_block)
