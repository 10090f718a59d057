"""`RhythmicPrimitives`; it lies beside its specification."""

from kineme.primitives.rhythmic.rhythmic_dmp import RhythmicPrimitives

__all__ = ["RhythmicPrimitives"]
