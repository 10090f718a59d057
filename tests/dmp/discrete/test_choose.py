"""The number of basis functions and the ridge, against real leave-one-out and against the default."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import kineme
from kineme import DMP
from kineme.dmp.discrete.encode import RIDGES, relative_paths, score
from kineme.dmp.discrete.operators import decoder, trajectory_columns
from kineme.dmp.discrete.specification import FORMULATIONS
from kineme.errors import SpecificationError, TrajectoryError


def noisy(n=3, n_samples=40, noise=0.01, seed=0):
    """Smooth movements of extent about 1 and white noise."""
    rng = np.random.default_rng(seed)
    u = np.linspace(0.0, 1.0, n_samples)
    waves = np.sin(np.pi * np.arange(1, 6)[:, None] * u) / np.arange(1, 6)[:, None] ** 2
    paths = rng.normal(size=(n, 2, 5)) @ waves + rng.normal(size=(n, 2, 1)) * u
    return paths.transpose(0, 2, 1) + noise * rng.normal(size=(n, n_samples, 2))


def left_out(dmp, rows, ridge):
    """Root mean square error at samples that were left out of the fit, one after another; ends are always there."""
    n_points = rows.shape[1]
    response = decoder(dmp, n_points)
    columns, curvature = trajectory_columns(response, dmp.K)
    y = (rows - rows[:, -1:] * response.goal[0]) / np.sqrt(n_points)
    errors = []
    for k in range(1, n_points - 1):
        keep = np.arange(n_points) != k
        design = np.vstack((columns[keep], np.sqrt(ridge) * curvature))
        data = np.vstack((y[:, keep].T, np.zeros((len(curvature), len(y)))))
        errors.append(columns[k] @ np.linalg.lstsq(design, data, rcond=None)[0] - y[:, k])
    return float(np.sqrt(np.mean(np.square(errors)) * n_points))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_it_is_the_error_of_leaving_one_sample_out(formulation):
    dmp = DMP(formulation, n_points=40)
    rows = relative_paths(dmp, noisy())
    ridges = np.array([1e-6, 1e-4, 1e-2])
    for n_basis in (6, 10, 15):
        one = replace(dmp, n_basis=n_basis)
        found = score(one, rows, ridges)[0]
        real = [left_out(one, rows, ridge) for ridge in ridges]
        np.testing.assert_allclose(found, real, rtol=0.1)  # the mean of the diagonal stands for its elements


def test_what_is_chosen_is_as_good_at_samples_left_out_as_the_best():
    dmp = DMP(n_points=40)
    movements = noisy(noise=0.02)
    chosen = dmp.choose(movements, n_basis=(6, 8, 10, 15, 20)).dmp
    rows = relative_paths(dmp, movements)
    real = {
        (n, ridge): left_out(replace(dmp, n_basis=n), rows, ridge) for n in (6, 8, 10, 15, 20) for ridge in RIDGES[4::2]
    }
    assert left_out(chosen, rows, chosen.ridge) < 1.1 * min(real.values())


def test_degrees_of_freedom_are_the_trace_of_the_fit():
    dmp = DMP(n_basis=12, n_points=50, ridge=1e-5)
    columns, curvature = trajectory_columns(decoder(dmp, 50), dmp.K)
    normal = columns.T @ columns + 1e-5 * curvature.T @ curvature
    expected = np.trace(columns @ np.linalg.solve(normal, columns.T))
    assert score(dmp, relative_paths(dmp, noisy(n_samples=50)), np.array([1e-5]))[1][0] == pytest.approx(
        expected, rel=1e-6
    )


def test_noise_is_smoothed_and_clean_paths_are_followed():
    clean, rough = noisy(5, 200, 0.0), noisy(5, 200, 0.05)
    few, many = DMP().choose(rough), DMP().choose(clean)
    assert few.degrees_of_freedom.shape == few.errors.shape == (len(few.n_basis), len(few.ridge))
    assert few.dmp.n_basis <= many.dmp.n_basis
    assert few.dmp.ridge > 100 * many.dmp.ridge
    assert few.error == pytest.approx(0.05 / np.ptp(clean, axis=1).max(axis=1).mean(), rel=0.5)  # what noise there is
    assert many.error < 1e-3
    default, chosen = (np.abs(one.learn(rough).rollout().positions - clean).mean() for one in (DMP(), few.dmp))
    assert chosen < 0.8 * default


def test_everything_else_stays_and_the_curve_is_reported():
    dmp = DMP("original", stiffness=150.0, gating="phase", n_points=80)
    found = dmp.choose(noisy(), n_basis=[15, 10], ridge=[1e-4])
    assert found.dmp == replace(dmp, n_basis=found.dmp.n_basis, ridge=1e-4)
    assert list(found.curve) == [10, 15]
    assert found.error == found.curve[found.dmp.n_basis]


def test_the_unit_and_the_company_do_not_matter():
    movements = noisy()
    one = DMP().choose(movements)
    for other in (1e6 * movements, movements[::-1], np.concatenate((movements, movements))):
        np.testing.assert_allclose(DMP().choose(other).errors, one.errors, rtol=1e-6)


def test_samples_between_recorded_ones_do_not_count():
    """40 recorded samples, resampled to 200, would be followed as if they had no noise."""
    movements = noisy(n=5, n_samples=40, noise=0.03)
    assert DMP().choose(movements).error == pytest.approx(DMP(n_points=40).choose(movements).error)


def test_what_cannot_be_is_refused():
    with pytest.raises(SpecificationError, match=r'expected fit="trajectory", .* got fit=\'forcing\''):
        DMP(fit="forcing").choose(noisy())
    with pytest.raises(SpecificationError, match=r"expected n_basis to be at most 40, got 41"):
        DMP().choose(noisy(), n_basis=[41])
    with pytest.raises(SpecificationError, match=r"expected ridge to be a number above 0, got 0"):
        DMP().choose(noisy(), ridge=[0])
    with pytest.raises(SpecificationError, match=r"expected at least one n_basis and one ridge, got 0 and 15"):
        DMP().choose(noisy(), n_basis=[])
    with pytest.raises(SpecificationError, match=r"expected n_basis to be a sequence of what to try, got 20"):
        DMP().choose(noisy(), n_basis=20)
    with pytest.raises(SpecificationError, match=r"expected tolerance"):
        DMP().choose(noisy(), tolerance=-1.0)
    with pytest.raises(TrajectoryError, match=r"expected a movement"):
        DMP().choose([np.zeros((20, 2))])


def test_the_fewest_that_are_good_enough_are_chosen():
    found = DMP().choose(noisy(5, 200, 0.01))
    best = found.errors.min(axis=1)
    enough = best <= 1.005 * best.min()
    assert found.dmp.n_basis == found.n_basis[enough][0]
    assert enough.sum() > 3
    exact = DMP().choose(noisy(5, 200, 0.0))
    fewer = exact.errors[exact.n_basis < exact.dmp.n_basis]
    assert exact.error <= 1e-4 < fewer.min()  # and no more for errors that recordings do not tell


def test_a_larger_tolerance_would_cost_more_than_the_default_specification():
    """Why it is 0.5 %: the noise of the samples is part of every error, and hides the shape that is lost."""
    demos = kineme.load_lasa(["GShape", "Sine", "Worm", "Angle"])
    rng = np.random.default_rng(0)
    clean = np.stack([one.positions for one in demos])
    extent = np.ptp(clean, axis=1).max(axis=1)[:, None, None]
    rough = clean + 0.003 * extent * rng.normal(size=clean.shape)

    def error(dmp):
        path = dmp.learn(rough).rollout(n_samples=1000).positions
        return float(np.sqrt(np.mean(((path - clean) / extent) ** 2)))

    assert error(DMP().choose(rough).dmp) <= 1.01 * error(DMP()) < error(DMP().choose(rough, tolerance=0.05).dmp)


def test_on_real_recordings_it_reproduces_as_well_as_the_default_or_better():
    demos = kineme.load_lasa(["GShape", "Sine", "Worm"])
    chosen = DMP().choose(demos).dmp
    held = np.stack([one.positions[1::2] for one in demos])
    shown = [kineme.Trajectory(one.times[::2], one.positions[::2]) for one in demos]
    extent = np.ptp(held, axis=(1, 2))[:, None, None]

    def error(dmp):
        path = dmp.learn(shown).rollout(n_samples=999).positions[:, 1::2]
        return float(np.sqrt(np.mean(((path - held[:, :499]) / extent) ** 2)))

    assert error(chosen) <= error(DMP())
