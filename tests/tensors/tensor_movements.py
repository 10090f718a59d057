"""Small movements and modules that the tests of `kineme.torch` share."""

from __future__ import annotations

import numpy as np

import kineme

FORMULATIONS = ("bio-inspired", "decoupled", "original", "amplitude-scaled")
DURATION, RATE = 0.7, 40.0


def learned(formulation="bio-inspired", n=3, d=2, **options):
    """Primitives of n movements of d dimensions, none of which ends where it starts in any of them."""
    rng = np.random.default_rng(7)
    u = np.linspace(0.0, 1.0, 60)[:, None]
    demos = [
        (0.5 + rng.random(d)) * u + 0.3 * rng.standard_normal(d) * np.sin(np.pi * (1 + k % 2) * u) for k in range(n)
    ]
    times = [u[:, 0] * (0.8 + 0.3 * k) for k in range(n)]
    dmp = kineme.DMP(formulation, n_basis=8, n_points=50, **options)
    return dmp.learn(kineme.Demonstrations.from_arrays(demos, times=times))


def module(formulation="bio-inspired", d=2, **options):
    """A module in double precision."""
    import torch

    options = {"n_weights": 6, "rate": RATE, "duration": DURATION, "dtype": torch.float64, **options}
    return kineme.torch.Primitive(d, formulation=formulation, **options)


def tensors(*shapes, seed=0, grad=False):
    """Normal numbers in double precision, one tensor for each shape."""
    import torch

    generator = torch.Generator().manual_seed(seed)
    return [torch.randn(shape, generator=generator, dtype=torch.float64).requires_grad_(grad) for shape in shapes]
