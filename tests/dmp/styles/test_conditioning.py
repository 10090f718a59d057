"""An average conditioned on positions and velocities, against the Gaussian written out."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import DMP, Demonstrations
from kineme.dmp.styles.parameters import path_matrix, to_numbers
from kineme.errors import ExtrapolationWarning, SpecificationError, TrajectoryError
from kineme.styles import average

any_seed = given(seed=st.integers(0, 10**6))
AT = 101  # samples: t = 0.25 is sample 25


#: Where a point is outside what was demonstrated, it is not what is tested.
pytestmark = pytest.mark.filterwarnings("ignore::kineme.errors.ExtrapolationWarning")


@pytest.fixture(scope="session")
def model(demonstrate):
    """The average of n demonstrations of unrelated shapes."""
    return lambda dmp, seed=0, n=9: average(dmp.learn(demonstrate(n, seed % 50)))


def dense(mean):
    """Mean and covariance of theta and ln tau, written out."""
    rows = np.column_stack((mean.factor.reshape(len(mean.factor), -1), mean.tempo_factor))
    center = np.append(to_numbers(mean.primitive).ravel(), np.log(mean.primitive.durations))
    return center, rows.T @ rows


def path_of(mean, n=AT):
    return mean.primitive.rollout(n_samples=n).positions[0]


def observing(dmp, d, asked):
    """A for (sample, dimension), with a zero for ln tau."""
    matrix = path_matrix(dmp, AT)
    rows = np.zeros((len(asked), d, len(matrix)))
    for row, (sample, k) in zip(rows, asked, strict=True):
        row[k] = matrix[:, sample]
    return np.column_stack((rows.reshape(len(asked), -1), np.zeros(len(asked))))


@any_seed
@pytest.mark.parametrize("std", [0.0, 0.3])
def test_it_is_the_gaussian_formula(dmp, model, seed, std):
    mean = model(dmp, seed)
    rng = np.random.default_rng(seed)
    points = path_of(mean)[[25, 70]] + 0.3 * rng.normal(size=(2, 2))
    points[1, 0] = np.nan
    found = mean.condition(t=[0.25, 0.7], position=points, std=std)
    center, covariance = dense(mean)
    A = observing(dmp, 2, [(25, 0), (25, 1), (70, 1)])
    error = points[~np.isnan(points)] - A @ center
    gain = covariance @ A.T @ np.linalg.inv(A @ covariance @ A.T + std**2 * np.eye(3))
    now, remaining = dense(found)
    scale = np.sqrt(np.diag(covariance)) + 1e-12
    np.testing.assert_allclose((now - center - gain @ error) / scale, 0.0, atol=1e-6)
    difference = remaining - (covariance - gain @ A @ covariance)
    np.testing.assert_allclose(difference / np.outer(scale, scale), 0.0, atol=1e-7)
    assert found.factor.shape == mean.factor.shape  # of low rank as before


@any_seed
@pytest.mark.parametrize("std", [0.0, 0.2])
def test_orders_commute_and_all_at_once_is_the_same(dmp, model, seed, std):
    mean = model(dmp, seed)
    x = path_of(mean)
    one, other = {"t": 0.25, "position": x[25] + 0.2}, {"t": 0.7, "position": x[70] - 0.2}
    both = mean.condition(t=[0.25, 0.7], position=[one["position"], other["position"]], std=std)
    for first, second in ((one, other), (other, one)):
        after = mean.condition(**first, std=std).condition(**second, std=std)
        np.testing.assert_allclose(path_of(after), path_of(both), atol=1e-6)
        np.testing.assert_allclose(after.deviation(AT), both.deviation(AT), atol=1e-5)
        assert after.primitive.durations[0] == pytest.approx(both.primitive.durations[0], rel=1e-6)


@any_seed
def test_without_deviation_the_point_is_met_and_with_an_infinite_one_nothing_changes(dmp, model, seed):
    mean = model(dmp, seed)
    extent = mean.primitive.extents.max()
    point = path_of(mean)[40] + np.random.default_rng(seed).normal(size=2) * 0.5
    for std in (0.0, 1e-9 * extent):
        met = mean.condition(t=0.4, position=point, std=std)
        np.testing.assert_allclose(path_of(met)[40], point, atol=1e-6 * extent)
        assert met.deviation(AT)[40].max() < 1e-6 * extent
        np.testing.assert_allclose(met.sample(20, seed=0).rollout(n_samples=AT).positions[:, 40] - point, 0.0,
                                   atol=1e-5 * extent)  # fmt: skip
    for std in (1e9 * extent, np.inf):
        same = mean.condition(t=0.4, position=point, std=std)
        np.testing.assert_allclose(path_of(same), path_of(mean), atol=1e-9 * extent)
        np.testing.assert_allclose(same.deviation(AT), mean.deviation(AT), atol=1e-9 * extent)


def test_what_was_demonstrated_together_changes_together(dmp):
    """Higher movements take longer and end lower: asked for a height, the average has their end and duration."""
    u = np.linspace(0, 1, 80)
    heights = np.array([0.5, 0.8, 1.1, 1.7])
    paths = [np.column_stack((u, h * np.sin(np.pi * u) ** 2 - 0.2 * h * u)) for h in heights]
    learned = dmp.learn([np.asarray(x) for x in paths])
    tempo = learned.durations / np.exp(heights)
    learned = replace(learned, durations=np.exp(heights), velocities=learned.velocities * tempo[:, None])
    found = average(learned).condition(t=0.5, position=[np.nan, 0.9 * 1.4])
    expected = np.column_stack((u, 1.4 * np.sin(np.pi * u) ** 2 - 0.2 * 1.4 * u))
    np.testing.assert_allclose(path_of(found, 80), expected, atol=0.01)
    assert found.primitive.durations[0] == pytest.approx(np.exp(1.4), rel=0.01)


@any_seed
def test_a_velocity_is_met_in_units_per_second_whatever_becomes_of_the_duration(dmp, model, seed):
    mean = model(dmp, seed)
    before = mean.primitive.rollout(n_samples=AT)
    velocity = before.velocities[0, 50] * [1.1, 0.9]
    found = mean.condition(t=0.5, velocity=velocity)
    after = found.primitive.rollout(n_samples=AT)
    np.testing.assert_allclose(after.velocities[0, 50], velocity, rtol=1e-6, atol=1e-6 * np.abs(velocity).max())
    point = before.positions[0, 50]
    both = mean.condition(t=0.5, position=point, velocity=velocity).primitive.rollout(n_samples=AT)
    np.testing.assert_allclose(both.positions[0, 50], point, atol=1e-6)
    np.testing.assert_allclose(both.velocities[0, 50], velocity, rtol=1e-6, atol=1e-6 * np.abs(velocity).max())


@any_seed
def test_velocities_far_from_those_that_were_shown_are_met_too(dmp, model, seed):
    """Up to five times as fast, and not along the path: the plain iteration went back and forth between durations."""
    rng, known = np.random.default_rng(seed), model(dmp, seed)
    t = np.sort(rng.choice(np.arange(10, 95), 2, replace=False))
    v = known.primitive.rollout(n_samples=AT).velocities[0, t]
    v = v * rng.uniform(0.2, 5.0) + rng.choice([0.1, 1.0]) * np.linalg.norm(v, axis=1).max() * rng.normal(size=v.shape)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "the velocity at .* is outside what was demonstrated")
        passing = known.condition(t=t / 100, velocity=v)
    found = passing.primitive.rollout(n_samples=AT).velocities[0, t]
    np.testing.assert_allclose(found, v, rtol=0, atol=1e-6 * np.abs(v).max())


def test_a_duration_that_was_not_found_is_said(dmp, model, monkeypatch):
    monkeypatch.setattr("kineme.dmp.styles.parameters._STEPS", 2)
    known = model(dmp)
    v = 2.0 * known.primitive.rollout(n_samples=AT).velocities[0, 50]
    with pytest.warns(ExtrapolationWarning, match=r"after 2 steps .* still changes by [\d.e-]+ % a step.*velocity_std"):
        known.condition(t=0.5, velocity=v, velocity_std=0.01)


def test_the_deviation_of_a_velocity_is_per_second(dmp, model):
    """With one duration for all the formula is linear: the rows of the derivative, over tau."""
    mean = model(dmp)
    mean = replace(mean, tempo_factor=0.0 * mean.tempo_factor)
    tau = float(mean.primitive.durations[0])
    assert abs(tau - 1.0) > 0.1
    velocity = mean.primitive.rollout(n_samples=AT).velocities[0, 25, 0] + 1.0
    found = mean.condition(t=0.25, velocity=[velocity, np.nan], velocity_std=0.7)
    center, covariance = dense(mean)
    row = np.zeros(len(center))
    row[: dmp.n_basis + 3] = path_matrix(dmp, AT, 1)[:, 25] / tau
    gain = covariance @ row / (row @ covariance @ row + 0.7**2)
    np.testing.assert_allclose(dense(found)[0], center + gain * (velocity - row @ center), rtol=1e-7, atol=1e-7)


def test_asking_again_for_what_is_met_changes_nothing_and_a_contradiction_is_refused(dmp, model):
    mean = model(dmp)
    point = path_of(mean)[40] + 0.3
    met = mean.condition(t=0.4, position=point)
    np.testing.assert_allclose(path_of(met.condition(t=0.4, position=point)), path_of(met), atol=1e-9)
    message = r"the position at 0.4 of the duration: .* they all agree, got one that is 0.5 off; .* give a std"
    with pytest.raises(SpecificationError, match=message):
        met.condition(t=0.4, position=point + np.array([0.5, 0.0]))


def test_more_than_the_demonstrations_differ_in_is_refused(dmp, model):
    mean = model(dmp, n=3)
    x = path_of(mean)
    with pytest.raises(SpecificationError, match=r"got 4 of which 2 are independent: .* give a std above 0"):
        mean.condition(t=[0.3, 0.6], position=x[[30, 60]] + 0.1)
    assert np.isfinite(path_of(mean.condition(t=[0.3, 0.6], position=x[[30, 60]] + 0.1, std=0.1))).all()


def test_points_outside_what_was_demonstrated_are_said_with_their_distance(two_styles):
    mean = average(DMP().learn(two_styles(20)[0]))
    x, deviation = path_of(mean), mean.deviation(AT)
    far = deviation[50, 1]
    message = (
        rf"the position at 0.5 of the duration is outside .*: {8 * far:.3g} from the average, where demonstrations are "
        rf"{far:.3g} from it, 8 standard deviations"
    )
    with pytest.warns(ExtrapolationWarning, match=message):
        mean.condition(t=[0.5, 0.2], position=[[np.nan, x[50, 1] + 8 * far], x[20]], std=[0.0, 0.1 * far])
    with pytest.warns(ExtrapolationWarning, match=r"the velocity at 0.25 of the duration"):
        mean.condition(t=0.25, velocity=[np.nan, 100.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error", ExtrapolationWarning)
        mean.condition(t=0.5, position=[np.nan, x[50, 1] + 2.5 * far])
        mean.condition(t=0.5, position=[np.nan, x[50, 1] + 8 * far], std=10 * far)


def test_shapes_that_are_understood(dmp, model):
    mean = model(dmp)
    x = path_of(mean)
    one = mean.condition(t=0.4, position=x[40] + 0.1, std=[0.1, 0.2])
    same = mean.condition(t=[0.4], position=[x[40] + 0.1], std=[[0.1, 0.2]])
    np.testing.assert_array_equal(path_of(one), path_of(same))
    two = mean.condition(t=[0.4, 0.6], position=x[[40, 60]] + 0.1, std=[0.1, 0.2])
    each = mean.condition(t=[0.4, 0.6], position=x[[40, 60]] + 0.1, std=[[0.1, 0.1], [0.2, 0.2]])
    np.testing.assert_array_equal(path_of(two), path_of(each))
    assert path_of(mean.condition(t=[0.0, 1.0], position=x[[0, -1]] + 0.2))[-1] == pytest.approx(x[-1] + 0.2)


@pytest.mark.parametrize(
    ("asked", "error", "message"),
    [
        ({"t": 0.4}, SpecificationError, "expected a position or a velocity to condition on, got neither"),
        ({"t": 1.4, "position": [0, 0]}, SpecificationError, "expected t between 0 and 1, as shares"),
        ({"t": np.nan, "position": [0, 0]}, SpecificationError, "expected t between 0 and 1"),
        ({"t": [], "position": []}, SpecificationError, "expected t between 0 and 1"),
        ({"t": 0.4, "position": [0, 0, 0]}, TrajectoryError, r"position of shape \(2,\) or \(1, 2\).*got \(3,\)"),
        ({"t": [0.4, 0.5], "position": [0, 0]}, TrajectoryError, r"position of shape \(2, 2\).*got \(2,\)"),
        ({"t": 0.4, "velocity": [np.inf, 0]}, TrajectoryError, "expected velocity to be numbers up to"),
        ({"t": 0.4, "position": [np.nan, np.nan]}, TrajectoryError, "expected position to be numbers"),
        ({"t": 0.4, "position": [0, 0], "std": -1.0}, SpecificationError, "expected std of 0 or more, got -1.0"),
        ({"t": 0.4, "position": [0, 0], "std": np.nan}, SpecificationError, "expected std of 0 or more"),
        ({"t": 0.4, "position": [0, 0], "std": [1, 2, 3]}, SpecificationError, r"std to be a number or of shape"),
    ],
)
def test_what_cannot_be_is_refused(demonstrate, asked, error, message):
    mean = average(DMP(n_basis=15).learn(demonstrate(9)))
    with pytest.raises(error, match=message):
        mean.condition(**asked)


def test_a_duration_that_is_no_movements_is_refused(dmp):
    shown = [np.column_stack((u := np.linspace(0, 1, 50), (1 + 0.1 * k) * u**2)) for k in range(4)]
    times = [(1.0 + 0.1 * k) * np.linspace(0, 1, 50) for k in range(4)]
    mean = average(dmp.learn(Demonstrations.from_arrays(shown, times=times)))
    with (
        pytest.warns(ExtrapolationWarning, match="outside what was demonstrated"),
        pytest.raises(SpecificationError, match=r"its duration would change by a factor of 10\^\d.*larger std"),
    ):
        mean.condition(t=0.9, position=[np.nan, 1e6])


def test_one_demonstration_that_nothing_is_known_to_vary_with_stays(dmp, demonstrate):
    mean = average(dmp.learn(demonstrate(9))[0])
    point = mean.primitive.rollout(n_samples=3).positions[0, 1]
    same = mean.condition(t=0.5, position=point + 0.1, std=0.1).primitive
    np.testing.assert_allclose(same.rollout().positions, mean.primitive.rollout().positions, atol=1e-9)
