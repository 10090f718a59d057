"""What each perturbation changes, and what it leaves alone."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kineme
from kineme.movements.preparation.perturbations import Perturbation, warped_phase

STRENGTHS = {"shift": 1.0, "scale": 1.0, "rotation": math.pi, "warp": 0.35, "noise": 0.01}
seeds = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def make_demos(make_movement):
    def make(seed, n_dims=2, n=5):
        movements = [make_movement([seed, i], n_dims, even=False) for i in range(n)]
        times, arrays = zip(*movements, strict=True)
        names = [f"movement {i}" for i in range(n)]
        return kineme.Demonstrations.from_arrays(arrays, [i % 2 for i in range(n)], times, names)

    return make


def paths(demos):
    return demos.positions.reshape(len(demos), -1, demos.n_dims)


def lengths(x):
    return np.linalg.norm(np.diff(x, axis=1), axis=2).sum(axis=1)


def test_it_takes_movements_in_any_form(make_demos):
    demos = make_demos(0)
    some = Perturbation(**STRENGTHS)
    for held in (list(demos), SimpleNamespace(demonstrations=demos)):
        np.testing.assert_array_equal(some.apply(held, 1).positions, some.apply(demos, 1).positions)


@given(seeds)
def test_nothing_is_only_resampled(make_demos, agree, seed):
    demos = make_demos(seed)
    agree(Perturbation().apply(demos, seed).positions, kineme.preprocess(demos, [kineme.Resample(200)]).positions)


@given(seeds, st.sampled_from([2, 3]))
def test_labels_names_durations_and_the_input_stay(make_demos, seed, d):
    demos = make_demos(seed, d)
    before = demos.positions.copy()
    after = Perturbation(**STRENGTHS).apply(demos, seed)
    np.testing.assert_array_equal(after.labels, demos.labels)
    np.testing.assert_array_equal(after.durations, demos.durations)
    np.testing.assert_array_equal(demos.positions, before)
    assert after.names == demos.names
    assert after.even_length == 200


@given(seeds)
def test_the_same_seed_gives_the_same_and_another_one_does_not(make_demos, seed):
    demos, everything = make_demos(1), Perturbation(**STRENGTHS)
    first = everything.apply(demos, [seed, 0]).positions
    np.testing.assert_array_equal(everything.apply(demos, [seed, 0]).positions, first)
    assert np.abs(everything.apply(demos, [seed, 1]).positions - first).max() > 1e-3


@given(seeds, st.sampled_from(sorted(STRENGTHS)))
def test_another_kind_does_not_change_what_a_kind_draws(make_demos, agree, seed, kind):
    """Alone and with a shift, a perturbation does the same but for the place."""
    demos = make_demos(seed)
    alone = paths(Perturbation(**{kind: STRENGTHS[kind]}).apply(demos, seed))
    shifted = paths(Perturbation(**{kind: STRENGTHS[kind], "shift": 1.0}).apply(demos, seed))
    agree(shifted - shifted.mean(1, keepdims=True), alone - alone.mean(1, keepdims=True), 1e-9)


@given(seeds, st.sampled_from([1, 2, 3]))
def test_a_shift_moves_by_up_to_its_extents(make_demos, seed, d):
    demos = make_demos(seed, d)
    still, moved = paths(Perturbation().apply(demos, seed)), paths(Perturbation(shift=0.5).apply(demos, seed))
    by = moved - still
    np.testing.assert_allclose(by, np.broadcast_to(by[:, :1], by.shape), atol=1e-9)  # the same for all samples
    extents = np.linalg.norm(np.ptp(still, axis=1), axis=1)
    assert (np.abs(by[:, 0]) <= 0.5 * extents[:, None] + 1e-12).all()
    assert np.abs(by).max() > 0


@given(seeds)
def test_a_scale_multiplies_all_lengths_by_one_factor(make_demos, seed):
    demos = make_demos(seed)
    before, after = paths(Perturbation().apply(demos, seed)), paths(Perturbation(scale=1.0).apply(demos, seed))
    factors = lengths(after) / lengths(before)
    assert ((factors >= 0.5) & (factors <= 2.0)).all()
    np.testing.assert_allclose(after - after[:, :1], (before - before[:, :1]) * factors[:, None, None], atol=1e-9)


@given(seeds, st.sampled_from([2, 3]), st.floats(0.05, math.pi))
def test_a_rotation_keeps_shapes_and_stays_within_its_angle(make_demos, seed, d, angle):
    demos = make_demos(seed, d)
    before, after = (paths(one.apply(demos, seed)) for one in (Perturbation(), Perturbation(rotation=angle)))
    before, after = before - before[:, :1], after - after[:, :1]
    np.testing.assert_allclose(np.linalg.norm(after, axis=2), np.linalg.norm(before, axis=2), atol=1e-9)
    for a, b in zip(after, before, strict=True):
        R = np.linalg.lstsq(b, a, rcond=None)[0].T
        assert np.linalg.det(R) == pytest.approx(1.0)  # no mirror image
        turned = math.acos(np.clip((np.trace(R) - 1 if d == 3 else np.trace(R)) / 2, -1, 1))
        assert turned <= angle + 1e-6


def test_angles_fill_their_range():
    line = kineme.Demonstrations.from_arrays(np.broadcast_to(np.linspace([0, 0], [1, 0], 9), (4000, 9, 2)))
    end = paths(Perturbation(rotation=1.0).apply(line, 0))[:, -1]
    angles = np.arctan2(end[:, 1], end[:, 0])
    np.testing.assert_allclose(np.quantile(angles, [0, 0.25, 0.5, 0.75, 1]), [-1, -0.5, 0, 0.5, 1], atol=0.06)


@given(seeds)
def test_a_warp_stays_on_the_path_from_end_to_end(make_demos, seed):
    demos = make_demos(seed)
    before, after = paths(Perturbation().apply(demos, seed)), paths(Perturbation(warp=0.35).apply(demos, seed))
    np.testing.assert_allclose(after[:, [0, -1]], before[:, [0, -1]], atol=1e-9)
    dense = kineme.preprocess(demos, [kineme.Resample(4000)]).positions.reshape(len(demos), -1, 2)
    for a, b in zip(after, dense, strict=True):
        off = np.linalg.norm(a[:, None] - b, axis=2).min(axis=1)
        assert off.max() < 2e-3 * np.linalg.norm(np.ptp(b, axis=0))
    assert np.abs(after - before).max() > 1e-3


def test_speeds_are_log_normal_at_the_knots_and_phases_increase():
    log_speeds = 0.35 * np.random.default_rng(0).normal(size=(500, 4))
    phase = warped_phase(log_speeds, 3001)
    assert (np.diff(phase, axis=1) > 0).all()
    np.testing.assert_array_equal(phase[:, [0, -1]], np.tile([0.0, 1.0], (500, 1)))
    slope = np.gradient(phase, 1 / 3000, axis=1)[:, [1, 1000, 2000, -2]]
    ratios = np.log(slope[:, 1:] / slope[:, :1])
    np.testing.assert_allclose(ratios, log_speeds[:, 1:] - log_speeds[:, :1], atol=0.02)


def test_noise_has_its_standard_deviation_and_is_white():
    """On a movement that extends over 5 units, 1 % is 0.05."""
    line = kineme.Demonstrations.from_arrays(np.broadcast_to(np.linspace([0, 0], [3, 4], 200), (300, 200, 2)))
    noise = paths(Perturbation(noise=0.01).apply(line, 3)) - paths(line)
    assert noise.std() == pytest.approx(0.05, rel=0.01)
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1])) < 0.01 * 0.05**2


@pytest.mark.parametrize("name", sorted(STRENGTHS))
@pytest.mark.parametrize("value", [-0.1, math.nan, "much"])
def test_a_strength_that_is_none_is_refused(name, value):
    with pytest.raises(kineme.errors.SpecificationError, match=f"{name} to be a number of at least 0, got {value!r}"):
        Perturbation(**{name: value})


@pytest.mark.parametrize("d", [1, 4])
def test_a_rotation_needs_a_plane_or_space(make_demos, d):
    with pytest.raises(kineme.errors.SpecificationError, match=f"rotation=0 for movements of {d} dimensions, got 0.3"):
        Perturbation(rotation=0.3).apply(make_demos(0, d), 0)
    assert Perturbation(rotation=0.3, noise=0.1).in_dimensions(d) == Perturbation(noise=0.1)
    Perturbation(**STRENGTHS).in_dimensions(d).apply(make_demos(0, d), 0)


def test_a_movement_that_stands_still_stays_finite():
    still = kineme.Demonstrations.from_arrays(np.ones((2, 10, 2)))
    np.testing.assert_allclose(Perturbation(**STRENGTHS).apply(still, 0).positions, 1.0)
