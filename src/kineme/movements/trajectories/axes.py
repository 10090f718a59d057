"""Names of the dimensions in features, files and figures."""

from __future__ import annotations


def axis_names(n_dims: int) -> list[str]:
    """The names x, y, z, or q1, q2, ... beyond three dimensions."""
    return list("xyz"[:n_dims]) if n_dims <= len("xyz") else [f"q{k + 1}" for k in range(n_dims)]
