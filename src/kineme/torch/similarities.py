"""Similarities of movements and of feature rows as differentiable functions: losses, and Gram matrices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from kineme.errors import SpecificationError, TrajectoryError
from kineme.kernels.base import Kernel
from kineme.kernels.rotation import RotationPrior
from kineme.kernels.table import RBF, Averaged, TruncatedEuclidean

_SMALL = 1e-30  # added below roots, whose slope at 0 is infinite

#: Name of a mean in `kineme.kernels.MEANS` -> the average over the first axis.
_MEANS: dict[str, Callable[[Tensor], Tensor]] = {
    "arithmetic": lambda k: k.mean(dim=0),
    "geometric": lambda k: _if_positive(k, lambda safe: safe.log().mean(dim=0).exp()),
    "harmonic": lambda k: _if_positive(k, lambda safe: 1.0 / (1.0 / safe).mean(dim=0)),
    "quadratic": lambda k: (k.square().mean(dim=0) + _SMALL).sqrt(),
    "min": lambda k: k.amin(dim=0),
}


def _if_positive(k: Tensor, average: Callable[[Tensor], Tensor]) -> Tensor:
    """Average of similarities (d, ...), 0 where one is, without gradients that are not finite."""
    positive = k > 0
    return torch.where(positive.all(dim=0), average(torch.where(positive, k, 1.0)), 0.0)


def gram(kernel: Kernel, A: Tensor, B: Tensor | None = None) -> Tensor:
    """Gram matrix (..., n, m) of feature rows A (..., n, p) and B (..., m, p), differentiable in both.

    Where the truncated kernel has a corner, at equal and at just truncated coordinates, the gradient is that of one
    side. Coordinates of all pairs exist at a time, n m p numbers, but for `RBF`.

    Parameters
    ----------
    kernel : RBF, TruncatedEuclidean or Averaged of these
        With its widths, which movements fit elsewhere: ``kineme.kernels.RBF(sigma=2.0)``.
    A, B : Tensor
        B is A by default.

    Raises
    ------
    SpecificationError
        Another kernel, or one without a width; columns that are not n_dims equal blocks.
    TrajectoryError
        Rows of different lengths.
    """
    B = A if B is None else B
    if A.shape[-1] != B.shape[-1]:
        raise TrajectoryError(f"expected rows of one length, got {A.shape[-1]} and {B.shape[-1]} columns")
    if isinstance(kernel, Averaged):
        if A.shape[-1] % kernel.n_dims:
            raise SpecificationError(f"expected columns in {kernel.n_dims} equal blocks, got {A.shape[-1]} columns")
        kernels = kernel.kernel if isinstance(kernel.kernel, tuple) else (kernel.kernel,) * kernel.n_dims
        blocks = zip(kernels, A.chunk(kernel.n_dims, -1), B.chunk(kernel.n_dims, -1), strict=True)
        return _MEANS[kernel.mean](torch.stack([gram(part, a, b) for part, a, b in blocks]))
    if isinstance(kernel, TruncatedEuclidean):
        m = _width(kernel, kernel.m)
        distances = (A[..., :, None, :] - B[..., None, :, :]).abs().clamp(max=m * min(1.0, kernel.sigma))
        return m - distances.mean(dim=-1) / kernel.sigma
    if isinstance(kernel, RBF):
        center = B.mean(dim=-2, keepdim=True)  # norms and distances then share fewer digits
        a, b = ((rows - center) / _width(kernel, kernel.sigma) for rows in (A, B))
        squares = a.square().sum(-1)[..., :, None] + b.square().sum(-1)[..., None, :] - 2.0 * a @ b.mT
        return torch.exp(-0.5 * squares.clamp(min=0.0))
    raise SpecificationError(f"expected RBF, TruncatedEuclidean, or Averaged of these, got {kernel!r}")


def similarity(a: Tensor, b: Tensor, prior: RotationPrior | None = None) -> Tensor:
    """Similarity (...) of movements (..., T, d) after the best rotation, 1 at most; ``1 - similarity`` is a loss.

    Of centered movements it is ``max_R [<a, R b> / (|a| |b|) + tr(R' F) - tr F]`` over rotations R, without mirror
    images: place and size do not count, and the larger a rotation, the more it costs. With ``M = a' b / (|a| |b|) + F``
    the maximum of ``tr(R' M)`` is ``sqrt((M11 + M22)^2 + (M21 - M12)^2)`` in the plane, and the sum of the singular
    values, the last with the sign of det M, in space. In one dimension, and in more than three, nothing is rotated.

    Parameters
    ----------
    a, b : Tensor of shape (..., T, d)
        Samples at the same phases; batch shapes broadcast.
    prior : kineme.kernels.rotation.RotationPrior, optional
        F; by default that of `kineme.Recognizer`.

    Raises
    ------
    TrajectoryError
        Movements of other numbers of samples or dimensions.
    """
    if a.ndim < 2 or a.shape[-2:] != b.shape[-2:]:
        raise TrajectoryError(
            f"expected movements (..., T, d) of equal T and d, got {tuple(a.shape)} and {tuple(b.shape)}"
        )
    d = a.shape[-1]
    a, b = (movement - movement.mean(dim=-2, keepdim=True) for movement in (a, b))
    a, b = (movement / (movement.square().sum(dim=(-1, -2), keepdim=True) + _SMALL).sqrt() for movement in (a, b))
    M = a.mT @ b
    if d not in (2, 3):
        return M.diagonal(dim1=-2, dim2=-1).sum(-1)
    F = _written((prior or RotationPrior()).matrix(d), M)
    M, cost = M + F, F.trace()
    if d == 2:
        along, across = M[..., 0, 0] + M[..., 1, 1], M[..., 1, 0] - M[..., 0, 1]
        return (along.square() + across.square() + _SMALL).sqrt() - cost
    values = torch.linalg.svdvals(M)
    return values[..., 0] + values[..., 1] + torch.linalg.det(M).sign() * values[..., 2] - cost


def _written(matrix: Any, like: Tensor) -> Tensor:
    """Return a matrix of NumPy's on the device of a tensor; on a GPU number by number, as it waits for a copy."""
    how = {"dtype": like.dtype, "device": like.device}
    if like.device.type == "cpu" or torch.compiler.is_compiling():  # compiled, it is a constant of the program
        return torch.as_tensor(matrix, **how)
    return torch.stack([torch.full((), entry, **how) for entry in matrix.ravel().tolist()]).reshape(matrix.shape)


def _width(kernel: Kernel, width: float | None) -> float:
    if width is None:
        raise SpecificationError(f"expected a kernel with its width, got {kernel!r}; say one")
    return float(width)
