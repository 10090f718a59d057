"""Anchoring: movements gathered into symbols, and symbols brought back to movements. Arrays in, records out."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
