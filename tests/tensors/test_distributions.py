"""Distributions of movements are those that the whole covariance matrix gives, at a size that does not grow with T."""

from __future__ import annotations

import pytest

from kineme.errors import SpecificationError, TrajectoryError

torch = pytest.importorskip("torch", reason="the extra torch is not installed")

from tensor_movements import FORMULATIONS, module, tensors  # noqa: E402 - after the package that may be missing
from torch.autograd import gradcheck  # noqa: E402
from torch.distributions import MultivariateNormal  # noqa: E402
from torch.func import jacrev, vmap  # noqa: E402


def _weights(*batch):
    """Means, factors, starts and goals."""
    mean, factor, start, goal = tensors((*batch, 2, 6), (*batch, 12, 12), (*batch, 2), (*batch, 2))
    chol = 0.1 * factor.tril(-1) + torch.diag_embed(0.1 + factor.diagonal(dim1=-2, dim2=-1).abs())
    return mean, chol, start, goal


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_covariances_are_those_of_the_linear_map(formulation):
    mp = module(formulation)
    mean, chol, start, goal = _weights()
    path, covariance = mp.distribution(mean, chol, start, goal, joint=True)
    J = jacrev(mp)(mean, start, goal).reshape(29, 2, 12)
    expected = torch.einsum("tdk,sek->tdse", J @ chol, J @ chol)
    assert torch.allclose(covariance, expected, atol=1e-13)
    assert torch.equal(path, mp(mean, start, goal))
    marginal = mp.distribution(mean, chol, start, goal)[1]
    assert torch.allclose(marginal, torch.einsum("tdte->tde", expected), atol=1e-13)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_densities_are_those_of_all_numbers_together(formulation):
    mp = module(formulation)
    mean, chol, start, goal = _weights(3)
    positions = mp.sample(4, mean, chol, start, goal, generator=torch.Generator().manual_seed(1))
    positions = positions + 0.05 * tensors((4, 3, 29, 2), seed=2)[0]
    path, covariance = mp.distribution(mean, chol, start, goal, joint=True)
    whole = covariance.reshape(3, 58, 58) + 0.05**2 * torch.eye(58, dtype=torch.float64)
    expected = MultivariateNormal(path.reshape(3, 58), whole).log_prob(positions.reshape(4, 3, 58))
    assert torch.allclose(mp.log_prob(positions, mean, chol, start, goal, noise=0.05), expected, atol=1e-8)


def test_start_and_goal_are_those_of_the_positions_by_default():
    mp = module()
    mean, chol, start, goal = _weights(3)
    positions = mp(mean, start, goal)
    ends = positions[:, 0], positions[:, -1]
    assert torch.equal(mp.log_prob(positions, mean, chol), mp.log_prob(positions, mean, chol, *ends))


def test_samples_have_the_distribution_and_gradients():
    mp = module()
    mean, chol, start, goal = _weights()
    samples = mp.sample(20_000, mean, chol, start, goal, generator=torch.Generator().manual_seed(0))
    path, covariance = mp.distribution(mean, chol, start, goal)
    assert torch.allclose(samples.mean(dim=0), path, atol=5 * float(covariance.amax().sqrt()) / 20_000**0.5)
    centered = samples - path
    empirical = torch.einsum("ntd,nte->tde", centered, centered) / 20_000
    assert torch.allclose(empirical, covariance, atol=0.1 * float(covariance.amax()))
    chol = chol.requires_grad_()
    mp.sample(3, mean, chol, start, goal).sum().backward()
    assert chol.grad.abs().sum() > 0


@pytest.mark.parametrize("formulation", ["bio-inspired", "original"])
def test_gradients_of_densities(formulation):
    mp = module(formulation)
    mean, chol, start, goal = _weights(2)
    positions = mp(mean, start, goal) + 0.1
    numbers = tuple(part.clone().requires_grad_() for part in (positions, mean, chol, start, goal))
    assert gradcheck(lambda *parts: mp.log_prob(*parts, noise=0.3), numbers, fast_mode=True)
    assert gradcheck(lambda *parts: mp.distribution(*parts)[1], numbers[1:], fast_mode=True)


@pytest.mark.soak
def test_densities_are_mapped_and_compiled_and_work_in_single_precision():
    mp = module()
    mean, chol, start, goal = _weights(3)
    positions = mp.sample(1, mean, chol, start, goal)[0]
    expected = mp.log_prob(positions, mean, chol)
    assert torch.allclose(vmap(mp.log_prob)(positions, mean, chol), expected, atol=1e-8)
    compiled = torch.compile(mp.log_prob, backend="aot_eager", fullgraph=True)
    assert torch.allclose(compiled(positions, mean, chol), expected, atol=1e-10)
    single = mp.float().log_prob(positions.float(), mean.float(), chol.float())
    assert torch.allclose(single.double(), expected, rtol=1e-2)


def test_what_is_no_distribution_is_refused():
    mp = module()
    mean, chol, start, goal = _weights(3)
    with pytest.raises(TrajectoryError, match=r"expected chol \(..., 12, 12\), got \(3, 6, 6\)"):
        mp.distribution(mean, chol[:, :6, :6], start, goal)
    with pytest.raises(SpecificationError, match="expected noise"):
        mp.log_prob(mp(mean, start, goal), mean, chol, noise=0.0)
    with pytest.raises(SpecificationError, match="expected size"):
        mp.sample(0, mean, chol, start, goal)


def test_a_matrix_that_cannot_be_decomposed_gives_nan_for_its_movement_alone():
    """As NaN does: an error would look at values."""
    mp = module()
    mean, chol, start, goal = _weights(3)
    positions = mp(mean, start, goal)
    chol[1], chol[2] = torch.nan, 1e12  # of rank one, beside which the noise is lost in rounding
    assert torch.isnan(mp.log_prob(positions, mean, chol)).tolist() == [False, True, True]
