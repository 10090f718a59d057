"""Eqs. (2) and (3) against three literal lines, and where the literal lines would fail."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kineme import DMP
from kineme.dmp.discrete.specification import ExponentialPhase, GaussianBasis

bases = st.builds(
    lambda n, overlap, gating, end: GaussianBasis(n, overlap, gating, ExponentialPhase(end)),
    st.integers(2, 60),
    st.floats(0.01, 0.95),
    st.sampled_from(["none", "phase"]),
    st.floats(1e-3, 0.5),
)


@given(basis=bases, seed=st.integers(0, 10**6))
def test_the_design_is_eq_2(basis, seed):
    w = np.random.default_rng(seed).normal(size=basis.n_basis)
    u = np.linspace(0, 1, 50)
    s = np.exp(-basis.phase.alpha * u)[:, None]
    psi = np.exp(-basis.widths * (s - basis.centers) ** 2)
    f = (psi * w).sum(axis=1) / psi.sum(axis=1) * (s[:, 0] if basis.gating == "phase" else 1)
    np.testing.assert_allclose(basis.design(u) @ w, f, atol=1e-10)


@given(basis=bases)
def test_rows_of_an_ungated_design_sum_to_one(basis):
    u = np.linspace(0, 1, 50)
    gate = basis.phase(u) if basis.gating == "phase" else 1.0
    np.testing.assert_allclose(basis.design(u).sum(axis=1), gate, rtol=1e-12)


@given(basis=bases)
def test_centers_are_equally_spaced_in_time(basis):
    np.testing.assert_allclose(np.diff(np.log(basis.centers)), np.log(basis.phase.end) / (basis.n_basis - 1), rtol=1e-9)


@given(basis=bases)
def test_overlap_is_the_value_at_the_next_center(basis):
    at_next = np.exp(-basis.widths[:-1] * np.diff(basis.centers) ** 2)
    np.testing.assert_allclose(at_next, basis.overlap, rtol=1e-12)


@given(basis=bases)
def test_the_phase_runs_from_1_to_its_end(basis):
    np.testing.assert_allclose(basis.phase(np.array([0.0, 1.0])), [1.0, basis.phase.end], rtol=1e-12)


@pytest.mark.parametrize("gating", ["none", "phase"])
@pytest.mark.parametrize("overlap", [1e-6, 0.3, 0.99])
def test_f_is_finite_and_fades_far_beyond_the_end(gating, overlap):
    """Every Gaussian underflows there, and the literal Eq. (2) is 0/0."""
    design = DMP(n_basis=80, gating=gating, overlap=overlap).basis.design(np.array([-1.0, 1.5, 3.0, 100.0]))
    assert np.isfinite(design).all()
    assert np.abs(design[-1]).max() < 1e-100


@pytest.mark.parametrize("phase_end", [1e-100, 0.999])
def test_features_are_finite_at_both_ends_of_the_range_of_phases(make_movement, phase_end):
    learned = DMP(n_basis=80, phase_end=phase_end).learn([make_movement(0)[1]])
    assert np.isfinite(learned.weights).all()
    assert np.isfinite(learned.rollout().positions).all()
