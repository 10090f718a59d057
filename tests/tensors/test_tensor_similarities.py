"""Gram matrices and the similarity after the best rotation are those of NumPy, with gradients."""

from __future__ import annotations

import numpy as np
import pytest

from kineme import kernels
from kineme.errors import SpecificationError, TrajectoryError
from kineme.kernels.procrustes import Procrustes
from kineme.kernels.rotation import RotationPrior

torch = pytest.importorskip("torch", reason="the extra torch is not installed")

from tensor_movements import tensors  # noqa: E402 - after the package that may be missing
from torch.autograd import gradcheck  # noqa: E402
from torch.func import vmap  # noqa: E402

from kineme.torch import gram, similarity  # noqa: E402

RBF, TRE = kernels.RBF(sigma=1.3), kernels.TruncatedEuclidean(m=1.1, sigma=0.9)
KERNELS = [
    RBF,
    TRE,
    kernels.TruncatedEuclidean(m=0.7, sigma=1.6),
    *(kernels.averaged(kernel, 3, mean) for kernel in (RBF, TRE) for mean in kernels.MEANS),
    kernels.averaged((RBF, TRE, kernels.RBF(sigma=0.4)), 3, "harmonic"),
]


@pytest.mark.parametrize("kernel", KERNELS, ids=repr)
def test_gram_matrices_are_those_of_numpy(kernel):
    A, B = tensors((5, 12), (4, 12))
    A, B = A + 3, B + 3
    assert np.abs(gram(kernel, A, B).numpy() - kernel(A.numpy(), B.numpy())).max() <= 1e-12
    assert np.abs(gram(kernel, A).numpy() - kernel(A.numpy())).max() <= 1e-12
    assert np.abs(gram(kernel, A.float(), B.float()).numpy() - kernel(A.numpy(), B.numpy())).max() <= 1e-5


@pytest.mark.parametrize("kernel", KERNELS, ids=repr)
def test_gradients_of_gram_matrices(kernel):
    A, B = tensors((3, 6), (2, 6), grad=True)
    assert gradcheck(lambda a, b: gram(kernel, a, b), (A, B), fast_mode=True)


@pytest.mark.parametrize("kernel", [kernels.RBF(sigma=0.5), kernels.TruncatedEuclidean(m=1.0)], ids=repr)
@pytest.mark.parametrize("mean", kernels.MEANS)
def test_gradients_are_finite_where_a_similarity_is_none(mean, kernel):
    """Far apart in one dimension, where a kernel is 0 or rounds to it; and of a row with itself."""
    A = torch.tensor([[0.0, 0.0], [0.1, 50.0], [60.0, -60.0]], dtype=torch.float64, requires_grad=True)
    gram(kernels.averaged(kernel, 2, mean), A).sum().backward()
    assert torch.isfinite(A.grad).all()


def _prior(d, vertical):
    return RotationPrior(vertical=(0.0, 0.6, 0.8)) if vertical and d == 3 else RotationPrior()


@pytest.mark.parametrize(("d", "vertical"), [(2, False), (3, False), (3, True)])
def test_similarities_are_those_of_numpy(d, vertical):
    a, b = tensors((5, 20, d), (5, 20, d))
    b = b + 2 * a
    b[2] = -a[2] if d == 2 else a[2] * torch.tensor([1.0, 1.0, -1.0], dtype=a.dtype)  # mirrored in space
    prior = _prior(d, vertical)
    procrustes = Procrustes(d, max_angle=np.pi, prior=prior)
    rows = [(x - x.mean(1, keepdim=True)).mT.reshape(5, -1).numpy() for x in (a, b)]
    A, B = (procrustes.prepare(row) for row in rows)
    expected = np.diag(procrustes.alignment(A, B)) / np.sqrt(A.squares * B.squares)
    assert np.abs(similarity(a, b, prior).numpy() - expected).max() <= 1e-12
    assert np.abs(similarity(a.float(), b.float(), prior).numpy() - expected).max() <= 1e-5


def test_place_and_size_do_not_count_and_turning_costs():
    (a,) = tensors((30, 2))
    turn = torch.tensor([[0.0, -1.0], [1.0, 0.0]], dtype=a.dtype)
    assert similarity(a, 3 * a + 5) == pytest.approx(1.0)
    assert 0.9 < similarity(a, a @ turn.mT) < 0.99
    assert similarity(a, a * torch.tensor([1.0, -1.0])) < 0.9
    (signal,) = tensors((30, 1))
    assert similarity(signal, -signal) == pytest.approx(-1.0)
    assert similarity(a[None], torch.stack((a, -a, a @ turn.mT))).shape == (3,)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_gradients_of_similarities(d):
    a, b = tensors((2, 9, d), (2, 9, d), grad=True)
    assert gradcheck(similarity, (a, b), fast_mode=True)
    still = torch.zeros(2, 9, d, dtype=torch.float64, requires_grad=True)
    (similarity(still, b) + similarity(still, b, RotationPrior(concentration=0.0))).sum().backward()
    assert torch.isfinite(still.grad).all()


def test_similarities_are_mapped_and_compiled_and_look_at_no_values():
    a, b = tensors((4, 9, 3), (4, 9, 3))
    assert torch.allclose(vmap(similarity)(a, b), similarity(a, b))
    compiled = torch.compile(
        lambda x, y: (similarity(x, y), gram(TRE, x[:, 0], y[:, 0])), backend="aot_eager", fullgraph=True
    )
    assert torch.allclose(compiled(a, b)[0], similarity(a, b))
    assert torch.allclose(compiled(a, b)[1], gram(TRE, a[:, 0], b[:, 0]))
    compiled = torch.compile(similarity, backend="aot_eager", fullgraph=True)
    for prior in (RotationPrior(vertical=(0, 0, 1)), RotationPrior(concentration=2.0)):
        assert torch.allclose(compiled(a, b, prior), similarity(a, b, prior))
    meta = torch.empty(4, 9, 3, device="meta")
    assert similarity(meta, meta).shape == (4,)
    assert gram(KERNELS[-1], meta[:, 0]).shape == (4, 4)


def test_a_movement_is_turned_onto_another_by_its_gradient():
    (a,) = tensors((30, 3))
    b = (a + 0.8 * tensors((30, 3), seed=1)[0]).requires_grad_()
    optimizer = torch.optim.Adam([b], lr=0.05)
    first = similarity(a, b).item()
    for _ in range(60):
        optimizer.zero_grad()
        (1 - similarity(a, b)).backward()
        optimizer.step()
    assert first < 0.95
    assert similarity(a, b).item() > 0.995


def test_other_kernels_and_shapes_are_refused():
    A, B = tensors((3, 6), (2, 6))
    with pytest.raises(SpecificationError, match="expected RBF, TruncatedEuclidean, or Averaged of these"):
        gram(kernels.Laplacian(sigma=1.0), A, B)
    with pytest.raises(SpecificationError, match=r"expected a kernel with its width, got RBF\(sigma=None\)"):
        gram(kernels.RBF(), A, B)
    with pytest.raises(SpecificationError, match="expected columns in 4 equal blocks, got 6"):
        gram(kernels.averaged(RBF, 4), A, B)
    with pytest.raises(TrajectoryError, match="expected rows of one length, got 6 and 5"):
        gram(RBF, A, B[:, :5])
    with pytest.raises(TrajectoryError, match="of equal T and d"):
        similarity(torch.zeros(4, 2), torch.zeros(5, 2))
