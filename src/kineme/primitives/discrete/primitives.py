"""`Primitives`; it lies beside its specification."""

from kineme.primitives.discrete.dmp import Primitives

__all__ = ["Primitives"]
